"""What a search looks through: the parameters of a model as a function of what candidates differ in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from metaid.models.lumps import Array, Lumps


class SearchSpace(Protocol):
    """Values z, stored under `names` (nsearched), searched between `low` and `high` (nsearched) from `start`
    (nsearched), and the parameters of the model that they mean.
    """

    @property
    def names(self) -> list[str]: ...
    @property
    def start(self) -> Array: ...
    @property
    def low(self) -> Array: ...
    @property
    def high(self) -> Array: ...

    def parameters(self, values: Array) -> Array:
        """The model's parameters (... x nparameter) at `values` (... x nsearched)."""


@dataclass(frozen=True)
class Space:
    """θ = θ₀ + S z: parameters θ on a line, a plane and so on through θ₀, `origin` (nparameter), along the columns of
    S, `directions` (nparameter x nsearched). A diagonal S is given by its diagonal (nparameter).

    Parameters may be zero or negative. Factors of nominal lumps are the case θ₀ = 0 and S = diag(nominal).
    """

    names: list[str]
    origin: Array
    directions: Array
    start: Array
    low: Array
    high: Array

    def parameters(self, values: Array) -> Array:
        """The model's parameters (... x nparameter) at `values` z (... x nsearched)."""
        moved = values * self.directions if self.directions.ndim == 1 else values @ self.directions.T
        parameters: Array = self.origin + moved
        return parameters


def factor_space(
    nominal: Lumps, start: float | Array = 1.0, low: float | Array = 0.0, high: float | Array = np.inf
) -> Space:
    """The space of factors of the searched `nominal` lumps.

    Args:
        nominal: the lumps that candidates are factors of.
        start: where a search begins, one number for all or (nsearched).
        low: the lower bound of the factors, one number for all or (nsearched).
        high: the upper bound, likewise.
    """
    bounds = (
        np.broadcast_to(np.asarray(bound, dtype=np.float64), nominal.vector.shape) for bound in (start, low, high)
    )
    return Space(nominal.names, np.zeros(nominal.vector.shape), nominal.vector, *bounds)
