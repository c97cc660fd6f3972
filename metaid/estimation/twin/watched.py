"""The motion of a twin after one push, under the very law that was sent, and its derivative by every unknown, compiled.

A step is the simulated plant's, ω ← ω + h α and then φ ← φ + h ω. `tangent` has its derivative, Eq. 23.
"""

from __future__ import annotations

from metaid.compiled import compiled
from metaid.estimation.twin.joints import joint_state
from metaid.estimation.twin.kernels import accelerate, force_by_unknowns, linearise
from metaid.estimation.twin.state import move, set_off
from metaid.estimation.twin.tangent import accelerate_tangent, add_energy_slopes, move_tangent


@compiled
def watch_push(start, forces, balance, derivatives, settings, ends, work, shown, slopes):  # type: ignore[no-untyped-def]
    """Runs one push that gives the joints the speeds `start` (njoint); returns how many windows it got through.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        forces: that act beside the law at each step (nstep x njoint), in N m; or empty.
        balance, derivatives: of a kernel.
        work: see `workspace`.
        settings: timestep in s; whether energies are differentiated too.
        ends: the steps (nwindow) that the windows end with, of those that are wanted.
        shown: joint angles, joint speeds, ∫ q̇² dt and ∫ (q̈ + k q)² dt, (nwindow x njoint) each, filled in.
        slopes: derivatives of joint speeds and the two energies, (nwindow x njoint x nunknown) each, filled in.
    """
    timestep, with_energies = settings
    set_off(start, 0, 0, work)
    window = 0
    for step in range(ends[-1] if ends.shape[0] > 0 else 0):
        if not accelerate(step, forces, balance, work):
            return window
        _add_energies(timestep, balance.stiffness, work)
        if work.moved.shape[1] > 0:
            linearise(balance, work)
            force_by_unknowns(balance, derivatives, work)
            accelerate_tangent(work)
            if with_energies:
                add_energy_slopes(timestep, balance.stiffness, work)
            move_tangent(timestep, work)
        if not move(timestep, work):
            return window
        if step + 1 == ends[window]:
            _show(window, timestep, start, work, shown)
            _show_slopes(window, timestep, shown[1], with_energies, work, slopes)
            window += 1
    return window


@compiled
def _add_energies(timestep, stiffness, work):  # type: ignore[no-untyped-def]
    """Adds what this step has of ∫ q̇² dt (the ends of the trapezoid are put right by `_show`) and ∫ (q̈ + k q)² dt."""
    angle, speed, acceleration = work.angle, work.speed, work.acceleration
    for i in range(angle.shape[0]):
        joint_speed, deviation, below = speed[i], acceleration[i] + stiffness * angle[i], work.below[i]
        if below >= 0:
            joint_speed -= speed[below]
            deviation -= acceleration[below] + stiffness * angle[below]
        work.speed_energy[i] += timestep * joint_speed * joint_speed
        work.acceleration_energy[i] += timestep * deviation * deviation


@compiled
def _show(window, timestep, start, work, shown):  # type: ignore[no-untyped-def]
    """Fills in what the push has shown to the end of this `window`."""
    angles, speeds, speed_energy, acceleration_energy = shown
    for i in range(start.shape[1]):
        (angle, speed), begin = joint_state(i, work), start[1, i]
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
        if work.below[i] >= 0:
            below = work.moved[n + work.below[i]]
            for p in range(nunknown):
                row[p] -= below[p]
        if with_energies:
            for p in range(nunknown):
                end = timestep * speeds[window, i] * row[p]
                by_speed_energy[window, i, p] = work.speed_slopes[i, p] + end
                by_acceleration_energy[window, i, p] = work.acceleration_slopes[i, p]
