"""How well torques of whole logs are predicted: by files that metaid wrote, nominal bodies, and least squares.

Both sides pass the same filter without phase. Rows in which the arm stands still are not judged: dry friction may then
have any size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import metaid
from benchmarks.real.judging import (
    ANGLES,
    Log,
    Missed,
    Motion,
    Rows,
    file_torques,
    low_pass,
    missed,
    motion_of,
    mujoco_torques,
)
from benchmarks.real.least_squares import WEIGHTS, prepared, recipe, tuned
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import judged_rows, printed_and_measured, printed_line
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LinearModel, arm_model

YARDSTICK = 7.5  # Hz
CUTOFFS = (3.0, 5.0, 7.5, 10.0, 20.0)  # Hz
CLASSIC = ("viscous", "coulomb", "offset")
TUNED = "least squares, the best filter and weights"
MOST_BESIDE, LEAST_OF_MEASURED = 1.0, 0.6
STILL = 0.02  # rad/s, below which dry friction is a share of its whole


Logs = tuple[Sequence[Log], Sequence[Log]]


@dataclass(frozen=True)
class Test:
    """A motion that is predicted, and which of its rows (nrow) count."""

    motion: Motion
    rows: Rows

    def pair(self, torques: Array, measured: Array | None = None) -> tuple[Array, Array]:
        """Predicted torques (nrow x njoint) through the filter, and the measured ones, of the rows that count."""
        sent = self.motion.torques if measured is None else measured
        return low_pass(torques, YARDSTICK, self.motion.period)[self.rows], sent[self.rows]

    @property
    def with_rest(self) -> Test:
        return Test(self.motion, np.ones_like(self.rows))


def read_test(log: Log) -> Test:
    """A log that is predicted."""
    motion = motion_of(log, ANGLES, YARDSTICK)
    return Test(motion, judged_rows(log, motion))


def file_error(path: Path, tests: Sequence[Test]) -> Missed:
    """That of a file that metaid wrote."""
    return missed([test.pair(file_torques(path, test.motion)) for test in tests])


def nominal_error(model: Any, learned: Sequence[Test], tests: Sequence[Test]) -> Missed:
    """That of the bodies of the URDF, with friction that is fitted to what they leave of the logs that are learned."""

    def friction(speeds: Array) -> Array:
        return np.stack([speeds, np.clip(speeds / STILL, -1.0, 1.0), np.ones_like(speeds)], axis=-1)

    predicted, sent, columns = (
        np.concatenate(parts)
        for parts in zip(*(_with_friction(model, each, friction) for each in learned), strict=True)
    )
    left = sent - predicted
    values = [np.linalg.lstsq(columns[:, joint], left[:, joint], rcond=None)[0] for joint in range(sent.shape[1])]
    return missed([
        test.pair(mujoco_torques(model, test.motion) + np.einsum("njt,jt->nj", friction(test.motion.speeds), values))
        for test in tests
    ])  # fmt: skip


def _with_friction(model: Any, test: Test, friction: Callable[[Array], Array]) -> tuple[Array, Array, Array]:
    """Torques that the bodies need and those that were sent (nrow x njoint), and columns of `friction` (nrow x njoint x
    nterm).
    """
    predicted, sent = test.pair(mujoco_torques(model, test.motion))
    columns = [test.pair(each)[0] for each in np.moveaxis(friction(test.motion.speeds), -1, 0)]
    return predicted, sent, np.stack(columns, axis=-1)


def rivals(
    models: dict[str, LinearModel], learned: Sequence[Log], tests: Sequence[Test]
) -> dict[str, tuple[str, Missed]]:
    """Of each model's terms the filter and weights of least squares that are best on the logs that are predicted."""
    best = {}
    for terms, model in models.items():
        candidates = dict(tuned(model, learned, CUTOFFS))
        pairs: dict[str, list[tuple[Array, Array]]] = {name: [] for name in candidates}
        for test in tests:
            part = prepared(model, test.motion)
            for name, values in candidates.items():
                pairs[name].append(test.pair(part.predicted(values)))
        errors = {name: missed(each) for name, each in pairs.items()}
        best[terms] = min(errors.items(), key=lambda each: each[1].relative)
    return best


def compared(
    machine: str, run: str, result: Any, place: Path, bodies: Mapping[str, Any], classic: LinearModel, logs: Logs
) -> Iterator[Table | Line | dict[str, Any]]:
    """How well a result of metaid's predicts logs that it has not seen, beside nominal bodies with fitted friction and
    least squares: a table, lines, and of each file the error that it printed.

    Args:
        machine: its name.
        run: what was learned or left out.
        result: of metaid's.
        place: where its files are written.
        bodies: nominal ones, by what they are called.
        classic: the terms of least squares.
        logs: that are learned, and those that are predicted, of joints.
    """
    runs, tests = logs[0], [read_test(log) for log in logs[1]]
    found: dict[str, Missed] = {}
    for ending in (".py", ".xml"):
        path = place / f"{machine}{ending}"
        result.model.write(path)
        found[f"metaid, {ending}"] = file_error(path, tests)
        yield {"run": run} | printed_and_measured(result, path, runs)
    for name, model in bodies.items():
        found[f"{name} and fitted friction"] = nominal_error(model, [read_test(log) for log in runs], tests)
    how, least = rivals({"": classic}, runs, tests)[""]
    found |= {TUNED: least} | recipes(classic, runs, tests)
    ours, said = found["metaid, .py"].relative, result.summary["held_out"]["torque"]["relative"]
    title = f"{machine}, torque at {YARDSTICK} Hz, {run}: {result.verdict.word}, said {said:.1%}; {how}"
    yield Table(title, [row_of(name, each) for name, each in found.items()])
    yield Line(f"{machine}: .py beside tuned least squares, {run}", ours / least.relative, MOST_BESIDE)
    yield Line(f"{machine}: error that is said beside it, {run}", said / ours, LEAST_OF_MEASURED, at_least=True)


@dataclass(frozen=True)
class Turn:
    """What is predicted, and the logs that are learned for it: as metaid is `given` them, and as readings of joints."""

    name: str
    given: Sequence[Any]
    learned: Sequence[Log]
    test: Test


@dataclass(frozen=True)
class InTurn:
    """Of all turns together what each model missed, the errors that were printed of files, the verdicts, and which
    least squares were best.
    """

    found: Mapping[str, Missed]
    printed: Sequence[dict[str, Any]]
    words: Sequence[str]
    best: Sequence[str]

    @property
    def beside(self) -> float:
        """The error of metaid's `.py` as a share of that of tuned least squares."""
        return self.found["metaid, .py"].relative / self.found[TUNED].relative

    def told(self, machine: str, how: str, most: float = MOST_BESIDE) -> Iterator[Table | Line]:
        """Tables and lines.

        Args:
            machine: its name.
            how: what was held out.
            most: that the `.py` may miss, as a share of what tuned least squares do.
        """
        title = f"{machine}, torque at {YARDSTICK} Hz, {how}: {', '.join(self.words)}; best {'; '.join(self.best)}"
        yield Table(title, [row_of(name, each) for name, each in self.found.items()])
        yield Table(f"{machine}, errors that are printed", list(self.printed))
        yield printed_line(machine, self.printed)
        yield Line(f"{machine}: .py beside tuned least squares", self.beside, most)


def arm_and_terms(nominal: Path, gravity: Sequence[float] | None = None) -> tuple[Any, LinearModel]:
    """A `nominal` arm as MuJoCo has it, and the terms of least squares, in `gravity` (m/s²), or its own."""
    plain, arm = mujoco.MjModel.from_xml_path(str(nominal)), load_plant(nominal)
    assert isinstance(arm, ArmPlant)
    tree = arm.tree
    if gravity is not None:
        plain.opt.gravity[:] = gravity
        tree = replace(tree, gravity=np.array(gravity))
    return plain, arm_model(tree).with_friction(CLASSIC).with_still(np.full(tree.njoint, STILL))


def in_turn(
    turns: Sequence[Turn], nominal: Path, place: Path, bodies: tuple[str, Any], classic: LinearModel, **asked: Any
) -> InTurn:
    """How well each of several logs, or parts of one, is predicted by what is learned of the others.

    Args:
        turns: one for each.
        nominal: what metaid is given as such.
        place: where its files are written.
        bodies: nominal ones beside which friction is fitted, after what they are called.
        classic: the terms of least squares.
        asked: of metaid, beside that.
    """
    parts: dict[str, list[Missed]] = {}
    printed, words, best = [], [], []
    for turn in turns:
        result = metaid.estimate(turn.given, nominal, **asked)
        words.append(result.verdict.word)
        each: dict[str, Missed] = {}
        for ending in (".py", ".xml"):
            path = place / f"{nominal.stem}_{turn.name}{ending}"
            result.model.write(path)
            each[f"metaid, {ending}"] = file_error(path, [turn.test])
            printed.append({"predicted": turn.name} | printed_and_measured(result, path, turn.learned))
        name, model = bodies
        each[name] = nominal_error(model, [read_test(log) for log in turn.learned], [turn.test])
        how, each[TUNED] = rivals({"": classic}, turn.learned, [turn.test])[""]
        best.append(how)
        for own, missing in (each | recipes(classic, turn.learned, [turn.test])).items():
            parts.setdefault(own, []).append(missing)
    return InTurn({name: summed(each) for name, each in parts.items()}, printed, words, best)


def row_of(name: str, found: Missed) -> dict[str, str]:
    joints = {f"joint {joint}": f"{share:.1%}" for joint, share in enumerate(found.by_joint, 1)}
    return {"model": name, "all": f"{found.relative:.2%}"} | joints


def recipes(model: LinearModel, learned: Sequence[Log], tests: Sequence[Test]) -> dict[str, Missed]:
    """Of figaroh's recipe, plain and weighted."""
    found = {}
    for weigh in WEIGHTS[:2]:
        values = recipe(model, learned, weigh)
        pairs = [test.pair(prepared(model, test.motion).predicted(values)) for test in tests]
        found[f"figaroh's recipe{', weighted' if weigh else ''}"] = missed(pairs)
    return found


def summed(parts: Sequence[Missed]) -> Missed:
    """What was missed of several parts together."""
    return Missed(np.sum([part.squares for part in parts], axis=0), np.sum([part.whole for part in parts], axis=0))
