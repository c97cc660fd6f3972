"""The estimate of a study, made of its trials and of those that others had evaluated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from metaid.episode import QUANTITIES, Outcome
from metaid.store import ForeignTrial, Trial, outcome_attributes
from metaid.study.estimates.study_estimate import StudyEstimate
from metaid.study.problem import MOST_TRIALS, Problem

FIRST_TRIALS = 12  # of which it is looked for how early the estimate was there
PROBED = 2  # numbers of first trials to begin with an estimate of: a twin may not follow the first probe alone
CLOSE = 1e-3  # of what an unknown is a multiple of: so near its last value an estimate was there


def watched_trials(
    problem: Problem, trials: Sequence[Trial], foreign: Sequence[ForeignTrial]
) -> tuple[Any, tuple[Any, ...], int]:
    """The experiment of a study, and its trials as that has them, metaid's own before the `foreign` ones, at most
    MOST_TRIALS of each; and of how many others there are. No experiment where none can be made.
    """
    shown = [each for each in trials if each.outcome.windows is not None or each.outcome.readings is not None]
    others = shown_by_others(problem, foreign)[:MOST_TRIALS]
    shown = [*shown[:MOST_TRIALS], *others]
    experiment = problem.experiment() if shown else None
    if experiment is None:
        return None, (), 0
    seen = (experiment.trial(each.factors, each.outcome) for each in shown)
    return experiment, tuple(trial for trial in seen if trial is not None), len(others)


def estimate_of(experiment: Any, trials: tuple[Any, ...], by_others: int = 0) -> StudyEstimate | None:
    """The estimate from all `trials` of an `experiment`, `by_others` of the last not metaid's own; None where there is
    none to be made.

    It is better begun from that of the first trials alone than from the nominal model: a few windows of one trial are
    soon fitted, all of many from there in a step or two, and squares of a motion that nearly coasts carry no sign.
    """
    first = range(experiment.probes, min(experiment.probes + PROBED, len(trials)))
    early = (experiment.estimate(trials[:count]) for count in first)
    probed = next((each for each in early if each is not None), None)
    estimate = experiment.estimate(trials, probed)
    if estimate is None:
        return None
    estimate, taken_up = experiment.taken_up(trials, estimate)
    estimate = experiment.as_possible(trials, estimate)
    searching = experiment.searching(estimate)
    forces, prediction = searching.unmodelled(trials, estimate), searching.predicted(trials, estimate)
    is_predicted = prediction is None or prediction.holds
    left = not estimate.is_explained or not is_predicted or any(each.is_seen for each in forces)
    found = StudyEstimate(
        estimate,
        len(trials),
        lambda: (experiment, trials),
        by_others,
        taken_up,
        tuple(forces),
        prediction,
        searching.held_out(trials, estimate) if left and not experiment.counts else None,
        None if estimate.is_explained else experiment.proposed(trials, estimate),
    )
    return replace(found, known_from=_known_from(found, searching, trials, probed if experiment.refines else None))


def _known_from(found: StudyEstimate, experiment: Any, trials: tuple[Any, ...], probed: Any) -> int | None:
    """How many of the first trials were enough for an estimate; None where that is not said.

    Args:
        found: of all trials.
        experiment: of the study, with all that was found.
        trials: as it has them.
        probed: the estimate of the first of them, from where all others follow; None where each begins anew.
    """
    if not found.explains or experiment.counts:
        return None
    final, reach = found.estimate, CLOSE * experiment.unknowns.scale

    def is_enough(count: int) -> bool:
        if count == len(trials):
            return True
        early = experiment.estimate(trials[:count], probed, probed is None)
        return early is not None and bool(np.abs(early.unknowns - final.unknowns).max() <= reach)

    return first_enough(experiment.probes, min(len(trials), FIRST_TRIALS), is_enough)  # fewer cannot tell all


def first_enough(fewest: int, most: int, is_enough: Callable[[int], bool]) -> int | None:
    """The least number from `fewest` to `most` that is enough; None where `most` is not.

    What is enough is taken to stay so: where the first two are too few, `most` is asked next, which mostly is too few
    on a noisy plant. Else it is looked for in steps that double, then by halves: an estimate from too few trials may
    take seconds to explain nothing.
    """
    is_enough = cache(is_enough)
    if fewest > most:
        return None
    too_few, enough, step = fewest - 1, fewest, 1
    while not is_enough(enough):
        if enough == most or (step == 2 and not is_enough(most)):
            return None
        too_few, enough, step = enough, min(enough + step, most), 2 * step
    while enough - too_few > 1:
        middle = (too_few + enough) // 2
        too_few, enough = (too_few, middle) if is_enough(middle) else (middle, enough)
    return enough


def shown_by_others(problem: Problem, foreign: Sequence[ForeignTrial]) -> list[Trial]:
    """The `foreign` trials that `metaid.objective` evaluated with the settings of the study of this `problem`, and
    that carry motion: each once.
    """
    of_study = [each.shown for each in foreign if each.experiment == problem.spec.experiment] if foreign else []
    carried = [each for each in of_study if each is not None]
    fits = [each for each in carried if has_motion_of(problem.episode, each.outcome)]
    return [each for i, each in enumerate(fits) if not any(_is_copy(each, earlier) for earlier in fits[:i])]


def has_motion_of(episode: Any, outcome: Outcome) -> bool:
    """Whether the windows or the readings of an `outcome` are of such an `episode`."""
    npush, njoint = episode.npush, episode.njoint
    if episode.readings_steps:
        read = outcome.readings
        return read is not None and read.angles.shape == (npush, episode.readings_steps + 1, njoint)
    shown, ends = outcome.windows, episode.window_ends
    same = shown is not None and shown.motion.shape == (npush, len(ends), QUANTITIES, njoint)
    return same and shown is not None and tuple(shown.ends.tolist()) == ends


def _is_copy(one: Trial, other: Trial) -> bool:
    """Whether two trials are one trial and its copy, as Optuna's `add_trials` makes them."""
    same_law = np.array_equal(one.factors, other.factors)
    return same_law and outcome_attributes(one.outcome) == outcome_attributes(other.outcome)
