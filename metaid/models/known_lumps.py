"""What is known of gravity and inertia lumps and of lengths, whether these are given or follow from Coriolis lumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.models.lumps import Array

PARAMETER_UNITS = {"mass": "kg", "com": "m", "inertia": "kg m²", "length": "m"}
SINGULAR = 1e-14  # of the largest variance in a correlation matrix: what is below it is rounding


@dataclass(frozen=True)
class KnownLumps:
    """What is known of the links of a chain, and how well.

    Attributes:
        gravity: μ (nlink), in kg m.
        inertia: d (nlink), in kg m².
        length: l (nlink), in m; the last is NaN where lengths are not given beforehand, for no lump has it.
        root: changes of log (μ, d), or, where lengths are not given, of log (μ, d, l_1 … l_{n−1}), are this matrix
            (nlog x nlog) times a vector (nlog) that is not longer than 1.
    """

    gravity: Array
    inertia: Array
    length: Array
    root: Array

    @property
    def nlink(self) -> int:
        return len(self.gravity)

    @property
    def units(self) -> list[str]:
        """Of each parameter."""
        return [PARAMETER_UNITS[name.split("_")[0]] for name in self.names]

    @property
    def names(self) -> list[str]:
        """Of the parameters: `mass_1` …, `com_1` …, `inertia_1` …, and `length_1` … where lengths are not given."""
        kinds = list(PARAMETER_UNITS)[: 4 if np.isnan(self.length[-1]) else 3]
        return [f"{kind}_{i}" for kind in kinds for i in range(1, self.nlink + 1)]


def known_lumps(
    names: Sequence[str], values: Array, covariance: Array, reach: float, length: Array | None
) -> KnownLumps:
    """What an estimate of lumps knows of the links.

    Args:
        names: of the lumps (nlump), all gravity and inertia lumps among them; without a `length` also all Coriolis
            lumps.
        values: of the lumps (nlump), in SI units.
        covariance: of their relative errors (nlump x nlump).
        reach: how many standard deviations any of them may be off.
        length: of the links (nlink), in m; None where they follow from the lumps, l_i = a_ij / μ_j.
    """
    place = {name: i for i, name in enumerate(names)}
    n = sum(name.startswith("gravity_") for name in names)
    links = range(1, n + 1)
    used = [place[f"{kind}_{i}"] for kind in ("gravity", "inertia") for i in links]
    rows = list(np.eye(2 * n, 2 * n if length is not None else 3 * n - 1))
    logs = np.log(values)
    known = logs[used]
    if length is None:
        pairs = [(i, j) for i in links for j in links if i < j]
        used += [place[f"coriolis_{i}_{j}"] for i, j in pairs]
        each = np.eye(3 * n - 1)
        rows += [each[2 * n + i - 1] + each[j - 1] for i, j in pairs]  # log a_ij = log l_i + log μ_j
        ratio = {(i, j): logs[place[f"coriolis_{i}_{j}"]] - known[j - 1] for i, j in pairs}
        known = np.append(known, [np.mean([ratio[i, j] for j in links if i < j]) for i in links[:-1]])
    # Generalised least squares: with three links and more, not all Coriolis lumps are those of some lengths.
    system = np.array(rows)
    whiten = whitening(covariance[np.ix_(used, used)])
    q, r = np.linalg.qr(whiten @ system)
    known = known + np.linalg.solve(r, q.T @ whiten @ (logs[used] - system @ known))
    found = np.exp(known)
    lengths = np.append(found[2 * n :], np.nan) if length is None else length
    return KnownLumps(found[:n], found[n : 2 * n], lengths, reach * np.linalg.inv(r))


def whitening(covariance: Array) -> Array:
    """The matrix (n x n) that makes errors with this `covariance` (n x n) independent and of size 1."""
    deviations = np.sqrt(np.diag(covariance))
    own, axes = np.linalg.eigh(covariance / np.outer(deviations, deviations))
    return np.asarray((axes / np.sqrt(np.maximum(own, SINGULAR * own[-1]))).T / deviations, dtype=np.float64)
