"""A fit with some faults, whose twin is led by the readings, and what it says of pushes that were left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.descent import covariance_at, place_at, triangle
from metaid.estimation.estimate import Found
from metaid.estimation.faults import FoundFaults, SearchedFaults, found_faults, searched_faults
from metaid.estimation.noisy.held_out import only_pushes
from metaid.estimation.noisy.innovations import Innovations, led_by
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.scanned import limits_shown, teeth_shown
from metaid.estimation.noisy.torque_noise import PUSHES, fit_with_torque_noise, likeliest_noise
from metaid.models import DEVIATIONS, Array, kind_of
from metaid.plant import FAULT_UNITS

NONE = {"gain": 1.0, "limit": np.inf}  # what is none of a fault, where that is not 0
LOOKED_AT = 3  # faults that are fitted wholly, of those that may be taken up
TRIFLE = 1e-3  # of an unknown: a difference that does no harm
NEGLIGIBLE, NOTHING = 1e-3, 3.0  # of the noise that was found, and in the logarithm of the likelihood: none is needed
ROUNDS_EACH = 3  # of gains and unknowns in turn
ENOUGH = 0.2  # of cost: a step of a fit that is tried and promises less moves no likelihood by as much as a fault earns
OUT, OF = 1, 3  # of so many pushes that one is left out
DENSEST = 2e-3  # s between readings: closer ones say little more of what is missing
MOST_WORK = 1_500_000  # readings of joints, times unknowns, that a fit with faults is tried on


@dataclass(frozen=True)
class Tried:
    """A fit with faults, whose twin is led: what it `found`, and the logarithm of the likelihood of the pushes that
    were left out.
    """

    found: Found
    faults: SearchedFaults
    likelihood: float

    @property
    def kinds(self) -> tuple[str, ...]:
        return self.faults.kinds

    def shows(self, kinds: tuple[str, ...], far: float) -> bool:
        """Whether a fault of one of these `kinds` is so many standard deviations from none."""
        found = self.found.faults
        if found is None:
            return False
        none = np.array([NONE.get(kind_of(name), 0.0) for name in found.searched.names])
        own = found.searched.are(*kinds) & ~found.searched.are("presliding")
        return bool((np.abs(found.values - none) > far * found.deviations)[own].any())


@dataclass(frozen=True)
class Combining:
    """The pushes that are fitted, `kept`, and those that are `left` out."""

    kept: Innovations
    left: Innovations

    def fitted(self, kinds: tuple[str, ...], before: Tried | None, start: Array | None = None) -> Tried | None:
        """The fit with faults of these `kinds`, from where the one `before` ended, or from a `start` (nunknown), None
        for the nominal model; None where the twin cannot follow.
        """
        return self.fitted_with(self._bounded(kinds, before), before, start)

    def fitted_with(self, faults: SearchedFaults, before: Tried | None, start: Array | None = None) -> Tried | None:
        """The same with these `faults`."""
        noise = self.kept.some_torque
        if before is not None:
            assert before.found.torque_noise is not None
            start, noise = begin_with(before.found, faults), before.found.torque_noise
        kept, left = replace(self.kept, faults=faults), replace(self.left, faults=faults)
        found = fit_with_torque_noise(kept, start, noise, ROUNDS_EACH, begins_anew=True)
        if found is None:
            return None
        assert found.torque_noise is not None
        point = np.append(found.start, np.zeros(left.extras))
        sizes = likeliest_noise(left, point, found.torque_noise, PUSHES)  # what is unexplained of them, too
        likelihood = left.likelihood(point, sizes, PUSHES)
        return Tried(found, faults, likelihood) if np.isfinite(likelihood) else None

    def beginnings(self, kinds: tuple[str, ...]) -> list[Tried]:
        """The fits with faults of these `kinds` from the nominal model, where the twin can follow: without and with
        limits of the motors, where these show there. Without them the first may lose the plant for good.
        """
        kept = replace(self.kept, faults=self._bounded(kinds, None))
        nominal = np.zeros(len(kept.spreads) + kept.extras)
        led = None if "limit" in kinds else kept.led(nominal, kept.some_torque)
        limits = None if led is None else limits_shown(led, nominal)
        tried = [self.fitted(kinds, None)]
        if limits is not None:
            tried.append(self.fitted_with(self._bounded((*kinds, "limit"), None, limits=limits), None))
        return [each for each in tried if each is not None]

    def settled(self, tried: Tried) -> Tried:
        """The same fit, gone on with until pushes that were left out become no more likely: gains and unknowns are
        found in turn, and what is left to gain is not to be another fault's.
        """
        for _ in range(ROUNDS_EACH):
            again = self.fitted(tried.kinds, tried)
            if again is None or again.likelihood < tried.likelihood + NOTHING:
                break
            tried = again
        return tried

    def _bounded(
        self, kinds: tuple[str, ...], before: Tried | None, teeth: int = 0, limits: Array | None = None
    ) -> SearchedFaults:
        """Faults of these `kinds` that cannot be found below 0: how many `teeth` cogging has, and what limits of the
        motors are about (njoint), in N m, is by a scan; by default as in the fit `before`.
        """
        kept, in_order = self.kept, tuple(kind for kind in FAULT_UNITS if kind in kinds)
        teeth = kept.faults.teeth or teeth or (0 if before is None else before.faults.teeth)
        faults = searched_faults(in_order, kept.unknowns, kept.trials[0].start_speeds, teeth)
        if limits is None:
            limits = before.faults.limits if before is not None and "limit" in before.kinds else faults.limits
        return replace(faults, is_bounded=True, limits=limits)

    def with_cogging(self, before: Tried) -> list[Tried]:
        """The fit with cogging besides, if there is one."""
        kept = None if "cogging" in before.kinds else self._led(before)
        teeth = 0 if kept is None else self.kept.faults.teeth or teeth_shown(kept, before.found.point)
        faults = self._bounded((*before.kinds, "cogging"), before, teeth)
        tried = self.fitted_with(faults, before) if teeth else None
        return [] if tried is None else [tried]

    def unbounded(self, tried: Tried) -> tuple[FoundFaults, Array] | None:
        """The faults of a fit and the covariance of its unknowns, those of faults behind (nunknown x nunknown), where
        none is bounded: at a bound one seems certain, and what hangs on it, too. None without faults.
        """
        found, kept = tried.found, self._led(tried)
        if found.faults is None or kept is None:
            return None
        searched, unknowns = found.faults.searched.unbounded(found.faults.unknowns)
        kept = replace(kept, faults=searched)
        place = place_at(kept, np.concatenate([found.unknowns, unknowns, found.extras]), kept.stages)
        if place is None:
            return None
        covariance = covariance_at(place, kept.spreads)
        faults = found_faults(searched, place.point, covariance)
        return None if faults is None else (faults, covariance)

    @property
    def swapped(self) -> Combining:
        """The pushes that are left out in place of those that are fitted, and the other way round."""
        return replace(self, kept=self.left, left=self.kept)

    def _led(self, before: Tried) -> Innovations | None:
        """The pushes that are fitted, with the gains where the fit `before` ended."""
        assert before.found.torque_noise is not None
        return replace(self.kept, faults=before.faults).led(before.found.point, before.found.torque_noise)

    def explains(self, tried: Tried) -> bool:
        """Whether no noise of torques is needed to explain the pushes that were fitted."""
        noise, kept = tried.found.torque_noise, replace(self.kept, faults=tried.faults)
        assert noise is not None
        likely, without = (kept.likelihood(tried.found.point, size * noise, PUSHES) for size in (1.0, NEGLIGIBLE))
        return without > likely - NOTHING

    def likely(self, before: Tried, candidates: list[tuple[str, ...]]) -> list[Tried]:
        """The fits with the faults of LOOKED_AT of the `candidates` besides: of those that a single step from the fit
        `before` promises to leave least of the pushes.
        """
        kept = self._led(before)
        if kept is None:
            return []
        limits = limits_shown(kept, before.found.point) if ("limit",) in candidates else None
        candidates = [kinds for kinds in candidates if kinds != ("limit",) or limits is not None]
        each = [self._bounded((*before.kinds, *kinds), before, limits=limits) for kinds in candidates]
        left = [self._left_by(before, kept, faults) for faults in each]
        likely = [each[number] for number in np.argsort(left)[:LOOKED_AT] if np.isfinite(left[number])]
        tried = (self.fitted_with(faults, before) for faults in likely)
        return [found for found in tried if found is not None]

    def _left_by(self, before: Tried, kept: Innovations, faults: SearchedFaults) -> float:
        """The cost that one Gauss-Newton step from the fit `before` leaves with `faults`, each unknown for one."""
        faulty = replace(kept, faults=faults)
        point = np.concatenate([begin_with(before.found, faults), before.found.extras])
        place = place_at(faulty, point, faulty.stages)
        if place is None:
            return np.inf
        _, target = triangle(place, faulty.spreads)
        return place.cost - 0.5 * float(target @ target) + len(faults.names)


def combining_of(readings: Readings) -> Combining | None:
    """The pushes in two parts, of a real plant with readings no closer than DENSEST; None where there are too few."""
    trials = [
        trial.thinned(max(int(DENSEST / trial.period), 1)) if trial.is_continuous else trial
        for trial in readings.trials
    ]
    try:
        led = replace(led_by(replace(readings, trials=trials)), least_gain=ENOUGH)
        is_tried, is_out = parts_of(led)
        return Combining(only_pushes(led, is_tried & ~is_out), only_pushes(led, is_tried & is_out))
    except ValueError:
        return None


def farthest_moved(one: Found, other: Found) -> int | None:
    """The number of the unknown that an `other` estimate has farthest from `one`; None where all are the same but for
    what the deviations of both say.
    """
    reach = DEVIATIONS * np.hypot(one.deviations, other.deviations)[: len(one.unknowns)] + TRIFLE
    beyond = np.abs(other.unknowns - one.unknowns) / reach
    return int(np.argmax(beyond)) if beyond.max() > 1.0 else None


def parts_of(readings: Readings) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which pushes of each trial (ntrial x npush) are tried, all of them unless that takes long, and which are left
    out: others in each, so that none is without its like.
    """
    pushes, trials = np.arange(max(len(trial.steps) for trial in readings.trials)), np.arange(len(readings.trials))
    work = sum(int(trial.steps.sum()) for trial in readings.trials) * readings.unknowns.njoint * len(readings.spreads)
    stride = -(-work // MOST_WORK)
    is_tried = (pushes + trials[:, None]) % stride == 0
    return is_tried, np.asarray((pushes // stride + trials[:, None]) % OF == OUT)


def begin_with(found: Found, faults: SearchedFaults) -> Array:
    """The unknowns (nunknown) of what was `found`, with the `faults` that it has, and none of the others."""
    own = found.faults
    known = {} if own is None else dict(zip(own.searched.names, own.unknowns.tolist(), strict=True))
    return np.append(found.unknowns, [known.get(name, 0.0) for name in faults.names])
