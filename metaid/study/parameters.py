"""What a study is to find, and what is known of it: lumps of a planar chain, base parameters of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array, Chain, lump_names, lump_unit
from metaid.models.tree import ArmPrior, BaseParameters

ROUNDING = 1e-12  # of the largest base parameter of a unit


@dataclass(frozen=True, eq=False)
class Parameters:
    """What is to be found, in SI units. Candidates of a study are numbers of its own: factors of lumps, or base
    parameters themselves.

    Attributes:
        noun: what one of them is called.
        names: of them (n).
        units: of them (n).
        nominal: their values by the nominal model (n).
        scale: what a candidate's numbers are multiplied by (n), to be values.
        origin: the candidate's numbers that figures show as 0 (n).
        step: those that they show as 1 more (n).
        axis: what figures call these.
        deviations: standard deviations beforehand (n); None where nothing is said of that.
        expressions: what each is made of (n); None where the name says it.
    """

    noun: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    nominal: Array
    scale: Array
    origin: Array
    step: Array
    axis: str
    deviations: Array | None = None
    expressions: tuple[str, ...] | None = None

    def label(self, name: str) -> str:
        """What figures call the number of one of them."""
        return f"factor of {name}" if self.deviations is None else f"{name}, {self.axis}"

    def sizes(self, values: Array) -> Array:
        """What changes of `values` (n) are large or small beside."""
        return np.abs(values) if self.deviations is None else np.maximum(np.abs(values), self.deviations)


def lumps_of(nominal: Chain, kinds: Sequence[str]) -> Parameters:
    """The lumps of these `kinds` of a chain."""
    names = tuple(lump_names(nominal.nlink, kinds))
    values = nominal.lumps_of(tuple(kinds)).vector_of(kinds)
    plain = np.zeros(len(names)), np.ones(len(names))
    return Parameters("lump", names, tuple(map(lump_unit, names)), values, values, *plain, "factor of nominal")


def base_parameters_of(prior: ArmPrior) -> Parameters:
    """The base parameters of an arm."""
    base, deviations = prior.base, np.sqrt(np.diag(prior.covariance))
    ones, values = np.ones(len(deviations)), settled(prior.base, prior.values)
    axis, shown = "deviations from nominal", (prior.values, deviations)
    return Parameters(
        "base parameter", base.names, base.units, values, ones, *shown, axis, deviations, base.expressions
    )


def settled(base: BaseParameters, values: Array) -> Array:
    """Base parameters (nbase) without what rounding left of those that are 0: of the turn of a frame, say."""
    units = np.array(base.units)
    largest = np.array([np.abs(values[units == unit]).max() for unit in base.units])
    return np.where(np.abs(values) <= ROUNDING * largest, 0.0, values)


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of parameters, in SI units; NaN where nothing is.

    Attributes:
        values: of them (n).
        deviations: standard deviations (n).
        low: the lower end of what each may be (n).
        high: the upper end (n).
        determined: which of them are (n).
        systematic: standard deviations that what the model may lack would add (n); None where that was not asked.
    """

    values: Array
    deviations: Array
    low: Array
    high: Array
    determined: NDArray[np.bool_]
    systematic: Array | None = None

    @classmethod
    def alone(cls, values: Array) -> Known:
        """`values` (n) without intervals."""
        nothing = np.full(len(values), np.nan)
        return cls(values, nothing, nothing, nothing, np.zeros(len(values), dtype=np.bool_))

    def only(self, seen: NDArray[np.bool_]) -> Known:
        """The same of what is `seen` (n), and no numbers of the others."""
        parts = {key: np.where(seen, getattr(self, key), np.nan) for key in ("values", "deviations", "low", "high")}
        return replace(self, **parts)
