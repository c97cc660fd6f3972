"""How far intervals reach to either side of what was found, by a normal distribution: of one value, and of several that
are to be inside at once.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from metaid.models.lumps import Array

LEVEL = 0.95
COARSEST = 0.1  # what is not known better than to a tenth is not determined
DEVIATIONS = 1.96  # standard deviations, which hold one value with LEVEL


def deviations_at_once(count: int) -> float:
    """How many standard deviations every one of `count` intervals reaches, so that all their values are inside at once
    with at least LEVEL, however these are correlated.

    Eq. 32; Z. Šidák, Rectangular confidence regions for the means of multivariate normal distributions, Journal of the
    American Statistical Association 62, 1967.
    """
    return NormalDist().inv_cdf(0.5 * (1.0 + LEVEL ** (1.0 / count)))


def jackknife(fits: Array) -> Array:
    """Standard deviations (...) of what fits without a part each (npart x ...) say."""
    count = len(fits)
    scatter = ((fits - fits.mean(axis=0)) ** 2).sum(axis=0)
    return np.asarray(np.sqrt((count - 1) / count * scatter), dtype=np.float64)


def half_width(deviations: Array) -> float:
    """Half the widest of intervals that hold all values at once, ÷ its value, where these are the standard `deviations`
    (nvalue) of the values' logs.  Eq. 32.
    """
    return float(np.sinh(deviations_at_once(len(deviations)) * deviations.max()))
