"""Faults of the plant as unknowns of the fit, beside the lumps.

The twin has the loop as it is: a torque is cut off, comes late and is multiplied by the gain of its motor, links lean
where the base is tilted or an encoder is offset, and joints have friction and springs (Eqs. 40 and 43). Each fault is
scaled by its prior deviation, so that all unknowns have steps of one size.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import PRESLIDING, Further, Joints, ReadTrial
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array, kind_of
from metaid.plant import fault_names

TURN = 0.05  # rad that the fastest joint turns by within a delay of one standard deviation
LEAN = 0.1  # rad: standard deviation of a tilt and of an offset
OF_TORQUE = {"dry": 0.1, "spring": 0.3, "bias": 0.1, "cogging": 0.05}  # likewise, as shares of the plant's torque
OF_DRAG = 0.1  # likewise, of the torque of viscous friction at the largest speed
CHANGES_TORQUE = ("delay", "lag", "gain", "bias", "limit")
OF_INERTIA = 0.1  # likewise, of a rotor, as a share of the plant's largest inertia
# Of what is above 0: what it is about, in its unit, and the standard deviation of its logarithm.
ABOVE_ZERO = {"gain": (1.0, 0.3), "lag": (2e-3, 1.0), "presliding": (PRESLIDING, 1.0)}
OF_LIMIT = 0.3  # the standard deviation of the logarithm of a limit
LIMIT = 0.5  # of the torque that a joint needs: what a limit is about that nobody has seen
NEVER_NEGATIVE = ("viscous", "dry", "spring", "rotor")  # friction resists, and a spring holds what is at rest
BEND = 1e-3  # of what may be: so close to 0 is a fault that cannot be below it
BELOW, TRIFLE = 3.0, 1e-3  # standard deviations, and a share of what may be: a fault farther below 0 is none
STEP = 1e-6  # in an unknown, for what the torques and a fault change by with it
DETERMINED = 0.3  # of the prior deviation of a fault: a deviation below this tells something of it


@dataclass(frozen=True)
class SearchedFaults:
    """Faults of some `kinds` of a plant with `njoint` joints, see `metaid.plant.unknown_faults`. `scales` (nfault): the
    standard deviation of each beforehand, in its unit; of what is ABOVE_ZERO, of its logarithm; 0 of those left out.
    `tilts`: about how many axes the base may be tilted. `is_bounded`: whether what is NEVER_NEGATIVE cannot be found
    below 0. `teeth`: how many times a turn cogging repeats. `limits`: what the limit of each motor is about (njoint),
    in N m; of none without.
    """

    kinds: tuple[str, ...]
    njoint: int
    scales: Array
    tilts: int = 1
    is_bounded: bool = False
    teeth: int = 0
    limits: Array = field(default_factory=lambda: np.empty(0))

    @cached_property
    def names(self) -> list[str]:
        """Of the faults (nfault)."""
        return fault_names(self.kinds, self.njoint, self.tilts)

    @cached_property
    def about(self) -> Array:
        """What each fault that is ABOVE_ZERO is about (nfault), and searched by its logarithm; 0 for the others."""
        about = np.array([ABOVE_ZERO.get(kind_of(name), (0.0, 0.0))[0] for name in self.names])
        if "limit" in self.kinds:
            about[self._places["limit"]] = self.limits
        return about

    @property
    def is_left_out(self) -> NDArray[np.bool_]:
        """Which faults (nfault) are taken for none."""
        return np.asarray(self.scales == 0.0)

    def are(self, *kinds: str) -> NDArray[np.bool_]:
        """Which faults (nfault) are of some `kinds`."""
        return np.array([kind_of(name) in kinds for name in self.names], dtype=np.bool_)

    def without(self, left_out: NDArray[np.bool_]) -> SearchedFaults:
        """The same, some of which (nfault) are left out."""
        return replace(self, scales=np.where(left_out, 0.0, self.scales))

    def unbounded(self, unknowns: Array) -> tuple[SearchedFaults, Array]:
        """The same of which none is bounded, and what the `unknowns` (nfault) are then, where faults are the same."""
        bounded = np.isfinite(self._bend) & ~self.is_left_out
        own = np.divide(self.values(unknowns), self.scales, out=unknowns.copy(), where=bounded)
        return replace(self, is_bounded=False), own

    @cached_property
    def is_of_torque(self) -> NDArray[np.bool_]:
        """Which faults (nfault) change the torques that are `delivered`; the others change the joints."""
        return self.are(*CHANGES_TORQUE)

    @cached_property
    def _bend(self) -> Array:
        """How sharply each fault bends at 0 (nfault), in its own unknown; inf where it goes straight through."""
        return np.where(self.is_bounded & self.are(*NEVER_NEGATIVE), BEND, np.inf)

    def values(self, unknowns: Array) -> Array:
        """The faults (nfault), in their units, at these `unknowns` (nfault).  Eq. 44."""
        bounded = np.isfinite(self._bend)
        positive = 0.5 * (unknowns + np.hypot(unknowns, np.where(bounded, self._bend, 0.0)))
        changes = self.scales * np.where(bounded, positive, unknowns)
        return np.where(self.about > 0.0, self.about * np.exp(changes), changes)

    def deviations(self, unknowns: Array, deviations: Array) -> Array:
        """Standard deviations of the faults (nfault), in their units, from those of the `unknowns` (nfault)."""
        bounded = np.isfinite(self._bend)
        slope = 0.5 + 0.5 * unknowns / np.hypot(unknowns, np.where(bounded, self._bend, 1.0))
        own = self.scales * deviations * np.where(bounded, slope, 1.0)
        return np.where(self.about > 0.0, self.values(unknowns) * own, own)

    def _by_kind(self, unknowns: Array) -> dict[str, Array]:
        values = self.values(unknowns)
        return {kind: values[own] for kind, own in self._places.items()}

    @cached_property
    def _places(self) -> dict[str, NDArray[np.bool_]]:
        """Which faults (nfault) are of each kind."""
        return {kind: self.are(kind) for kind in self.kinds}

    def joints(self, unknowns: Array) -> Joints:
        """What the joints have at these `unknowns` (nfault)."""
        found = self._joints(self.values(unknowns))
        found.cogging[2] = self.teeth if "cogging" in self.kinds else 0.0
        return found if "presliding" in self.kinds else found._replace(presliding=np.array([PRESLIDING]))

    def _joints(self, values: Array) -> Joints:
        """What the joints have by the faults of these `values` (... x nfault); how often cogging repeats is none."""

        def of(kind: str, count: int) -> Array:
            nothing = np.zeros((*values.shape[:-1], count))
            return values[..., self._places[kind]] if kind in self.kinds else nothing

        n = self.njoint
        viscous, dry, spring, offset = (of(kind, n) for kind in ("viscous", "dry", "spring", "offset"))
        rotor = np.concatenate([np.zeros((*values.shape[:-1], 1)), of("rotor", n - 1)], axis=-1)
        cogging = np.zeros((*values.shape[:-1], 3, n))
        cogging[..., :2, :] = of("cogging", 2 * n).reshape(*values.shape[:-1], 2, n)
        return Joints(viscous, dry, spring, offset, of("tilt", self.tilts), rotor, of("presliding", 1), cogging)

    def further(self, trial: ReadTrial, unknowns: Array, acted: Array) -> Further:
        """What the torques and the joints change by with each of the `unknowns` (nfault), those of torques first.

        Args:
            trial: with the torques that were commanded.
            unknowns: where the faults are.
            acted: the torques that are `delivered` there.
        """
        steps, arrived = STEP * np.eye(len(unknowns))[self.is_of_torque], self._arriving(trial, unknowns)
        torques = []
        for step, is_behind in zip(steps, self._is_behind[self.is_of_torque], strict=True):
            arriving = arrived if is_behind else self._arriving(trial, unknowns + step)
            torques.append((self._made_of(arriving, unknowns + step) - acted) / STEP)
        slopes = (self.values(unknowns + STEP) - self.values(unknowns)) / STEP
        others = np.diag(slopes)[~self.is_of_torque]
        joints = self._joints(others) if len(others) else None
        return Further(np.stack(torques, axis=-1) if torques else np.empty((*acted.shape, 0)), joints)

    def delivered(self, trial: ReadTrial, unknowns: Array) -> Array:
        """The torques (npush x nstep x njoint), in N m, that act in place of those of a `trial`, at these `unknowns`
        (nfault); in the order of C: for another, loops are compiled anew.
        """
        return self._made_of(self._arriving(trial, unknowns), unknowns)

    def _arriving(self, trial: ReadTrial, unknowns: Array) -> Array:
        """What drives are asked for when, before they make torques of it."""
        found, torques = self._by_kind(unknowns), trial.torques
        if "limit" in found:
            limits = found["limit"] / np.append(1.0, found.get("gain", np.ones(self.njoint - 1)))
            torques = np.clip(torques, -limits, limits)
        early = np.zeros_like(torques)
        if "delay" in found:
            torques, early = late(torques, float(found["delay"][0]) / trial.period)
        if "lag" in found:
            torques, earlier = lagging(torques, float(found["lag"][0]) / trial.period)
            early = early + earlier
        if trial.is_continuous:
            torques = torques + np.diff(early, axis=1, prepend=0.0)  # Eq. 41
        return torques

    def _made_of(self, arriving: Array, unknowns: Array) -> Array:
        """The torques that drives make of what is `arriving`."""
        found, torques = self._by_kind(unknowns), arriving
        if "gain" in found:
            torques = torques * np.append(1.0, found["gain"])
        if "bias" in found:
            torques = torques + found["bias"]
        return np.ascontiguousarray(torques)

    @cached_property
    def _is_behind(self) -> NDArray[np.bool_]:
        """Which faults (nfault) change nothing of what is `arriving`: a drive's limit is one of its own torque."""
        return self.is_left_out | self.are("bias", *(() if "limit" in self.kinds else ("gain",)))


@dataclass(frozen=True)
class FoundFaults:
    """The faults that were `searched`: their `values` (nfault) and standard `deviations` (nfault), in the units of
    `metaid.plant.unknown_faults`; the `unknowns` (nfault) of the fit that they are; and which are `determined`
    (nfault): the trials narrow their priors. Those left out are 0, their deviations NaN.
    """

    searched: SearchedFaults
    values: Array
    deviations: Array
    unknowns: Array
    determined: NDArray[np.bool_]

    @property
    def impossible(self) -> list[str]:
        """The names of those that no plant has, friction that drives or a spring that pushes away: below 0 by more than
        noise tells.
        """
        bounds = -BELOW * self.deviations - TRIFLE * self.searched.scales
        is_impossible = (self.values < bounds) & self.searched.are(*NEVER_NEGATIVE)
        return [name for name, is_one in zip(self.searched.names, is_impossible, strict=True) if is_one]


NO_FAULTS = SearchedFaults((), 0, np.empty(0))


def searched_faults(kinds: tuple[str, ...], robot: Unknowns, start_speeds: Array, teeth: int = 0) -> SearchedFaults:
    """Faults of these `kinds`, with what they may be beforehand.

    Args:
        kinds: of the faults.
        robot: whose torques friction and springs are shares of.
        start_speeds: joint speeds (npush x njoint) right after the pushes, in rad/s.
        teeth: how many times a turn cogging repeats; 0 where that is not known.
    """
    speed = float(np.abs(start_speeds).max())
    torques = np.asarray(robot.torques(speed))
    torque = float(torques.max())
    scales = {
        "delay": TURN / speed,
        "tilt": LEAN,
        "offset": LEAN,
        "viscous": OF_DRAG * torque / speed,
        "limit": OF_LIMIT,
        "rotor": OF_INERTIA * float(robot.inertia.max()),
        **{kind: share * torque for kind, share in OF_TORQUE.items()},
        **{kind: spread for kind, (_, spread) in ABOVE_ZERO.items()},
    }
    each = [scales[kind_of(name)] for name in fault_names(kinds, robot.njoint, robot.tilts)]
    return SearchedFaults(kinds, robot.njoint, np.array(each), robot.tilts, teeth=teeth, limits=LIMIT * torques)


def found_faults(searched: SearchedFaults, point: Array, covariance: Array) -> FoundFaults | None:
    """The faults at a `point` of a fit, by the `covariance` of the unknowns of all pushes (nunknown x nunknown): those
    of the faults, whose standard deviations were 1 beforehand, are the last of them. None where none were searched.
    """
    if not searched.names:
        return None
    count = len(covariance)
    own = slice(count - len(searched.names), count)
    unknowns, deviations = point[own], np.sqrt(np.diag(covariance)[own])
    values, scales = searched.values(unknowns), np.where(searched.is_left_out, np.nan, searched.scales)
    reach = np.where(searched.is_left_out, np.nan, searched.deviations(unknowns, deviations))
    determined = np.where(searched.about > 0.0, deviations, reach / scales) <= DETERMINED
    return FoundFaults(searched, values, reach, unknowns, determined)


def late(torques: Array, steps: float) -> tuple[Array, Array]:
    """The `torques` (npush x nstep x njoint), in N m, each that many `steps` later, or earlier where that is negative:
    the mean over each step of torques that are held for a step. None acts before the first. And how early in its step
    each acts, the first moment about its middle (npush x nstep x njoint), in N m steps.  Eq. 40.
    """
    whole = int(np.floor(steps))
    share = steps - whole
    after, before = _moved(torques, whole), _moved(torques, whole + 1)
    return (1.0 - share) * after + share * before, 0.5 * share * (1.0 - share) * (before - after)


def lagging(torques: Array, lag: float) -> tuple[Array, Array]:
    """What motors make of `torques` (npush x nstep x njoint), in N m, whose torque follows with a time constant of
    `lag` steps: the mean over each step. They begin at rest. And how early in its step each acts, as `late` has it.
    Eq. 41.
    """
    from scipy.linalg import solve_banded  # which a command that only reads a DB does without

    left = float(np.exp(-1.0 / lag))
    # At the begin of each step: what is left of it at the step before, and of what was sent then the rest. SciPy's
    # filters take longer to load than most estimates take.
    bands = np.stack([np.ones(torques.shape[1]), np.full(torques.shape[1], -left)])
    sent = (1.0 - left) * _moved(torques, 1).swapaxes(0, 1)
    followed = solve_banded((1, 0), bands, sent.reshape(len(sent), -1), check_finite=False)
    before = followed.reshape(sent.shape).swapaxes(0, 1)
    missing, mean = before - torques, lag * (1.0 - left)
    return torques + missing * mean, missing * (lag - lag * mean - 0.5 * mean)


def _moved(torques: Array, steps: int) -> Array:
    """The `torques` so many whole steps later. The last goes on where they are earlier, for none is known after it."""
    moved = np.zeros_like(torques)
    if steps >= 0:
        moved[:, steps:] = torques[:, : max(torques.shape[1] - steps, 0)]
    else:
        moved[:, :steps], moved[:, steps:] = torques[:, -steps:], torques[:, -1:]
    return moved
