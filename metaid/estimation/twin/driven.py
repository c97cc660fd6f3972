"""The twin of a noisy plant: driven by the torques that were commanded, and seen as its sensors see it, compiled.

The law acts on noisy readings, so a twin under the same law would move differently. But the torque that the law made
of these readings is known to the last bit. What is compared are the coefficients of a joint's angles in polynomials
that are orthonormal on the readings of a window, Σ_t p_k(t) q(t) (Eq. 33). The noise in each is that of one reading.
Where torques are noisy, the readings set the twin right, and its whitened innovations take the place of the angles
(Eq. 36).
"""

from __future__ import annotations

from metaid.compiled import compiled, fused
from metaid.estimation.twin.flow import flow
from metaid.estimation.twin.joints import joint_slopes, joint_state
from metaid.estimation.twin.state import set_off


@compiled
def watch_readings(start, forces, balance, derivatives, settings, led, basis, steps, work, coefficients, slopes):  # type: ignore[no-untyped-def]
    """Runs one push; whether the twin could follow.

    Args:
        start: joint angles and speeds (2 x njoint) right after the push, in rad and rad/s.
        forces: at each step (nstep x njoint), in N m, in the kernel's coordinates: what was commanded.
        balance, derivatives: of a kernel; the first without a law.
        settings: timestep of each step (nstep), in s; the column of the first of the start's unknowns; how many these
            are; how many timesteps a step has; whether the plant moves continuously.
        led: the angles that were read (nstep + 1 x njoint), in rad, in the kernel's coordinates, and the gains and the
            weights that `filtered.lead` has filled in; all empty for a twin that is not led.
        basis: the polynomials at every reading (nstep + 1 x ncoefficient), that of the push first.
        steps: for how many the push is followed.
        work: see `workspace`.
        coefficients: of the joint angles (njoint x ncoefficient), in rad, or of the whitened innovations, filled in.
        slopes: their derivatives (njoint x ncoefficient x nunknown), filled in.
    """
    timesteps, start_column, extra, substeps, is_continuous = settings
    readings, gains, weights = led
    set_off(start, start_column, extra, work)
    coefficients[:] = 0.0
    slopes[:] = 0.0
    for reading in range(steps + 1 if steps > 0 else 0):
        for _ in range(substeps if reading > 0 else 0):
            if not flow(reading - 1, forces, balance, derivatives, None, timesteps[reading - 1], is_continuous, work):
                return False
        if readings.shape[0] > 0:
            _correct_tangent(gains[reading], weights[reading], basis[reading], work, slopes)
            _correct_state(readings[reading], gains[reading], weights[reading], basis[reading], work, coefficients)
        else:
            _add(basis[reading], work, coefficients)
            _add_slopes(basis[reading], work, slopes)
    return True


@compiled
def _add(polynomials, work, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the reading after this step has of the coefficients."""
    for i in range(coefficients.shape[0]):
        angle = joint_state(i, work)[0]
        for k in range(coefficients.shape[1]):
            coefficients[i, k] += polynomials[k] * angle


@fused
def _add_slopes(polynomials, work, slopes):  # type: ignore[no-untyped-def]
    """Adds what it has of their derivatives. `changed` is free until the next step."""
    njoint, ncoefficient, nunknown = slopes.shape
    for i in range(njoint):
        joint = work.changed[0, :nunknown]
        joint_slopes(i, 0, joint, work)
        for k in range(ncoefficient):
            polynomial, row = polynomials[k], slopes[i, k]
            for p in range(row.shape[0]):
                row[p] += polynomial * joint[p]


@fused
def _correct_state(seen, gain, weight, polynomials, work, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the innovation of a reading has of the coefficients, and sets the state right by it."""
    innovation = work.free
    n = innovation.shape[0]
    for i in range(n):
        innovation[i] = work.angle[i] - seen[i]
    for i in range(n):
        whitened = 0.0
        for j in range(n):
            whitened += weight[i, j] * innovation[j]
            work.angle[i] -= gain[i, j] * innovation[j]
            work.speed[i] -= gain[n + i, j] * innovation[j]
        for k in range(coefficients.shape[1]):
            coefficients[i, k] += polynomials[k] * whitened


@fused
def _correct_tangent(gain, weight, polynomials, work, slopes):  # type: ignore[no-untyped-def]
    """The same of the derivatives. `changed` is free until the next step."""
    moved, changed = work.moved, work.changed
    n, ncoefficient, nunknown = slopes.shape
    for i in range(n):
        row, own = changed[i, :nunknown], moved[i, :nunknown]
        for p in range(row.shape[0]):
            row[p] = own[p]
    for r in range(2 * n):
        row = moved[r, :nunknown]
        for j in range(n):
            share, other = gain[r, j], changed[j, :nunknown]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
    for i in range(n - 1, -1, -1):  # from the last on: L⁻¹ is triangular
        row, scale = changed[i, :nunknown], weight[i, i]
        for p in range(row.shape[0]):
            row[p] *= scale
        for j in range(i):
            share, other = weight[i, j], changed[j, :nunknown]
            for p in range(row.shape[0]):
                row[p] += share * other[p]
        for k in range(ncoefficient):
            polynomial, slope = polynomials[k], slopes[i, k]
            for p in range(slope.shape[0]):
                slope[p] += polynomial * row[p]
