"""The twin's inner loop: the motion of a planar chain after one push and its derivative by every unknown, compiled.

In absolute angles φ and speeds ω (nlink), with the law's lumps less the chain's (tilde less none), Eq. 4 is

    M α = F,    F_i = Σ_j (ã − a)_ij sin(φ_i − φ_j) ω_j² − g (μ̃ − μ)_i sin φ_i + f_i − f_{i+1} + Q_i    (22)

f_k is what is left of the friction in joint k, with the torque of a spring there, and Q a force that is known
beforehand. Where link i leans by λ_i when its angle is 0, sines and cosines are of φ_i + λ_i. A step is the plant's,
ω ← ω + h α and then φ ← φ + h ω. `tangent` has its derivative, Eq. 23.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled import compiled, dahl
from metaid.estimation.tangent import force_by_unknowns, linearise, move_tangent
from metaid.models import SLIDING


@compiled
def watch_push(start, forces, balance, derivatives, settings, ends, work, shown, slopes):  # type: ignore[no-untyped-def]
    """Runs one push that gives the joints the speeds `start` (njoint); returns how many windows it got through.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        forces: Q of Eq. 22 at each step (nstep x njoint), in N m; or empty.
        balance, derivatives, work: see `workspace`.
        settings: timestep in s; whether energies are differentiated too.
        ends: the steps (nwindow) that the windows end with.
        shown: joint angles, joint speeds, ∫ q̇² dt and ∫ (q̈ + k q)² dt, (nwindow x njoint) each, filled in.
        slopes: derivatives of joint speeds and the two energies, (nwindow x njoint x nunknown) each, filled in.
    """
    timestep, with_energies = settings
    set_off(start, 0, 0, work)
    window = 0
    for step in range(ends[-1]):
        if not accelerate(step, forces, balance, work):
            return window
        _add_energies(timestep, balance.stiffness, work)
        if work.moved.shape[1] > 0:
            linearise(balance, work)
            force_by_unknowns(derivatives, work)
            move_tangent(timestep, balance.stiffness, with_energies, work)
        if not move(timestep, work):
            return window
        if step + 1 == ends[window]:
            _show(window, timestep, start, work, shown)
            _show_slopes(window, timestep, shown[1], with_energies, work, slopes)
            window += 1
    return window


@compiled
def set_off(start, start_column, extra, work):  # type: ignore[no-untyped-def]
    """Sets the twin on its way. Nothing depends on an unknown, but what is unknown of the start.

    Args:
        start: joint angles and speeds (2 x njoint), in rad and rad/s.
        start_column: of the first unknown of the start.
        extra: how many of the last numbers of the start are unknown.
        work: see `workspace.Workspace`.
    """
    n = start.shape[1]
    lean, below = 0.0, 0.0
    for i in range(n):
        lean, below = lean + start[0, i], below + start[1, i]
        work.angle[i], work.speed[i], work.speed_energy[i], work.acceleration_energy[i] = lean, below, 0.0, 0.0
        work.slip[0, i] = np.sign(start[1, i])
    work.moved[:] = 0.0
    work.slipped[:] = 0.0
    work.speed_slopes[:] = 0.0
    work.acceleration_slopes[:] = 0.0
    for column in range(extra):
        kind, joint = divmod(2 * n - extra + column, n)
        for i in range(joint, n):  # a joint turns every link above it
            work.moved[kind * n + i, start_column + column] = 1.0


@compiled
def accelerate(step, forces, balance, work):  # type: ignore[no-untyped-def]
    """Fills in α of Eq. 22 and the factors of M; whether M is positive definite, as that of any chain is.

    Args:
        step: that begins, from 0.
        forces: Q of Eq. 22 at each step (nstep x njoint), in N m; or empty.
        balance: what the motion follows from; see `workspace.Balance`.
        work: with the state, see `workspace.Workspace`; `cosine`, `sine`, `acceleration` and `factors` are filled in.
    """
    angle, cosine, sine = work.angle, work.cosine, work.sine
    for i in range(angle.shape[0]):
        true_angle = angle[i] + balance.lean[i]
        cosine[i], sine[i] = np.cos(true_angle), np.sin(true_angle)
    _force(step, forces, balance, work)
    return _solve(balance, work)


@compiled
def _force(step, forces, balance, work):  # type: ignore[no-untyped-def]
    """Fills `acceleration` with F of Eq. 22."""
    angle, speed, force, cosine, sine = work.angle, work.speed, work.acceleration, work.cosine, work.sine
    n, stiffness = angle.shape[0], balance.stiffness
    carried = 0.0  # friction in the joint above, from the tip down
    for i in range(n - 1, -1, -1):
        joint_speed = speed[i] - (speed[i - 1] if i > 0 else 0.0)
        joint_angle = angle[i] - (angle[i - 1] if i > 0 else 0.0)
        bent = joint_angle - balance.straight[i]
        share = min(max(joint_speed * (1.0 / SLIDING), -1.0), 1.0)
        friction = balance.damping[i] * joint_speed + balance.coulomb[i] * share + balance.spring[i] * bent
        if balance.cogging[2, i] != 0.0:
            phase = balance.cogging[2, i] * bent
            friction += balance.cogging[0, i] * np.cos(phase) + balance.cogging[1, i] * np.sin(phase)  # Eq. 42
        if balance.presliding > 0.0:
            friction -= slipping(i, joint_angle, joint_speed, balance, work)
        force[i] = friction - carried - balance.gravity[i] * sine[i] - stiffness * balance.law_inertia[i] * angle[i]
        carried = friction
        if forces.shape[0] > 0:
            force[i] += forces[step, i]
        for j in range(n):
            difference = sine[i] * cosine[j] - cosine[i] * sine[j]
            force[i] += balance.coriolis[i, j] * difference * speed[j] * speed[j]
            if stiffness != 0.0:
                common = cosine[i] * cosine[j] + sine[i] * sine[j]
                force[i] -= stiffness * balance.law_coriolis[i, j] * common * angle[j]


@compiled
def slipping(joint, joint_angle, joint_speed, balance, work):  # type: ignore[no-untyped-def]
    """Dry friction, in N m, in a joint, by Dahl's law from where the step began (Eq. 67); keeps its share.

    Args:
        joint: which, from 0.
        joint_angle: in rad.
        joint_speed: in rad/s.
        balance, work: see `workspace`.
    """
    share = dahl(work.slip[0, joint], joint_angle - work.slip[1, joint], joint_speed, balance.presliding)
    work.slip[2, joint] = share
    return balance.dry[joint] * share


@compiled
def _solve(balance, work):  # type: ignore[no-untyped-def]
    """Turns F into α = M⁻¹ F by M = L D Lᵀ; False where M is not positive definite."""
    acceleration, cosine, sine, factors = work.acceleration, work.cosine, work.sine, work.factors
    n = acceleration.shape[0]
    for i in range(n):
        force, pivot = acceleration[i], balance.mass_inertia[i]
        for j in range(i):
            factor = balance.mass_coriolis[i, j] * (cosine[i] * cosine[j] + sine[i] * sine[j])
            if j == i - 1:
                factor -= balance.rotor[i]
            for k in range(j):
                factor -= factors[i, k] * factors[j, k] * factors[k, k]
            factor /= factors[j, j]
            factors[i, j] = factor
            force -= factor * acceleration[j]
            pivot -= factor * factor * factors[j, j]
        if not pivot > 0.0:
            return False
        factors[i, i] = pivot
        acceleration[i] = force
    for i in range(n - 1, -1, -1):
        acceleration[i] /= factors[i, i]
        for k in range(i + 1, n):
            acceleration[i] -= factors[k, i] * acceleration[k]
    return True


@compiled
def move(timestep, work):  # type: ignore[no-untyped-def]
    """Euler's step; False beyond a radian a step, where nothing is simulated any more, and for NaN."""
    for i in range(work.angle.shape[0]):
        work.speed[i] += timestep * work.acceleration[i]
        work.angle[i] += timestep * work.speed[i]
        if not abs(work.speed[i]) * timestep <= 1.0:
            return False
    return True


@compiled
def _add_energies(timestep, stiffness, work):  # type: ignore[no-untyped-def]
    """Adds what this step has of ∫ q̇² dt (the ends of the trapezoid are put right by `_show`) and ∫ (q̈ + k q)² dt."""
    angle, speed, acceleration = work.angle, work.speed, work.acceleration
    for i in range(angle.shape[0]):
        joint_speed, deviation = speed[i], acceleration[i] + stiffness * angle[i]
        if i > 0:
            joint_speed -= speed[i - 1]
            deviation -= acceleration[i - 1] + stiffness * angle[i - 1]
        work.speed_energy[i] += timestep * joint_speed * joint_speed
        work.acceleration_energy[i] += timestep * deviation * deviation


@compiled
def _show(window, timestep, start, work, shown):  # type: ignore[no-untyped-def]
    """Fills in what the push has shown to the end of this `window`."""
    angles, speeds, speed_energy, acceleration_energy = shown
    for i in range(start.shape[1]):
        angle, speed, begin = work.angle[i], work.speed[i], start[1, i]
        if i > 0:
            angle -= work.angle[i - 1]
            speed -= work.speed[i - 1]
        angles[window, i], speeds[window, i] = angle, speed
        speed_energy[window, i] = work.speed_energy[i] + 0.5 * timestep * (speed * speed - begin * begin)
        acceleration_energy[window, i] = work.acceleration_energy[i]


@compiled
def _show_slopes(window, timestep, speeds, with_energies, work, slopes):  # type: ignore[no-untyped-def]
    """Fills in its derivatives; `speeds` are the joints' (nwindow x njoint)."""
    by_speed, by_speed_energy, by_acceleration_energy = slopes
    _, n, nunknown = by_speed.shape
    for i in range(n):
        row, own = by_speed[window, i], work.moved[n + i]
        for p in range(nunknown):
            row[p] = own[p]
        if i > 0:
            below = work.moved[n + i - 1]
            for p in range(nunknown):
                row[p] -= below[p]
        if with_energies:
            for p in range(nunknown):
                end = timestep * speeds[window, i] * row[p]
                by_speed_energy[window, i, p] = work.speed_slopes[i, p] + end
                by_acceleration_energy[window, i, p] = work.acceleration_slopes[i, p]
