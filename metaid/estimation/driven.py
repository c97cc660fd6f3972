"""The twin of a noisy plant: driven by the torques that were commanded, and seen as its sensors see it, compiled.

The law acts on noisy readings, so a twin under the same law would move differently. But the torque that the law made
of these readings is known to the last bit. What is compared are the coefficients of a joint's angles in polynomials
that are orthonormal on the readings of a window, Σ_t p_k(t) q(t) (Eq. 28). The noise in each is that of one reading.
"""

from __future__ import annotations

from metaid.compiled import compiled, fused
from metaid.estimation.flow import flow
from metaid.estimation.motion import accelerate, move, set_off
from metaid.estimation.tangent import force_by_unknowns, linearise, move_tangent


@compiled
def watch_readings(start, forces, balance, derivatives, settings, basis, steps, work, coefficients, slopes):  # type: ignore[no-untyped-def]
    """Runs one push; whether the twin could follow.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        forces: Q of Eq. 22 at each step (nstep x njoint), in N m: what was commanded.
        balance, derivatives, work: see `workspace`; `balance` without a law.
        settings: timestep of each step (nstep), in s; the column of the first of the start's unknowns; how many these
            are; how many timesteps a step has; whether the plant moves continuously.
        basis: the polynomials at every reading (nstep + 1 x ncoefficient), that of the push first.
        steps: for how many the push is followed.
        coefficients: of the joint angles (njoint x ncoefficient), in rad, filled in.
        slopes: their derivatives (njoint x ncoefficient x nunknown), filled in.
    """
    timesteps, start_column, extra, substeps, is_continuous = settings
    set_off(start, start_column, extra, work)
    coefficients[:] = 0.0
    slopes[:] = 0.0
    if steps > 0:
        _add(basis[0], work, coefficients)
        _add_slopes(basis[0], work, slopes)
    for step in range(steps):
        timestep = timesteps[step]
        for _ in range(substeps):
            if is_continuous:
                if not flow(step, forces, balance, derivatives, timestep, work):
                    return False
                continue
            if not accelerate(step, forces, balance, work):
                return False
            linearise(balance, work)
            force_by_unknowns(derivatives, work)
            move_tangent(timestep, 0.0, False, work)
            if not move(timestep, work):
                return False
        _add(basis[step + 1], work, coefficients)
        _add_slopes(basis[step + 1], work, slopes)
    return True


@compiled
def _add(polynomials, work, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the reading after this step has of the coefficients."""
    below = 0.0
    for i in range(coefficients.shape[0]):
        for k in range(coefficients.shape[1]):
            coefficients[i, k] += polynomials[k] * (work.angle[i] - below)
        below = work.angle[i]


@fused
def _add_slopes(polynomials, work, slopes):  # type: ignore[no-untyped-def]
    """Adds what it has of their derivatives. `changed` is free until the next step."""
    njoint, ncoefficient, nunknown = slopes.shape
    for i in range(njoint):
        own, joint = work.moved[i], work.changed[0, :nunknown]
        for p in range(joint.shape[0]):
            joint[p] = own[p]
        if i > 0:
            below = work.moved[i - 1]
            for p in range(joint.shape[0]):
                joint[p] -= below[p]
        for k in range(ncoefficient):
            polynomial, row = polynomials[k], slopes[i, k]
            for p in range(row.shape[0]):
                row[p] += polynomial * joint[p]
