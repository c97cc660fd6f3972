"""Whether a study has found its lumps, and if not, why and what to do: one answer for all that shows a result.

An estimate that explains what every push showed is the result, whichever sampler proposed the trials. Where there is
none, the best trial is the result if it coasts nearly as well as the measure can tell, and the model was not refuted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from metaid.errors import StudyError, first_of
from metaid.models import COARSEST, Array
from metaid.results.best import bounds_reached
from metaid.results.lump_tables import best_table, estimate_table, fault_table
from metaid.results.stored import StoredStudy
from metaid.store import Trial
from metaid.study import Problem

Word = Literal["found", "approximate", "not found", "unfinished"]
Source = Literal["estimate", "best trial"]

RESULTS = "found", "approximate"  # the words of what has numbers to use
NUMBERS = frozenset({"factor", "identified", "error"})  # columns of lumps that are not shown where nothing was found
TRIFLE, MOST_NAMED = 0.01, 3  # of a lump; lumps in a sentence
FAR = 3.0  # resolutions of the measure: the value of a minimum is not so far above zero


@dataclass(frozen=True)
class Verdict:
    """The `word`, the `source` of the lumps, the `reasons`, which are sentences without a full stop that name a lump, a
    bound or a number, and the table of `lumps` that the study stands by, as `lumps_frame` has it.
    """

    word: Word
    source: Source
    reasons: tuple[str, ...]
    lumps: pd.DataFrame

    @property
    def is_found(self) -> bool:
        return self.word == "found"

    @property
    def has_result(self) -> bool:
        """Whether there are numbers to use, with intervals: of what is found, or approximate."""
        return self.word in RESULTS

    @property
    def values(self) -> Array:
        """The lumps (nlump) as they are to be used: as identified, all of them, for what is not known of one hangs
        together with the others. What a best trial says nothing of is as beforehand.
        """
        return self.lumps["identified"].fillna(self.lumps["nominal"]).to_numpy()

    @property
    def shown(self) -> pd.DataFrame:
        """The lumps as tables and figures show them: without numbers where nothing was found."""
        return self.lumps.assign(**dict.fromkeys(NUMBERS, np.nan)) if self.word == "not found" else self.lumps

    def refusal(self, name: str, nothing: str, way_out: str = "") -> StudyError:
        """The error of a study of that `name` that has `nothing` to give without a result, and what can be done."""
        why = "; ".join(self.reasons)
        return StudyError(f"study '{name}' has {nothing}: its verdict is '{self.word}': {why}{way_out}")


def judge(snapshot: StoredStudy) -> Verdict:
    """The verdict on a study as it is in the DB."""
    problem, estimate = snapshot.problem, snapshot.estimate
    if estimate is not None and estimate.explains:
        lumps = estimate_table(snapshot, is_result=True)
        if lumps["determined"].any():
            missing = _missing(snapshot, lumps)
            return Verdict("found", "estimate", (*estimate.reasons, *missing, *estimate.provisos), lumps)
        reasons = (
            f"the trials show no {problem.robot.sought.noun} to better than {COARSEST:.0%}: {problem.robot.faint}",
        )
        return _not_yet(snapshot, "estimate", reasons, lumps)
    if problem.is_matching:
        against: tuple[str, ...] = (snapshot.why_no_estimate if estimate is None else estimate.description,)
        source: Source = "estimate"
        lumps = estimate_table(snapshot, is_result=False)
    else:
        lumps, source = best_table(snapshot), "best trial"
        against = tuple(_against_best(snapshot, lumps))
        if not against:
            missing = missed(lumps, f"{problem.measure.name} with these pushes does")
            return Verdict("found", source, tuple(missing), lumps)
    worth = estimate.approximation if estimate is not None and snapshot.is_finished else None
    if estimate is None or worth is None:
        return _not_yet(snapshot, source, (*_fallen_at_once(snapshot), *against), lumps)
    if not worth.holds:
        return _not_yet(snapshot, source, (*_fallen_at_once(snapshot), *against, worth.why_not), lumps)
    lumps = estimate_table(snapshot, is_result=True)
    missing = _missing(snapshot, lumps)
    return Verdict(
        "approximate", "estimate", (worth.predicted, worth.not_explained, *missing, estimate.description), lumps
    )


def _fallen_at_once(snapshot: StoredStudy) -> Iterator[str]:
    """Why trials show little: where no push but the first was survived, or begun, in any."""
    read = [trial.outcome.readings for trial in snapshot.trials]
    if snapshot.problem.is_matching and read and all(each is not None and not each.counts[1:].any() for each in read):
        yield f"every trial fell in its first push: {snapshot.problem.robot.gentler}"


def _missing(snapshot: StoredStudy, lumps: pd.DataFrame) -> Iterator[str]:
    """Which of the `lumps` and faults of the estimate are not determined, or hang on what was not seen."""
    for table in (lumps, fault_table(snapshot, is_result=True)):
        yield from missed(table, "these trials do")
    yield from _hanging(snapshot.problem, lumps)


def _hanging(problem: Problem, lumps: pd.DataFrame) -> Iterator[str]:
    """Which of the `lumps` what the model may lack moves farther than their intervals say, by more than a trifle."""
    if "sd_systematic" not in lumps:
        return
    further, sizes = lumps["sd_systematic"].to_numpy(), problem.robot.estimated.sizes(lumps["identified"].to_numpy())
    far = (further > lumps["sd"].to_numpy()) & (further > TRIFLE * sizes)
    names = lumps["name"][far].tolist()
    if names:
        yield (
            f"what these trials do not show of springs, friction, delays and geometry may move "
            f"{first_of(names, MOST_NAMED)} farther than intervals say: by sd_systematic"
        )


def missed(lumps: pd.DataFrame, who: str) -> Iterator[str]:
    """Which of the `lumps`, or faults, in a table are not determined, though others are."""
    names = lumps["name"][~lumps["determined"]].tolist()
    if names:
        be, them = ("is", "it") if len(names) == 1 else ("are", "them")
        yield f"{', '.join(names)} {be} not determined: {who} not know {them} to a tenth"


def _not_yet(snapshot: StoredStudy, source: Source, reasons: tuple[str, ...], lumps: pd.DataFrame) -> Verdict:
    """Unfinished where trials are left, else not found: then lumps have the numbers of the last estimate or the best
    trial, and none is said to be known.

    Args:
        snapshot: the study.
        source: of the lumps.
        reasons: why nothing is found.
        lumps: the table of what was to be found.
    """
    lumps, done = lumps.drop(columns="sd_systematic", errors="ignore"), len(snapshot.trials)
    lumps[["sd", "low", "high"]] = np.nan
    if not snapshot.is_finished:
        left = f"{done} of {snapshot.spec.study.trials} trials are done"
        return Verdict("unfinished", source, (left, *reasons) if done else (left,), lumps)
    lumps["determined"] = False
    return Verdict("not found", source, reasons, lumps)


def _against_best(snapshot: StoredStudy, lumps: pd.DataFrame) -> Iterator[str]:
    """What speaks against taking the best trial for the result."""
    if snapshot.best is None:
        yield snapshot.problem.robot.all_fell if snapshot.trials else "no trial yet"
        return
    yield from _too_far(snapshot, snapshot.best, lumps)
    yield from _untested(snapshot, snapshot.best)


def _untested(snapshot: StoredStudy, best: Trial) -> Iterator[str]:
    """Why the model of the `best` trial was not tested, or what refuted it.

    Wrong lumps can make up for friction or a spring so well that noise, or a count, does not show what is left over.
    Pushes of an ideal plant that coast as far as the measure can tell have tested the model themselves.
    """
    problem, estimate, name = snapshot.problem, snapshot.estimate, snapshot.problem.measure.name
    shows_all = problem.measure.sees_coriolis and not problem.measure.is_noisy
    if estimate is not None:
        if not (shows_all and best.outcome.value <= problem.resolution):
            yield estimate.description
    elif not shows_all:
        yield (
            f"nothing has tested the model, and {name} alone cannot tell friction from wrong lumps: "
            f"{snapshot.why_no_estimate}"
        )


def _too_far(snapshot: StoredStudy, best: Trial, lumps: pd.DataFrame) -> Iterator[str]:
    """Whether the `best` trial is far from coasting, or tells nothing of any lump."""
    problem, robot, measure = snapshot.problem, snapshot.problem.robot, snapshot.problem.measure
    value, unit, resolution = best.outcome.value, measure.unit, problem.resolution
    is_far = value > FAR * resolution
    if is_far:
        yield (
            f"the best value, {value:.3g} {unit}, is {value / resolution:.3g} times the {resolution:.2g} {unit} that "
            f"{measure.name} can tell from none: try more trials, another seed or another sampler{robot.far_off}"
        )
        yield from bounds_reached(problem, best.factors, np.array([trial.factors for trial in snapshot.trials]))
    if not is_far and not lumps["determined"].any():
        yield f"{measure.name} with these pushes determines no {robot.sought.noun} to better than {COARSEST:.0%}"
