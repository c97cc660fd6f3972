"""Faults that an estimate takes up by itself, where nothing explains what was seen without them.

A fault is taken up under all that is asked of an estimate: the fit with it explains everything to the noise, shows no
further force, predicts pushes that it was not fitted to, and has no rival. A rival is another fault that explains as
much and with which a lump would be elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from metaid.estimation.estimate import Found, fit
from metaid.estimation.faults import UNSEEN, TakenUp, named_faults
from metaid.estimation.noisy.polynomials import explained_by_noise
from metaid.estimation.noisy.proposed import TRIED, Search, explanations, fault_sizes
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.unmodelled import by_chance, unmodelled_forces
from metaid.estimation.trials import ReadTrial
from metaid.models import DEVIATIONS

SINGLE = tuple(kinds for kinds in TRIED if len(kinds) == 1)
SEVERAL = tuple(kinds for kinds in TRIED if len(kinds) > 1)
TRIFLE = 1e-3  # of a lump: a difference that does no harm


def take_up(readings: Readings, estimate: Found, search: Search) -> tuple[Found, TakenUp | None]:
    """The estimate of some `readings` with the faults that explain them, and what speaks for these; without any where
    none is needed, or none explains everything.  Eq. 65.

    Args:
        readings: of all trials, of which no fault is searched.
        estimate: of them, with faults or without.
        search: makes faults of given kinds unknown.
    """
    if estimate.faults is None and not estimate.is_explained:
        return estimate, None  # it was tried before: none explains the trials
    plain = estimate if estimate.faults is None else _without(readings, estimate)
    if plain is not None and _is_whole(readings, plain):
        return plain, None
    explained: list[Found] = []
    for tried in (SINGLE, SEVERAL):
        found = explanations(readings, estimate, search, tried)
        explained = explained or [each for each in found if _is_whole(_with_faults(readings, each), each)]
    if not explained:
        return plain or estimate, None
    best = _best(explained)
    assert best.faults is not None
    kinds = best.faults.searched.kinds
    is_known = estimate.faults is not None and estimate.faults.searched.kinds == kinds
    again = plain if is_known else _without(readings, best)
    if again is not None and _is_whole(readings, again):
        return again, None
    before = min((each.misfit for each in (plain, again) if each is not None), default=np.inf)
    rivals = (_rival(best, each) for each in explained if each is not best)
    predicted = _predicted(_with_faults(readings, best), best)
    sizes = fault_sizes(kinds, best.faults)
    return best, TakenUp(kinds, sizes, before, best.misfit, *predicted, tuple(each for each in rivals if each))


def _without(readings: Readings, estimate: Found) -> Found | None:
    """The estimate without faults, from the lumps of one with them; None where the twin cannot follow."""
    try:
        found: Found = fit(readings, estimate.unknowns, 0)
    except ValueError:
        return None
    return found


def _with_faults(readings: Readings, estimate: Found) -> Readings:
    """The same `readings`, of which the faults of an `estimate` are searched."""
    assert estimate.faults is not None
    return replace(readings, faults=estimate.faults.searched)


def _is_whole(readings: Readings, estimate: Found) -> bool:
    """Whether an estimate explains what was seen, and no further force is seen."""
    return estimate.is_explained and not any(force.is_seen for force in unmodelled_forces(readings, estimate))


def _best(explained: Sequence[Found]) -> Found:
    """The one with the least cost, or a special case of its fault that explains as much with the same lumps, for that
    has fewer unknowns.
    """
    best = min(explained, key=lambda each: each.cost)
    special = (each for each in explained if _is_special(each, best) and _explains_as_much(each, best))
    return next((each for each in special if _moved(each, best) is None), best)


def _is_special(one: Found, other: Found) -> bool:
    """Whether what `one` has taken up is a special case of what the `other` has: a tilt is an offset of the first
    encoder, where all others read right.
    """
    return "tilt" in _kinds(one) and "offset" in _kinds(other)


def _explains_as_much(one: Found, other: Found) -> bool:
    """Whether noise may be all that makes the cost of `one` larger than that of the `other`."""
    assert one.faults is not None
    assert other.faults is not None
    fewer = abs(len(one.faults.values) - len(other.faults.values)) + 1
    return 2.0 * (one.cost - other.cost) <= by_chance(fewer)


def _moved(best: Found, other: Found) -> int | None:
    """The lump that an `other` explanation has farthest out of the interval of the `best`; None where all are inside.

    One of which the best is a special case knows lumps less well. By so much they may differ by chance.
    """
    change = np.abs(other.unknowns - best.unknowns)
    beyond = change / (DEVIATIONS * best.deviations + TRIFLE)
    if _is_special(best, other):
        less = np.sqrt(np.maximum(other.deviations**2 - best.deviations**2, 0.0))
        beyond[change <= UNSEEN * less] = 0.0
    moved = int(np.argmax(beyond))
    return moved if beyond[moved] > 1.0 else None


def _kinds(estimate: Found) -> tuple[str, ...]:
    """The kinds of faults of an `estimate` that has some."""
    assert estimate.faults is not None
    return estimate.faults.searched.kinds


def _rival(best: Found, other: Found) -> str:
    """What speaks for an `other` explanation than the `best`, in words; nothing where the readings refute it, it has
    the same lumps, or it is a special case: where that is right, so is the best.
    """
    moved = _moved(best, other)
    if moved is None or _is_special(other, best) or not _explains_as_much(other, best):
        return ""
    assert other.faults is not None
    by = 100.0 * float(np.expm1(other.unknowns[moved] - best.unknowns[moved]))
    named = named_faults(_kinds(other), fault_sizes(_kinds(other), other.faults))
    return f"{named}, with which {best.names[moved]} would be {abs(by):.2g} % {'larger' if by > 0.0 else 'smaller'}"


def _predicted(readings: Readings, estimate: Found) -> tuple[float, float]:
    """The misfit of pushes that are held out, by what the others say of the same unknowns and how surely, and how much
    of it noise explains.

    The squares of all pushes less those of the others alone are the squared prediction errors of the pushes held out,
    in units of what noise and the covariance of that fit make of them.
    """
    kept = replace(readings, trials=_all_but_last(readings.trials))
    try:
        found = fit(kept, estimate.start, 0, gives_up=True)
    except ValueError:
        return np.inf, explained_by_noise(0)
    whole, part = (each.residuals(at.point, each.stages) for each, at in ((readings, estimate), (kept, found)))
    if whole is None or part is None:
        return np.inf, explained_by_noise(0)
    count = max(whole.count - part.count, 1)
    return float(np.sqrt(max(2.0 * (estimate.cost - found.cost), 0.0) / count)), explained_by_noise(count)


def _all_but_last(trials: Sequence[ReadTrial]) -> list[ReadTrial]:
    """The trials but the last that shows anything, or, of one trial alone, every second push."""
    shown = [trial for trial in trials if trial.steps.any()]
    return shown[:-1] if len(shown) > 1 else [_every_second(trial) for trial in shown]


def _every_second(trial: ReadTrial) -> ReadTrial:
    """The same with every second push."""
    spread = None if trial.start_spread is None else trial.start_spread[::2]
    return replace(
        trial,
        readings=trial.readings[::2],
        torques=trial.torques[::2],
        steps=trial.steps[::2],
        start_speeds=trial.start_speeds[::2],
        start_spread=spread,
    )
