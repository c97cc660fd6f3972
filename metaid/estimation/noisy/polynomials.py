"""What is compared of the readings of noisy sensors: coefficients in polynomials, starts eliminated push by push."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from metaid.episode import window_ends
from metaid.models import Array

POLYNOMIALS = 6  # of a joint's angles in a window: what an arm or a chain that nearly coasts shows in it
SHORTEST = 1 / 8  # of the horizon; a shorter window tells little above the noise
STRIDE = 4  # windows are twice as long as those so many before
# A misfit is explained by so much of the noise, for its size is known to some hundredths only, and so many standard
# deviations of chance.
ROUGH_NOISE, CHANCE = 1.1, 4.0


@lru_cache(maxsize=64)
def polynomial_windows(steps: int, polynomials: int, shortest: float) -> tuple[NDArray[np.int64], Array]:
    """The steps (nwindow) at which windows end, and polynomials that are orthonormal on the readings of each (nwindow x
    nstep + 1 x ncoefficient).

    Args:
        steps: of the horizon.
        polynomials: how many of them.
        shortest: the first window, as a share of the horizon.
    """
    count = 1 + round(-STRIDE * np.log2(shortest))
    ends = np.array(window_ends(steps, count, shortest))
    ends = ends[ends >= min(polynomials, ends[-1])]
    basis = np.zeros((len(ends), ends[-1] + 1, min(polynomials, ends[0] + 1)))
    for window, end in enumerate(ends):
        times = np.linspace(-1.0, 1.0, end + 1)
        basis[window, : end + 1] = np.linalg.qr(legendre.legvander(times, basis.shape[2] - 1))[0]
    return ends, basis


def explained_by_noise(count: int) -> float:
    """The misfit of so many residuals that are nothing but noise is about 1, with a standard deviation of 1/√(2n)."""
    return ROUGH_NOISE + CHANCE / float(np.sqrt(2.0 * max(count, 1)))


def before(steps: NDArray[np.int64], readings: int) -> NDArray[np.bool_]:
    """Which readings belong to the first `steps` steps of each push (npush x nreading x 1): none of no steps."""
    return ((np.arange(readings)[None] <= steps[:, None]) & (steps[:, None] > 0))[..., None]


def eliminate(values: Array, slopes: Array, whitened: Array, count: int) -> tuple[Array, Array, Array]:
    """Residuals, their derivatives by the unknowns of all pushes, and the rows of `Residuals.following`, with what is
    unknown of the start of each push where it serves best.

    With r the residuals of a push, J and S their derivatives by those unknowns and by its whitened start speeds u, an
    orthogonal transformation turns the rows [S J r] and [1 0 u] so that S is triangular and zero below: there the rest
    is free of it, and above it says what u follows.  Eq. 34.

    Args:
        values: residuals (npush x nvalue).
        slopes: their derivatives (npush x nvalue x nunknown + nextra), those by what a push alone has last.
        whitened: that (npush x nextra), scaled by its spread.
        count: of the unknowns of all pushes.
    """
    npush, nvalue, width = slopes.shape
    speeds = width - count
    if speeds == 0:
        return values.ravel(), slopes.reshape(values.size, count), np.empty((0, 1 + count))
    rows = np.zeros((npush, nvalue + speeds, width + 1))
    rows[:, :nvalue, :speeds], rows[:, :nvalue, speeds:-1] = slopes[..., count:], slopes[..., :count]
    rows[:, nvalue:, :speeds] = np.eye(speeds)
    rows[:, :nvalue, -1], rows[:, nvalue:, -1] = values, whitened
    reduced: Array = np.asarray(np.linalg.qr(rows, mode="r"))
    above = np.linalg.solve(reduced[:, :speeds, :speeds], reduced[:, :speeds, speeds:])
    following = -np.concatenate([above[..., -1:], above[..., :-1]], axis=-1)
    below = reduced[:, speeds:, speeds:].reshape(-1, count + 1)
    return below[:, -1], below[:, :-1], following.reshape(-1, 1 + count)
