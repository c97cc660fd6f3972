"""Whether what logs say can be used: the verdict, and the table of what is unknown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import first_of, joints_of
from metaid.models import COARSEST, DEVIATIONS, Array
from metaid.recorded.doubts.checks import DRIVEN
from metaid.recorded.doubts.scales import UNIT
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.given import ALL, Given, Option, told
from metaid.recorded.weak_form.linear_model import LEAST_SLIDE, LEAST_TURN
from metaid.recorded.weak_form.normal import FAR_ZERO

EXPLAINED = 3.0  # deviations of the noise: a misfit below explains what was seen
EXACT = 0.002  # of the torque that was left out: an error below explains it, too
LARGEST_ERROR = 0.3  # of the torque that was left out
IDLE = 20.0  # times the torque: an error of the nominal bodies so large is of motors that hardly drove
WELL = 0.01  # of the torque: who predicts it so well need not be better than the nominal bodies
WORSE = 1.1  # times the error of the nominal bodies, from which on these are better
STEADY = 0.9  # of the error of a constant torque: a model that leaves more has predicted nothing else
BETTER = 0.8  # times that error: bodies that predict so well are known together, if none of their parameters is alone
CONTRADICTS = 1.5  # times the error of the nominal bodies, in one part of the logs
SCALE = (
    "every number scales with the torques of the log, and nothing in it shows a wrong scale of all of them, as of "
    "motor currents with a wrong constant"
)
FREE = (
    "no log has a torque: what all bodies weigh together is what the nominal ones do, and every number is a share of it"
)
MOSTLY = 0.5  # of a joint's torque that was left out
OTHERWISE = 1.5  # times what the nominal bodies weigh: a joint that carries more, or as much less, is named
MOST_NAMED = 4  # of what the model may lack


@dataclass(frozen=True)
class RecordedVerdict:
    """The `word`, the `reasons` (sentences without a full stop), and one row an unknown in `lumps`, with the columns of
    `metaid.lumps`, `sd_systematic` and, of an arm, its `expression`.
    """

    word: Literal["found", "approximate", "not found"]
    reasons: tuple[str, ...]
    lumps: pd.DataFrame

    @property
    def is_found(self) -> bool:
        """Whether there is a model to hand over."""
        return self.word != "not found"


def judge_records(found: RecordedEstimate, facts: Sequence[str] = (), given: Given | None = None) -> RecordedVerdict:
    """The verdict on what logs say.

    `found` explains what was seen; `approximate` does not, and predicts what was left out better than the nominal
    bodies with fitted friction do.

    Args:
        found: what they say.
        facts: what looks wrong, as sentences.
        given: what the user has said of the logs; by default nothing.
    """
    determined = found.model.determined(found.values, found.deviations, found.scale)
    lumps = _table(found, determined)
    is_known = bool(determined[: found.model.nbody].any())
    against = tuple(_against(found, is_known))
    if against:
        return RecordedVerdict("not found", (*facts, *against, *_far_zeros(found)), lumps)
    told = (*_of_joints(found), *_carried(found, given), *_far_zeros(found), *_unexplained(found, given))
    if not is_known:
        told = (f"no parameter of the bodies is known to {COARSEST:.0%} by itself, only what they need together", *told)
    reasons = (predicted(found), *facts, *told, FREE if found.model.is_free else SCALE)
    if found.gains is not None:
        reasons = (reasons[0], found.gains.text, *reasons[1:-1])
    is_explained = (found.misfit < EXPLAINED or found.held_out.relative < EXACT) and not found.lacking and not facts
    return RecordedVerdict("found" if is_explained and is_known else "approximate", reasons, lumps)


def predicted(found: RecordedEstimate) -> str:
    """How well what was left out is predicted, beside the nominal bodies, in a sentence without a full stop."""
    held, nominal = found.held_out, found.nominal_held_out
    what = "whole logs" if held.by == "logs" else "parts"
    where = " wherever their motion recurs" if any(fold.recurs for fold in found.chosen.yardstick.folds) else ""
    which = "terms that cancel" if found.model.is_free else "torques"
    return (
        f"{which} of {what} that were left out{where} are predicted to {held.relative:.2%} of what they are, by the "
        f"nominal bodies with fitted friction to {nominal.relative:.2%}"
    )


def _against(found: RecordedEstimate, is_known: bool) -> Iterator[str]:
    """What speaks against the model, of which a parameter of the bodies `is_known` by itself or none is."""
    model, held, nominal = found.model, found.held_out, found.nominal_held_out
    reach = np.max([np.ptp(record.angles, axis=0) for record in found.records], axis=0)
    share = reach / model.least_reach
    if not share.max() >= 1.0:
        farthest = int(share.argmax())
        unit = "m" if model.slides[farthest] else "rad"
        yield (
            f"no joint goes farther than {reach[farthest]:.2g} {unit} from end to end: within so "
            f"little friction holds like a spring (allowed: {LEAST_TURN:g} rad or more, {LEAST_SLIDE:g} m of a slide): "
            "move farther"
        )
        return
    what = "logs" if held.by == "logs" else "parts of the log"
    worst = int(held.by_joint.argmax())
    if not held.relative <= LARGEST_ERROR:
        advice = (
            "look for wrong units, signs or lengths, for forces that are in no term, and for torques that are late"
            if nominal.relative < IDLE
            else f"the nominal bodies need {nominal.relative:.0f} times as much: the motors hardly drove, and what "
            "swings freely says nothing of torques; drive it, or look for wrong units"
        )
        yield (
            f"torques of {what} that were left out are predicted to {held.relative:.0%} of what they are, "
            f"worst in joint {model.joints[worst]} (allowed: {LARGEST_ERROR:.0%}): {advice}"
        )
        return
    missed, steady, whole = (
        float(np.linalg.norm(each[found.equations.driven])) for each in (held.missed, _about_mean(found), held.of)
    )
    if missed > STEADY * steady:
        yield (
            f"torques of {what} that were left out hardly change: a constant one predicts them as well as any body "
            f"does, to within {steady / whole:.2%}, as of a motor at its limit, or of a robot that a hand moves: let "
            "motors move it"
        )
        return
    most = DRIVEN if model.is_free else LARGEST_ERROR
    for joint in np.flatnonzero(model.passive & (_moving(found) > most)).tolist():
        yield (
            f"joint {model.joints[joint]} does not move as one without a motor: {held.by_joint[joint]:.0%} of the "
            f"terms that cancel in it are left (allowed: {most:.0%})"
        )
    if held.relative > WORSE * nominal.relative and held.relative > WELL and found.misfit > EXPLAINED:
        yield (
            f"{what} that were left out are predicted to {held.relative:.1%}, no better than by the nominal bodies "
            f"with fitted friction, {nominal.relative:.1%}: move faster, farther, or longer"
        )
    bad = np.flatnonzero((held.folds > CONTRADICTS * nominal.folds) & (held.folds > LARGEST_ERROR))
    if len(bad):
        yield (
            f"parts of the data contradict each other: {_fold(found, int(bad[0]))} is predicted to "
            f"{held.folds[bad[0]]:.0%} from the others, by the nominal bodies to {nominal.folds[bad[0]]:.0%}"
        )
    if not is_known and held.relative > BETTER * nominal.relative:
        yield f"the log shows nothing of the bodies to better than {COARSEST:.0%}: move faster, or longer, or farther"


def _about_mean(found: RecordedEstimate) -> Array:
    """Root mean square of the judged torque of each joint about its mean in each log (njoint), in N m or N."""
    sent = [own.acting(found.delay)[own.judged] for own in found.logs]
    about = np.concatenate([each - each.mean(axis=0) for each in sent if len(each)])
    return np.asarray(np.sqrt((about**2).mean(axis=0)), dtype=np.float64)


def _moving(found: RecordedEstimate) -> Array:
    """The share of each joint's torque that is not predicted (njoint); 0 of those held, and of torques not used."""
    return np.where(found.equations.held | found.model.untrusted, 0.0, found.held_out.by_joint)


def _of_joints(found: RecordedEstimate) -> Iterator[str]:
    """Of which joints the torque is mostly not predicted, which are held, and which are taken to have no motor, in a
    sentence each.
    """
    missed = found.model.named(_moving(found) > MOSTLY)
    if missed:
        yield f"more than half of the torque of {', '.join(missed)} is not predicted"
    names = found.model.named(found.equations.held)
    if names:
        are = "is held, and its torque counts" if len(names) == 1 else "are held, and their torques count"
        yield f"{', '.join(names)} {are} little: stiction bears what a motor does not show"
    if any(own.held.any() for own in found.logs):
        yield "torques of joints that are held in a log and move in another count little there, and are not judged"
    names = found.model.named(found.model.passive)
    if names:
        yield (
            f"the torque of {joints_of(names)} is 0, as without a motor: its error is a share of the terms that cancel"
        )


def _carried(found: RecordedEstimate, given: Given | None) -> Iterator[str]:
    """Which joints carry far more or less than the nominal bodies weigh, and no other unit, in a sentence."""
    times = np.maximum(found.carried, 1.0 / found.carried)
    far = np.flatnonzero((times > OTHERWISE) & (times < UNIT))
    if len(far) and found.gains is None:
        carried = [(found.model.joints[joint], float(found.carried[joint])) for joint in far]
        factors = ", ".join(f"{name} {factor:.2g}" for name, factor in carried)
        options = _scaled({name: 1.0 / factor for name, factor in carried}, given)
        yield (
            f"what joints carry is not what the nominal bodies weigh, but so many times that: {factors}; the bodies "
            f"are wrong, or the torques are, as with another motor constant: {options}"
        )


def _far_zeros(found: RecordedEstimate) -> Iterator[str]:
    """That zeros of encoders come out farther than chance puts them, in a sentence."""
    log, joint = np.unravel_index(int(np.abs(found.zeros).argmax()), found.zeros.shape)
    if abs(found.zeros[log, joint]) > FAR_ZERO:
        yield (
            f"the zero of joint {found.model.joints[joint]} comes out at {found.zeros[log, joint]:.2g} rad in "
            f"{found.records[log].name}, farther than chance puts it: compare the log's angles with the nominal frames"
        )


def _fold(found: RecordedEstimate, number: int) -> str:
    """A part that was left out, in words."""
    fold = found.chosen.yardstick.folds[number]
    names = ", ".join(found.records[log].name for log in fold.logs)
    return names if fold.third is None else f"part {fold.third + 1} of {names}"


def _scaled(factors: Mapping[str, float], given: Given | None) -> str:
    """The options that multiply torques of joints with these `factors` and what the user has `given`, in words."""
    options = tuple(Option("scale", name, float(f"{factor:.2g}")) for name, factor in factors.items())
    return told((options,) if given is None else given.beside((options,)))


def _unexplained(found: RecordedEstimate, given: Given | None) -> Iterator[str]:
    """What is not explained, at most three sentences."""
    if found.scale != 1.0:
        is_milli = 300.0 < found.scale < 3000.0
        option = _scaled({ALL: 0.001 if is_milli else 1.0 / found.scale}, given)
        guess = ", or these are a guess" if found.equations.doubt > 1.0 else ""
        yield (
            f"all torques are {found.scale:.3g} times what the nominal bodies need{guess}: "
            + (f"mN m? {option}" if is_milli else f"motor currents? {option} or so")
            + "; until then every number is in the unit of the log"
        )
    if found.misfit >= EXPLAINED and found.held_out.relative >= EXACT:
        held = found.held_out
        worst = int(_moving(found).argmax())
        unit = "N" if found.model.slides[worst] else "N m"
        yield (
            f"what is left is above the noise of the angles, most in joint {held.joints[worst]} "
            f"({held.missed[worst]:.3g} of {held.of[worst]:.3g} {unit})"
        )
    if found.lacking:
        named = first_of(found.lacking, MOST_NAMED, "; ")
        yield f"{named} would explain some of what is left, which sd_systematic holds"
    if found.chosen.delay_at_bound:
        yield (
            f"the delay of the torques, {1e3 * found.delay:.3g} ms, is an end of what was tried: it stands for "
            "something else, as hysteresis"
        )


def _table(found: RecordedEstimate, determined: NDArray[np.bool_]) -> pd.DataFrame:
    model, values, deviations = found.model, found.values, found.deviations
    nominal = np.full(len(values), np.nan)
    nominal[: model.nbody] = model.nominal
    reach = DEVIATIONS * deviations
    columns: dict[str, Any] = {
        "name": model.names,
        "unit": model.units,
        "nominal": nominal,
        "factor": values / np.where(nominal == 0.0, np.nan, nominal),
        "identified": values,
        "sd": deviations,
        "sd_systematic": found.systematic,
        "low": values - reach,
        "high": values + reach,
        "true": np.nan,  # of a robot that is recorded nobody knows it
        "error": np.nan,
        "determined": determined,
        "expression": model.expressions,
    }
    return pd.DataFrame(columns)
