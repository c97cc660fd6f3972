"""A study's experiment as the estimate needs it: how the plant is pushed, what is unknown of it, what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import blake2b
from typing import Any, ClassVar

import numpy as np

from metaid.episode import Outcome
from metaid.estimation.approximation import HeldOutPushes, Prediction
from metaid.estimation.estimate import Found
from metaid.estimation.faults import NO_FAULTS, Proposal, SearchedFaults, TakenUp, Unmodelled
from metaid.estimation.fit import fit
from metaid.estimation.laws import Laws
from metaid.estimation.motions import Motions, Quantity
from metaid.estimation.noisy import (
    Innovations,
    Loop,
    Readings,
    as_possible,
    explained,
    fit_with_torque_noise,
    hold_out,
    led,
    predicted,
    proposed_faults,
    take_up,
    unmodelled_forces,
)
from metaid.estimation.trials import ReadTrial, Replay, WatchedTrial
from metaid.models import Array

PROBES = {"speed": 1, "both": 1, "frequency": 2}  # trials that show much, by what is compared
RESTARTS = 3  # of a fit that explains nothing, from elsewhere
AGREED = 1e-6  # of what an unknown may be beforehand: two estimates that are so near each other are the same
STILL_SHRINKS = 0.95  # of the widest interval before: a trial that leaves more of it is worth no other

SeenTrial = WatchedTrial | ReadTrial


@dataclass(frozen=True, eq=False)
class Experiment:
    """What is the same in all trials of a study. Where there is no noise, the windows of each push are compared with a
    twin under the same law; else the readings of sensors with a twin that is driven by what was commanded.

    Attributes:
        laws: that are sent.
        unknowns: what an estimate is of, `Unknowns`; it may have lumps that no law has, those of inertia.
        timestep: in which the plant moves, in s.
        starts: joint coordinates and speeds (npush x 2 x njoint) right after each push.
        stiffness: k of the law on each push (npush), or the same on all, in 1/s².
        resolution: of the measure, in its unit; a value below it passes for coasting.
        compared: what of the motion, where there is no noise.
        loop: how the plant is controlled and read; None where sensors are exact.
        faults: that are searched beside what is unknown of the robot.
        takes_up: whether faults are searched, too, once nothing explains the trials without them.
        torque_noise: what the noise of each joint's torque (njoint) is said to be, in N m; None where torques have
            none. How large it is, is found.
        remembered: estimates that were made of readings without a start, by digests of these: a search makes that of
            its first trials, the estimate of all trials begins from it, and whether they were enough is asked of it.
    """

    laws: Laws
    unknowns: Any
    timestep: float
    starts: Array
    stiffness: Array | float = 0.0
    resolution: float = 0.0
    compared: Quantity = "speed"
    loop: Loop | None = None
    faults: SearchedFaults = NO_FAULTS
    takes_up: bool = False
    torque_noise: Array | None = None
    remembered: dict[bytes, Any] = field(default_factory=dict, repr=False)

    counts: ClassVar[bool] = False
    """Whether half periods are counted, and no motion compared."""

    def trial(self, candidate: Array, outcome: Outcome) -> Any:
        """A `SeenTrial`: the law of a `candidate`, and what was seen of it; None where nothing of it is known."""
        law: Any = self.laws.law(candidate)
        if self.loop is None:
            shown = outcome.windows
            return None if shown is None else WatchedTrial(law, self.timestep, self.starts, shown, self.stiffness)
        if outcome.readings is None:
            return None
        return self.loop.trial(outcome.readings, self.starts, partial(self.laws.commanded, law))

    # What a sampler asks.

    @property
    def probes(self) -> int:
        """How many trials that show much an estimate needs."""
        return PROBES[self.compared] if self.loop is None else 1

    def probe(self, start: Array, random: np.random.Generator | None) -> Array:
        """A candidate whose law shows much, from that of the `start`: the first time the same, then at `random`."""
        return self.laws.probe(start, random, self.torque_noise is not None)

    def factors(self, estimate: Any) -> Array:
        """The candidate whose law an `estimate` has."""
        return self.laws.candidate(estimate)

    def is_to_probe(
        self, trials: Sequence[Any], were_probes: Sequence[bool], estimate: Found, is_settled: bool
    ) -> bool:
        """Whether the next law is another than that of the estimate. Without noise it is where intervals have stopped
        shrinking, for a law that coasts shows no more. Where torques are noisy, every other law is: one that coasts
        shows gravity lumps alone, and one that swings the others. With other noise it is where that, as far as `trials`
        of either kind have told, leaves the smaller determinant of the covariance.

        Args:
            trials: that the estimate is of.
            were_probes: which of them had other laws.
            estimate: that explains them.
            is_settled: whether the last trial narrowed its intervals no more.
        """
        if self.loop is None:
            return is_settled
        if self.torque_noise is not None:
            return len(trials) % 2 == 1
        told, probes = self._information(trials, estimate), np.asarray(were_probes)
        if told is None or probes.all() or not probes.any():
            return is_settled
        known = told.sum(axis=0) + np.eye(told.shape[-1])
        by_probe, by_estimate = (np.linalg.slogdet(known + told[kind].mean(axis=0))[1] for kind in (probes, ~probes))
        return bool(by_probe > by_estimate)

    def _information(self, trials: Sequence[Any], estimate: Found) -> Array | None:
        """What each of the `trials` tells about what is unknown of all, faults too (ntrial x nunknown x nunknown), JᵀJ
        scaled by the prior, at their `estimate`; None where the twin cannot follow.
        """
        compared = self.searching(estimate)._readings(trials)
        residuals = compared.residuals(estimate.point, compared.stages)
        if residuals is None:
            return None
        jacobian = residuals.slopes.reshape(len(trials), -1, len(compared.spreads)) * compared.spreads
        return np.asarray(jacobian.swapaxes(1, 2) @ jacobian, dtype=np.float64)

    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts. Noise hides how well one does: then its intervals
        say how well the plant is known.
        """
        return self.loop is None and value <= self.resolution

    def is_settled(self, before: Found, after: Found) -> bool:
        """Whether one more trial tells no more, from the estimate `before` the last one to the one `after` it: with
        noise where intervals have stopped shrinking. Without it a chain coasts in the end. An arm with dry friction
        never coasts as well as can be told, for a law that takes it for smooth chatters; there estimates agree.
        """
        if self.loop is None:
            moved = np.abs(after.unknowns - before.unknowns).max()
            return bool(self.unknowns.leads_on and float(moved) <= AGREED * self.unknowns.spread)
        if self.torque_noise is not None:  # a trial narrows the intervals of those lumps that it shows
            return bool((after.deviations > STILL_SHRINKS * before.deviations).all())
        return float(after.deviations.max()) > STILL_SHRINKS * float(before.deviations.max())

    # What trials say.

    @property
    def refines(self) -> bool:
        """Whether an estimate of some trials leads to that of more in a step or two."""
        return self.loop is None or self.unknowns.leads_on

    def estimate(self, trials: Sequence[Any], start: Found | None = None, thorough: bool = True) -> Any:
        """What all `trials` say; None where they showed nothing, or no robot shows what they did.

        A `start` that explained the trials before is where the fit begins. Where that explains nothing, a
        `thorough` fit begins elsewhere RESTARTS times. Of noisy readings that are not explained, the fit takes up
        faults if it is to, and lets noise of the torques stand for what the model has not. What did so for the trials
        before is gone on with.
        """
        if start is not None or self.loop is None or (self.faults.names and not self.takes_up):
            return self._estimated(trials, start, thorough)
        digest = _digest(trials)
        if digest not in self.remembered:
            self.remembered[digest] = self._estimated(trials, None, thorough)
        return self.remembered[digest]

    def _estimated(self, trials: Sequence[Any], start: Found | None, thorough: bool) -> Any:
        """The same, made now."""
        if self.takes_up and start is None and self.loop is not None:
            found = self._fitted(trials, None, thorough)
            return found if found is None else self.taken_up(trials, found)[0]
        if self.takes_up and start is not None and start.faults is not None:
            return self.searching(start).estimate(trials, start, thorough)
        if start is not None and start.led_misfit is not None:
            gone_on = led(self._readings(trials), start)
            if gone_on is not None:
                return explained(self._readings(trials), gone_on) or gone_on
        found = self._fitted(trials, start, thorough)
        if found is None or found.is_explained or self.loop is None or self.torque_noise is not None:
            return found
        return led(self._readings(trials), found) or found

    def _fitted(self, trials: Sequence[Any], start: Found | None, thorough: bool) -> Found | None:
        """What the `trials` say with what is searched."""
        begin = start.start if start is not None and start.is_explained else None
        restarts = RESTARTS if thorough and self.loop is None and not self.unknowns.leads_on else 0
        try:
            return self._fit(self._comparison(trials), begin, restarts)
        except ValueError:
            return None

    def _fit(self, compared: Any, begin: Array | None, restarts: int) -> Found | None:
        """What is `compared` says of the robot; None where no robot shows what was seen."""
        if isinstance(compared, Innovations) and self.torque_noise is not None:
            return fit_with_torque_noise(compared, begin, self.torque_noise)
        found: Found | None = fit(compared, begin, restarts, refines=self.refines)
        return found

    def unmodelled(self, trials: Sequence[Any], estimate: Found) -> list[Unmodelled]:
        """What the model has not, as far as the `trials` show it beside an `estimate` of them. Without noise there is
        nothing to look for: the misfit says all. Where faults have been tried, no force is seen any more.
        """
        found = [] if self.loop is None else list(unmodelled_forces(self._readings(trials), estimate))
        if estimate.led_misfit is not None and (self.takes_up or estimate.faults is not None):
            return [replace(each, is_seen=False, is_hinted=False) if each.is_force else each for each in found]
        return found

    def taken_up(self, trials: Sequence[Any], estimate: Found) -> tuple[Any, TakenUp | None]:
        """What the `trials` say with the faults that explain them, where faults are taken up, and what speaks for
        these; else the `estimate`.
        """
        if not self.takes_up or self.loop is None or (estimate.is_explained and estimate.faults is None):
            return estimate, None
        return take_up(self._readings(trials), estimate)

    def as_possible(self, trials: Sequence[Any], estimate: Found) -> Found:
        """An `estimate` of the `trials` as near as a plant can have it; without noise it is what it is."""
        return estimate if self.loop is None else as_possible(self.searching(estimate)._readings(trials), estimate)

    def searching(self, estimate: Found) -> Experiment:
        """The same where the faults that an `estimate` has taken up are searched from the first trial on."""
        if not self.takes_up or estimate.faults is None:
            return self
        return replace(self, faults=estimate.faults.searched, takes_up=False)

    def proposed(self, trials: Sequence[Any], estimate: Found) -> Proposal | None:
        """Faults that would explain what an `estimate` of the `trials` does not, if they were searched, too. None where
        none does, or no readings were kept to try it.
        """
        if self.takes_up or self.torque_noise is not None or self.loop is None:
            return None  # none of them explains the trials; or gains of a filter that are those without it
        return proposed_faults(self._readings(trials), estimate, self.loop.declared_delay)

    def predicted(self, trials: Sequence[Any], estimate: Found) -> Prediction | None:
        """How well an `estimate` that explains the `trials` predicts some of their pushes from the others. None without
        noise, where it explains nothing, and where no push can be left out.
        """
        if self.loop is None or not estimate.is_explained:
            return None
        return predicted(self._readings(trials), estimate)

    def held_out(self, trials: Sequence[Any], estimate: Found) -> HeldOutPushes | None:
        """How well fits to some of the pushes of the `trials` predict the others, from an `estimate` on. None without
        noise, where a model that leaves more than rounding is wrong, and where there are too few pushes.
        """
        return None if self.loop is None else hold_out(self._readings(trials), estimate)

    def replay(self, trials: Sequence[Any], estimate: Found, number: int) -> Replay:
        """What was seen of one of the `trials` that an `estimate` is made of, and what the twin at the estimate shows
        in its place; `number` is that of its table in `estimate.residuals`.
        """
        replay: Replay = self._comparison(trials).replay(number, estimate.point)
        return replay

    def step_error(self, candidate: Array, outcome: Outcome) -> Array | None:
        """How far (njoint), in rad or m, the nominal twin of a trial moves elsewhere with steps of half the size; None
        where it cannot follow the trial, of this `candidate` and with this `outcome`.
        """
        shown = []
        for parts in (1, 2):
            assert self.loop is not None, "there are readings"
            finer = replace(self.loop, timestep=self.loop.timestep / parts, substeps=self.loop.substeps * parts)
            experiment = replace(self, loop=finer)
            compared = experiment._readings([experiment.trial(candidate, outcome)])
            nominal = np.zeros(len(compared.spreads) + compared.extras)
            shown.append(compared.replay(0, nominal).simulated)
        moved = np.abs(shown[1] - shown[0])
        return None if np.isnan(moved).all() else np.asarray(np.nanmax(moved, axis=(0, 1)))

    def _comparison(self, trials: Sequence[Any]) -> Any:
        """What is compared with the twin.  Raises ValueError where `trials` show nothing."""
        if self.loop is not None:
            return self._readings(trials)
        seen = [trial for trial in trials if trial.windows.seen.any()]
        return Motions(seen, self.unknowns, self.compared)

    def _readings(self, trials: Sequence[Any]) -> Readings:
        """The same of a plant with noise."""
        kind = Readings if self.torque_noise is None else Innovations
        return kind(trials, self.unknowns, faults=self.faults)


def _digest(trials: Sequence[ReadTrial]) -> bytes:
    """Of what was read in `trials` and what they were sent: equal trials of a study have the same."""
    found = blake2b(digest_size=16)
    for trial in trials:
        for shown in (trial.readings, trial.torques, trial.steps, trial.timesteps):
            found.update(shown.tobytes())
    return found.digest()
