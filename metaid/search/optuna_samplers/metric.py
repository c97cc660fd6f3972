"""Any sampler of Optuna's, working in a study's coordinates in place of the factors.

In the nominal metric the squared measure is nearly κ |z − z*|². So the value of a trial says how far it is from the
truth: √(f²/κ), the distance d of the best one. A sampler that knows this need not look elsewhere:

- TPE, the Gaussian process and others are shown a cube about the best trial, of half-width 1.2 d/√n, and the trials in
  it. The cube moves and shrinks with the best trial. Of four trials one is drawn uniformly in it: kernels about a few
  good trials can settle in a place from which nothing improves.
- CMA-ES keeps a state of its own, so its cube stays: about the first survivor, of half-width 1.5 d. Optuna begins it in
  the middle, with a sixth of the width for a step.

Where the curvature κ is not known, the sampler has all trials and all that the bounds allow, CMA-ES about the start.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Container, Sequence
from copy import copy
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.samplers import BaseSampler, CmaEsSampler, GPSampler, TPESampler
from optuna.trial import FrozenTrial, TrialState

from metaid.episode import FALL_VALUE
from metaid.models import Array
from metaid.search.coordinates import Coordinates

REACH = 1.2  # of d/√n: half the width of the moving cube; in one of half-width d/√n the corners are d away
STILL_REACH = 1.5  # of d: half the width of the cube that stays
UNIFORM_EVERY = 4  # trials, of which one is drawn uniformly
TRIES = 20  # of a candidate beyond the bounds, before it is moved to the nearest one
SMALLEST = 1e-12  # half-width of a cube: a value of zero has no distance
STARTUP = 5  # trials in the cube, before which TPE draws uniformly
FINISHED = TrialState.COMPLETE, TrialState.PRUNED


class _Shown(optuna.Study):
    """An Optuna study as a sampler is shown it: the same storage, and the trials that it is given."""

    shown: Sequence[FrozenTrial] = ()

    def _get_trials(
        self, deepcopy: bool = True, states: Container[TrialState] | None = None, use_cache: bool = False
    ) -> list[FrozenTrial]:
        return [trial for trial in self.shown if states is None or trial.state in states]


class MetricSampler(BaseSampler):
    """Proposes factors under `names` (nlump) where another `sampler` proposes z of these `coordinates`.

    The first trial is the start. A sampler that ranks trials is shown falls and pruned trials as complete ones with the
    value that they ended with, which for a fall is above every survivor's (Eq. 18): its attribute `fall_value` or, in
    a study of metaid's own, its value.
    """

    def __init__(self, names: Sequence[str], coordinates: Coordinates, sampler: BaseSampler) -> None:
        self._names = tuple(names)
        self._coordinates = coordinates
        self._sampler = sampler
        self._ranks = isinstance(sampler, (TPESampler, CmaEsSampler))
        self._stays = isinstance(sampler, CmaEsSampler)
        self._tries = 1 if isinstance(sampler, GPSampler) else TRIES  # which is slow, and proposes the same again
        self._keys = [f"z_{i}" for i in range(len(self._names))]
        self._space: dict[str, BaseDistribution] = {key: FloatDistribution(-1.0, 1.0) for key in self._keys}
        self._known: dict[tuple[str, int], Array] = {}  # z (nlump) of finished trials, by study and number
        self._shown: dict[str, _Shown] = {}
        self._lock = threading.RLock()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {type(self._sampler).__name__}: factors={len(self._names)}>"

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_lock": None, "_known": {}, "_shown": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.RLock()

    def infer_relative_search_space(self, study: optuna.Study, trial: FrozenTrial) -> dict[str, BaseDistribution]:
        return candidate_space(self._names, self._coordinates.low, self._coordinates.high)

    def sample_relative(
        self, study: optuna.Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        self._raise_error_if_multi_objective(study)
        with self._lock:
            z = self._propose(study, trial)
        return dict(zip(self._names, self._coordinates.factors(z).tolist(), strict=True))

    def _propose(self, study: optuna.Study, trial: FrozenTrial) -> Array:
        """The z (nlump) of a `trial`."""
        trials = [each for each in study.get_trials(deepcopy=False) if each.params.keys() >= set(self._names)]
        if trial.number == 0:
            return np.zeros(len(self._names))
        finished = [each for each in trials if each.state in FINISHED and _value(each) is not None]
        table = np.array([self._z(study, each) for each in finished]).reshape(-1, len(self._names))
        centre, half = self._box(finished, table)
        positions = (table - centre) / half
        near = np.full(len(finished), True) if self._stays else np.abs(positions).max(axis=1, initial=0.0) <= 1.0
        shown = self._study(study)
        shown.shown = [self._as_shown(each, u) for each, u, kept in zip(finished, positions, near, strict=True) if kept]
        shown.shown += [_frozen(each, {}, each.state) for each in trials if each.state == TrialState.RUNNING]
        moves = self._coordinates.curvature is not None and not self._stays
        is_uniform = not finished or (moves and trial.number % UNIFORM_EVERY == 0)
        for _ in range(self._tries):
            proposed = {} if is_uniform else self._sampler.sample_relative(shown, trial, self._space)
            u = np.array([proposed[key] for key in self._keys]) if proposed else self._uniform(shown, trial)
            z: Array = centre + half * u
            if self._coordinates.inside(z):
                break
        return z

    def _box(self, finished: Sequence[FrozenTrial], table: Array) -> tuple[Array, Array]:
        """Centre and half-widths (nlump each), in z, of what the sampler looks through, its u being from −1 to 1, once
        these trials are `finished`, which are at the z (ntrial x nlump) of a `table`.
        """
        survivors = [i for i, each in enumerate(finished) if each.state == TrialState.COMPLETE]
        if self._coordinates.curvature is None or not survivors:
            low, high = self._coordinates.box()
            if self._stays:
                return np.zeros(len(low)), np.maximum(high, -low)
            return 0.5 * (low + high), 0.5 * (high - low)
        values = np.array([finished[i].value for i in survivors])
        about = 0 if self._stays else int(values.argmin())
        reach = STILL_REACH if self._stays else REACH / np.sqrt(len(self._names))
        half = max(reach * self.distance(float(values[about])), SMALLEST)
        return table[survivors[about]], np.full(len(self._names), half)

    def distance(self, value: float) -> float:
        """How far a trial with this `value` of the measure is from the truth, in z; NaN where κ is not known."""
        curvature = self._coordinates.curvature
        return abs(value) / np.sqrt(curvature) if curvature is not None else np.nan

    def _z(self, study: optuna.Study, trial: FrozenTrial) -> Array:
        key = study.study_name, trial.number
        if key not in self._known:
            self._known[key] = self._coordinates.z(np.array([trial.params[name] for name in self._names]))
        return self._known[key]

    def _study(self, study: optuna.Study) -> _Shown:
        if study.study_name not in self._shown:
            shown = self._shown[study.study_name] = _Shown.__new__(_Shown)
            shown.__setstate__(study.__getstate__())  # as pickle makes it: a study does not offer its storage
        return self._shown[study.study_name]

    def _as_shown(self, trial: FrozenTrial, u: Array) -> FrozenTrial:
        """A finished `trial` as the sampler is shown it, at `u` (nlump)."""
        state = TrialState.COMPLETE if self._ranks else trial.state
        return _frozen(trial, dict(zip(self._keys, u.tolist(), strict=True)), state, self._space)

    def _uniform(self, shown: _Shown, trial: FrozenTrial) -> Array:
        """A uniform u (nlump) of the sampler's own random numbers."""
        shown.shown = ()  # without trials it has nothing to learn from
        space = self._space.items()
        return np.array([self._sampler.sample_independent(shown, trial, key, each) for key, each in space])

    def sample_independent(
        self, study: optuna.Study, trial: FrozenTrial, param_name: str, param_distribution: BaseDistribution
    ) -> Any:
        """A parameter that is none of the factors, as the other sampler proposes it.

        Args:
            study: of Optuna's.
            trial: that is to have the parameter.
            param_name: its name.
            param_distribution: what it may be.
        """
        return self._sampler.sample_independent(study, trial, param_name, param_distribution)

    def before_trial(self, study: optuna.Study, trial: FrozenTrial) -> None:
        self._sampler.before_trial(study, trial)

    def after_trial(
        self, study: optuna.Study, trial: FrozenTrial, state: TrialState, values: Sequence[float] | None
    ) -> None:
        """Lets the other sampler know that a trial is over.

        Args:
            study: of Optuna's.
            trial: that is over.
            state: how it ended.
            values: of the measure, None where it has none.
        """
        self._sampler.after_trial(study, trial, state, values)

    def reseed_rng(self) -> None:
        self._sampler.reseed_rng()


def candidate_space(names: Sequence[str], low: Array, high: Array) -> dict[str, Any]:
    """What candidates may be, as Optuna has it: by each of the `names` a number from `low` to `high` (nlump each)."""
    bounds = zip(names, low.tolist(), high.tolist(), strict=True)
    return {name: FloatDistribution(least, most) for name, least, most in bounds}


def _frozen(
    trial: FrozenTrial, params: dict[str, Any], state: TrialState, space: dict[str, BaseDistribution] | None = None
) -> FrozenTrial:
    """The same trial with other `params` of a `space`, in another `state`."""
    shown = copy(trial)
    shown.params, shown.distributions, shown.user_attrs, shown.state = params, space or {}, {}, state
    shown.value = _value(trial)
    return shown


def _value(trial: FrozenTrial) -> float | None:
    """What a finished trial is ranked by; None where that is not known."""
    ranked = trial.user_attrs.get(FALL_VALUE)
    return trial.value if trial.value is not None or ranked is None else float(ranked)


def tpe_for_metric(seed: int | None) -> TPESampler:
    """The TPE sampler that works best in a `MetricSampler`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        return TPESampler(seed=seed, multivariate=True, constant_liar=True, n_startup_trials=STARTUP)
