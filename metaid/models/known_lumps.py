"""What is known of gravity and inertia lumps and of lengths, whether these are given or were found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.models.lumps import Array

PARAMETER_UNITS = {"mass": "kg", "com": "m", "inertia": "kg m²", "length": "m"}


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
    """What an estimate knows of the links.

    Args:
        names: of the parameters (nparameter), all gravity and inertia lumps among them; without a `length` also those
            of the links but the last.
        values: of the parameters (nparameter), in SI units.
        covariance: of their relative errors (nparameter x nparameter).
        reach: how many standard deviations any of them may be off.
        length: of the links (nlink), in m; None where they are among the parameters.
    """
    kinds = ("gravity", "inertia") if length is not None else ("gravity", "inertia", "length")
    n = sum(name.startswith("gravity_") for name in names)
    used = [i for kind in kinds for i, name in enumerate(names) if name.startswith(f"{kind}_")]
    own = covariance[np.ix_(used, used)]
    deviations = np.sqrt(np.diag(own))
    root = deviations[:, None] * np.linalg.cholesky(own / np.outer(deviations, deviations))
    lengths = np.append(values[used[2 * n :]], np.nan) if length is None else length
    return KnownLumps(values[used[:n]], values[used[n : 2 * n]], lengths, reach * root)
