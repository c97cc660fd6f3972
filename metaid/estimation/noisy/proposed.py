"""Faults that would explain what an estimate does not: each is tried as an unknown beside the lumps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from metaid.estimation.estimate import Estimate, fit
from metaid.estimation.faults import FoundFaults, Proposal, SearchedFaults
from metaid.estimation.noisy.readings import Readings
from metaid.models import Array
from metaid.plant import FAULT_UNITS

Search = Callable[[tuple[str, ...]], SearchedFaults]  # makes faults of given kinds unknown

# The next only where those before explain nothing.
TRIED = (("delay",), ("tilt",), ("viscous",), ("spring",), ("offset",), ("delay", "tilt"))
LUMP_OF = {"viscous": "damping"}  # friction that is searched as a lump is not tried
IN_THOUSANDTHS = {"s": "ms", "rad": "mrad"}


def proposed_faults(readings: Readings, estimate: Estimate, search: Search, declared: float) -> Proposal | None:
    """The faults that explain what an `estimate` of some `readings` does not; None where none of those tried does.

    Args:
        readings: of all trials.
        estimate: of them.
        search: makes faults of given kinds unknown.
        declared: the delay in s that the torques of the trials have already.
    """
    found = next(explanations(readings, estimate, search), None)
    if found is None or found.faults is None:
        return None
    wanted = found.faults.searched.kinds
    kinds = tuple(kind for kind in wanted if kind not in readings.faults.kinds)
    return Proposal(kinds, fault_sizes(kinds, found.faults, declared), estimate.misfit, found.misfit, wanted)


def explanations(
    readings: Readings, estimate: Estimate, search: Search, tried: Sequence[tuple[str, ...]] = TRIED
) -> Iterator[Estimate]:
    """The estimates, with faults as unknowns, that explain what an estimate does not, one by one as they are asked for;
    none with friction that would drive, or a spring that would push away.

    Args:
        readings: of all trials.
        estimate: of them.
        search: makes faults of given kinds unknown.
        tried: the kinds of faults that are unknown together, in turn.
    """
    known = readings.faults.kinds
    for kinds in tried:
        searched = {*known, *readings.unknowns.kinds}
        if searched & {*kinds, *(LUMP_OF.get(kind, kind) for kind in kinds)} or _is_twofold((*known, *kinds)):
            continue
        if "offset" in kinds and readings.unknowns.nominal.nlink == 1:
            continue  # of one link it is a tilt
        wanted = search(tuple(kind for kind in FAULT_UNITS if kind in (*known, *kinds)))
        try:
            found = _explained(replace(readings, faults=wanted), _begin(estimate, wanted))
        except ValueError:
            continue
        if found.is_explained and found.faults is not None and not found.faults.impossible:
            yield found


def _is_twofold(kinds: Sequence[str]) -> bool:
    """Whether faults of these `kinds` have a tilt twice: an offset of the first encoder moves the plant like one."""
    return {"tilt", "offset"} <= set(kinds)


def _explained(readings: Readings, start: Array) -> Estimate:
    """The fit to `readings` from a `start` (nunknown), first to the trial alone that shows most: what does not explain
    that one explains all of them no more, which is known sooner.  Raises ValueError where nothing is explained.
    """
    if len(readings.trials) > 1:
        most = max(readings.trials, key=lambda trial: int(trial.steps.sum()))
        alone = fit(replace(readings, trials=[most]), start, 0, gives_up=True)
        if not alone.is_explained:
            raise ValueError("a trial is not explained")
        start = alone.start
    return fit(readings, start, 0, gives_up=True)


def fault_sizes(kinds: Sequence[str], found: FoundFaults, declared: float = 0.0) -> tuple[str, ...]:
    """The largest fault of each of these `kinds` among those `found`, in words, with the delay in s that was `declared`
    besides.
    """
    return tuple(_size(kind, found, declared if kind == "delay" else 0.0) for kind in kinds)


def _begin(estimate: Estimate, searched: SearchedFaults) -> Array:
    """The unknowns (nunknown) of an `estimate`, with none of the faults that it has not `searched`."""
    own = estimate.faults
    found = {} if own is None else dict(zip(own.searched.names, own.unknowns.tolist(), strict=True))
    faults = [found.get(name, 0.0) for name in searched.names]
    return np.asarray(np.append(estimate.log_factors, faults), dtype=np.float64)


def _size(kind: str, found: FoundFaults, declared: float) -> str:
    """The largest fault of a `kind` among those `found`, in words, with what of it is `declared`, in its unit."""
    own = [value for name, value in zip(found.searched.names, found.values.tolist(), strict=True) if kind in name]
    value, unit = max(own, key=abs) + declared, FAULT_UNITS[kind]
    return f"{1e3 * value:.2g} {IN_THOUSANDTHS[unit]}" if unit in IN_THOUSANDTHS else f"{value:.2g} {unit}"
