"""Faults that together explain what an estimate does not, taken up one after the other (Eq. 45).

A twin without them loses the plant, and where it is lost nothing can be told. So it is led by the readings, as if
torques had noise of unknown size: what the model has not shows as that noise. A fault is taken up where it makes
pushes that were left out more likely, by LEAST at least. In each round all are tried that are not taken up yet, and the
best stays; where one of them does not explain all, all at once are tried, for several may hide each other. At the end
each is tried without. What no plant has, friction that drives or a spring that pushes away, is not tried.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.estimate import Found
from metaid.estimation.faults import FoundFaults
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.tried import NOTHING, Combining, Tried, combining_of, farthest_moved
from metaid.estimation.noisy.unmodelled import FAULT_OF
from metaid.models import DEVIATIONS, Array

# What goes as one: the angle over which friction builds up is nothing without friction. An arm has that by itself.
SINGLE: tuple[tuple[str, ...], ...] = (
    ("delay",),
    ("lag",),
    ("tilt",),
    ("offset",),
    ("viscous",),
    ("dry", "presliding"),
    ("presliding",),
    ("spring",),
    ("bias",),
    ("rotor",),
    ("gain",),
    ("limit",),
)
SCANNED = (("limit",),)  # begins where it shows
LATE = (("cogging",),)  # how often it repeats is seen where little else is left
# What is tried as one, too: without the other each may stand for both.
TOGETHER = (("viscous", "dry", "presliding"), ("spring", "bias"))
LUMP_OF = {fault: lump for lump, fault in FAULT_OF.items()}  # what is searched already is not tried
TWOFOLD = {"offset": "tilt", "lag": "delay"}  # what is the other, but for little, which is simpler
OF_SEVERAL = {"offset", "rotor", "gain"}  # of one joint these are nothing, or a tilt
LEAST = 10.0  # in the logarithm of a likelihood
CLEARLY, PLAINLY = 3.0, 10.0  # standard deviations from none
ROUNDS = 8  # of taking up


def combine(readings: Readings, estimate: Found) -> tuple[Tried, list[Tried]] | None:
    """The fit with the faults that together make pushes most likely that were left out, among them those that are
    searched already, from the `estimate` of all `readings` on; and others that do as well in the place of the last.
    None where the twin cannot be led.
    """
    known = readings.faults.kinds
    combining = combining_of(readings)
    if combining is None:
        return None
    taken_up = () if estimate.faults is None else estimate.faults.searched.kinds
    tried = [_grown(combining, next(iter(_in_order(combining.beginnings(known))), None), readings)]
    if taken_up != known and not (tried[0] is not None and combining.explains(tried[0][0])):
        tried.append(_grown(combining, combining.fitted(taken_up, None, estimate.start), readings))
    grown = [each for each in tried if each is not None]
    if not grown:
        return None
    best, rivals = max(grown, key=lambda each: _worth(each[0]))
    fewest = _told_apart(combining, _fewest(combining, best, known), known)
    return fewest, [*_as_good(combining, best, rivals), *_off(combining, fewest, rivals, readings)]


def _off(combining: Combining, best: Tried, rivals: list[Tried], readings: Readings) -> Iterator[Tried]:
    """The `best` fit with offsets in place of a tilt that the study took up, if it does as well, and is none of the
    `rivals` yet. Of an arm's last encoder no motion shows the offset.
    """
    is_among = any("offset" in rival.kinds for rival in rivals)
    if "tilt" not in {*best.kinds} - {*readings.faults.kinds} or is_among or readings.unknowns.njoint < 2:
        return
    if readings.unknowns.hides_offset(best.found.unknowns) is not None:
        instead = combining.fitted(tuple("offset" if each == "tilt" else each for each in best.kinds), best)
        if instead is not None:
            yield from _as_good(combining, best, [instead])


def _as_good(combining: Combining, best: Tried, rivals: list[Tried]) -> Iterator[Tried]:
    """Those `rivals` of the `best` fit that do as well once they have settled, too, and explain as much."""
    is_explained = bool(rivals) and combining.explains(best)
    for rival in map(combining.settled, rivals):
        if _worth(rival) > _worth(best) - LEAST and not (is_explained and not combining.explains(rival)):
            yield rival


def _grown(combining: Combining, best: Tried | None, readings: Readings) -> tuple[Tried, list[Tried]] | None:
    """The `best` fit with more faults, one after the other, and others that do as well in the place of the last."""
    if best is None:
        return None
    rivals: list[Tried] = []
    for number in range(ROUNDS):
        if combining.explains(best):
            break
        every = combining.fitted(_with_every(best.kinds, readings), best) if number == 1 else None
        if every is not None and every.likelihood > best.likelihood + LEAST:
            late = [] if combining.explains(every) else combining.with_cogging(every)
            return _in_order([every, *late])[0], []
        tried = _in_order(combining.likely(best, list(_candidates(best.kinds, readings))))
        if not tried or not _worth(tried[0]) > _worth(best):
            tried = combining.with_cogging(best)
        if not tried or not _worth(tried[0]) > _worth(best):
            break
        rivals = [each for each in tried[1:] if _worth(each) > _worth(tried[0]) - LEAST]
        best = combining.settled(tried[0])
    return best, rivals


def _worth(tried: Tried) -> float:
    """The logarithm of the likelihood of the pushes that were left out, of which each fault has to earn LEAST."""
    free = {"presliding"} if "dry" in tried.kinds else set()
    return tried.likelihood - LEAST * len({*tried.kinds} - free)


def _in_order(tried: list[Tried]) -> list[Tried]:
    """The best first."""
    return sorted(tried, key=_worth, reverse=True)


def _fewest(combining: Combining, best: Tried, known: tuple[str, ...]) -> Tried:
    """The `best` fit without the faults that it does as well without, or with simpler ones; `known` ones stay. One that
    lumps hang on by more than both fits are sure of, as on a rotor, is left out only where nothing speaks for it.
    """
    for kind, simpler in TWOFOLD.items():
        if kind in best.kinds and kind not in known:
            instead = combining.fitted(tuple(simpler if each == kind else each for each in best.kinds), best)
            instead = None if instead is None else combining.settled(instead)
            is_as_good = instead is not None and instead.likelihood > best.likelihood - NOTHING
            if instead is not None and is_as_good and farthest_moved(best.found, instead.found) is None:
                best = instead
    idle = [
        kinds for kinds in (*SINGLE, *LATE) if {*kinds} <= {*best.kinds} - {*known} and not best.shows(kinds, CLEARLY)
    ]
    together = [tuple(kind for own in idle for kind in own)] if len(idle) > 1 else []
    for kinds in (*together, *SINGLE, *LATE):
        if not {*kinds} <= {*best.kinds} or {*kinds} & {*known} or best.shows(kinds, PLAINLY):
            continue
        without = combining.fitted(tuple(kind for kind in best.kinds if kind not in kinds), best)
        if without is None or without.likelihood <= best.likelihood - LEAST:
            continue
        hangs = farthest_moved(best.found, without.found) is not None
        if not hangs or without.likelihood > best.likelihood - NOTHING:
            best = without
    return best


def _told_apart(combining: Combining, best: Tried, known: tuple[str, ...]) -> Tried:
    """The `best` fit without springs in single joints that what it names hangs on, and that the pushes that were left
    out do not show by themselves: over a short way a spring is gravity but for little. Known ones stay.
    """
    free = combining.unbounded(best) if "spring" in {*best.kinds} - {*known} else None
    idle = None if free is None else _are_hung_on(best.found, *free) & best.faults.are("spring")
    if idle is None or not idle.any():
        return best
    other = combining.swapped.fitted_with(best.faults, best)
    again = None if other is None else combining.swapped.unbounded(other)
    if again is not None:
        idle &= ~(np.abs(again[0].values) > DEVIATIONS * again[0].deviations)
    without = combining.fitted_with(best.faults.without(idle), best) if idle.any() else None
    return best if without is None else without


def _are_hung_on(found: Found, faults: FoundFaults, covariance: Array) -> NDArray[np.bool_]:
    """Which of the unbounded `faults` (nfault) some of what was `found` hangs on, so that it is not determined beside
    what the fault may be, by the `covariance` of its unknowns and those of the faults.
    """
    count = len(found.unknowns)
    variances = np.diag(covariance)[count:]
    changes = found.to_numbers @ covariance[:count, count:] / variances  # with each fault's unknown
    reach = np.abs(faults.unknowns) + np.sqrt(variances)
    return np.asarray((np.abs(changes) * reach > found.coarsest[:, None]).any(axis=0))


def _with_every(kinds: tuple[str, ...], readings: Readings) -> tuple[str, ...]:
    """These `kinds` with all that may be taken up beside them, of two that are nearly the same the simpler one."""
    for single in SINGLE:
        if single in _candidates(kinds, readings) and single not in SCANNED and not {*single} & {*TWOFOLD}:
            kinds += single
    return kinds


def _candidates(kinds: tuple[str, ...], readings: Readings) -> Iterator[tuple[str, ...]]:
    """What may be taken up beside faults of these `kinds`."""
    searched, several = {*kinds, *readings.unknowns.kinds}, readings.unknowns.njoint > 1

    def is_open(kind: str) -> bool:
        twofold = any(kind in pair and {*pair} & searched for pair in TWOFOLD.items())
        return not searched & {kind, LUMP_OF.get(kind, kind)} and not twofold and (several or kind not in OF_SEVERAL)

    for more in (*SINGLE, *TOGETHER):
        if more == ("presliding",) and not readings.unknowns.builds_up:
            continue
        if all(is_open(kind) for kind in more):
            yield more
