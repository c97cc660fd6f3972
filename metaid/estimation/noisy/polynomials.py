"""What is compared of the readings of noisy sensors: coefficients in polynomials, starts eliminated push by push."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from metaid.episode import window_ends
from metaid.estimation.descent import Residuals
from metaid.models import Array

POLYNOMIALS = 6  # of a joint's angles in a window: what an arm or a chain that nearly coasts shows in it
SHORTEST = 1 / 8  # of the horizon; a shorter window tells little above the noise
STRIDE = 4  # windows are twice as long as those so many before
# A misfit is explained by so much of the noise, for its size is known to some hundredths only, and so many standard
# deviations of chance.
ROUGH_NOISE, CHANCE = 1.1, 4.0

# Residuals of a trial (npush x nvalue), scaled by the noise, joint by joint, and their derivatives (npush x nvalue x
# nunknown + nextra), those by what a push alone has last; zeros where a push was not seen.
Compared = tuple[Array, Array]


class PolynomialWindows(NamedTuple):
    """The steps (nwindow) at which windows end, and polynomials that are orthonormal on the readings of each (nwindow x
    nstep + 1 x ncoefficient).
    """

    ends: NDArray[np.int64]
    basis: Array

    def are_reached(self, steps: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which pushes were seen to the end of the shortest window (npush), by how many `steps` each was seen."""
        return np.asarray(steps >= self.ends[0])


@lru_cache(maxsize=64)
def polynomial_windows(steps: int) -> PolynomialWindows:
    """Those of a horizon of so many `steps`, in POLYNOMIALS from the SHORTEST on."""
    count = 1 + round(-STRIDE * np.log2(SHORTEST))
    ends = np.array(window_ends(steps, count, SHORTEST))
    ends = ends[ends >= min(POLYNOMIALS, ends[-1])]
    basis = np.zeros((len(ends), ends[-1] + 1, min(POLYNOMIALS, ends[0] + 1)))
    for window, end in enumerate(ends):
        times = np.linspace(-1.0, 1.0, end + 1)
        basis[window, : end + 1] = np.linalg.qr(legendre.legvander(times, basis.shape[2] - 1))[0]
    return PolynomialWindows(ends, basis)


def explained_by_noise(count: int) -> float:
    """The misfit of so many residuals that are nothing but noise is about 1, with a standard deviation of 1/√(2n)."""
    return ROUGH_NOISE + CHANCE / float(np.sqrt(2.0 * max(count, 1)))


def in_polynomials(readings: Array, steps: NDArray[np.int64], basis: Array) -> Array:
    """The coefficients (npush x njoint x ncoefficient) of `readings` (npush x nreading x njoint) in the first `steps`
    (npush) of each push by a `basis` (npush x nreading x ncoefficient); zeros of no steps.
    """
    belong = (np.arange(readings.shape[1]) <= steps[:, None]) & (steps[:, None] > 0)
    return np.asarray(np.einsum("ptk,ptj->pjk", basis, readings * belong[..., None]), dtype=np.float64)


def eliminated(compared: Compared, whitened: Array, pushes: int) -> Residuals:
    """The residuals of a trial of which so many `pushes` were seen, by what was `compared`; what each push has alone,
    `whitened` (npush x nextra), where it serves best.

    With r the residuals of a push, J and S their derivatives by the unknowns of all pushes and by its whitened start
    speeds u, an orthogonal transformation turns the rows [S J r] and [1 0 u] so that S is triangular and zero below:
    there the rest is free of it, and above it says what u follows.  Eq. 34.
    """
    values, slopes = compared
    (npush, nvalue, width), speeds = slopes.shape, whitened.shape[1]
    count, total = width - speeds, pushes * nvalue
    cost = 0.5 * float((values**2).sum() + (whitened**2).sum())
    if speeds == 0:
        left = values.ravel(), slopes.reshape(values.size, count)
        return Residuals(*left, cost, total, np.empty((0, 1 + count)))
    rows = np.zeros((npush, nvalue + speeds, width + 1))
    rows[:, :nvalue, :speeds], rows[:, :nvalue, speeds:-1] = slopes[..., count:], slopes[..., :count]
    rows[:, nvalue:, :speeds] = np.eye(speeds)
    rows[:, :nvalue, -1], rows[:, nvalue:, -1] = values, whitened
    reduced: Array = np.asarray(np.linalg.qr(rows, mode="r"))
    above = np.linalg.solve(reduced[:, :speeds, :speeds], reduced[:, :speeds, speeds:])
    following = -np.concatenate([above[..., -1:], above[..., :-1]], axis=-1)
    below = reduced[:, speeds:, speeds:].reshape(-1, count + 1)
    return Residuals(below[:, -1], below[:, :-1], cost, total, following.reshape(-1, 1 + count))


def together(trials: Sequence[Residuals]) -> Residuals:
    """Those of all `trials`."""
    return Residuals(
        np.concatenate([each.values for each in trials]),
        np.concatenate([each.slopes for each in trials]),
        sum(each.cost for each in trials),
        sum(each.count for each in trials),
        np.concatenate([each.following for each in trials]),
    )
