"""Facts that a log may have wrong, joint by joint: each is tried, and named with the option that mends it.

Torques with a turned sign or in another unit, an encoder whose zero is off by a quarter turn, motors that turn with two
joints and nobody said so, a base that hangs or leans. A fact is named where, mended, the possible model explains far
more of the torques. Nothing is mended here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.recorded.equations import Equations, Part, equations_of
from metaid.recorded.estimate import RecordedEstimate
from metaid.recorded.linear_model import LinearModel, arm_model
from metaid.recorded.log import Record
from metaid.recorded.possible import Possible
from metaid.recorded.smoothed import Smoothed

FEWEST, MOST = 60, 150  # windows of a check, of all logs
NAMED = 0.75  # of the torque that the model leaves unexplained: a fact that leaves less is named
SELDOM = 0.5  # the same of zeros and of gravity, which many other faults look like
WRONG = 0.08  # of the torque, that must be unexplained for a fact to be looked for
UNIT = 5.0  # a scale of a joint's torques that is farther from the others' is another unit
QUARTERS = (0.5 * np.pi, -0.5 * np.pi, np.pi)
BLIND = 0.5  # an error of the nominal robot above which its scales say nothing


@dataclass(frozen=True)
class Fact:
    """Something that looks wrong: the `option` that mends it, a sentence without a full stop, and what is left of the
    unexplained torque with it.
    """

    text: str
    option: str
    left: float


@dataclass(frozen=True)
class _Check:
    """Windows of the logs that a fact is tried on."""

    equations: Equations
    fastest: Array

    def left(self, equations: Equations) -> float:
        """The share of the torque that a possible model leaves unexplained."""
        solution, rows, _ = equations.solved
        possible = Possible(equations.model, equations.scale, self.fastest)
        values = possible.closest(solution.values, solution.precision).values
        missed, whole = 0.0, 0.0
        weight = 1.0 / np.maximum(np.mean([(each**2).mean(axis=(0, 1)) for each in equations.torques], axis=0), 1e-300)
        for own, torques in zip(rows, equations.torques, strict=True):
            left = torques - own[..., : len(values)] @ values
            missed += float((left**2 * weight).sum())
            whole += float((torques**2 * weight).sum())
        return float(np.sqrt(missed / max(whole, 1e-300)))

    def with_torques(self, factors: Array) -> Equations:
        parts = [replace(part, record=part.record.with_torques(part.record.torques * factors)) for part in self._parts]
        return replace(self.equations, parts=tuple(parts))

    def with_angles(self, offsets: Array) -> Equations:
        """The same with angles that are shifted (njoint)."""
        parts = [
            Part(
                part.log,
                part.record,
                replace(part.windows, coordinates=part.windows.coordinates + offsets),
                part.smoothed,
            )
            for part in self._parts
        ]
        return replace(self.equations, parts=tuple(parts))

    def with_model(self, model: LinearModel) -> Equations:
        parts = [Part(part.log, part.record, part.windows, part.smoothed) for part in self._parts]
        return replace(self.equations, parts=tuple(parts), model=model)

    @property
    def _parts(self) -> tuple[Part, ...]:
        return self.equations.parts


def facts_of(records: Sequence[Record], found: RecordedEstimate) -> tuple[Fact, ...]:
    """What looks wrong in logs, the most telling first; of one joint one thing."""
    dead = [
        f"every torque of joint {name} is 0"
        for joint, name in enumerate(found.model.joints)
        if not any(record.torques[:, joint].any() for record in records)
    ]
    if dead:
        return tuple(Fact(text, "", 0.0) for text in dead)
    equations = _thinned(records, found.logs, found)
    if equations is None:
        return ()
    check = _Check(equations, found.fastest)
    usual = check.left(equations)
    units = list(_units(found, check))
    if usual < WRONG and not units:
        return ()
    tried = [
        Fact(text, option, check.left(other) / max(usual, 1e-300)) for text, option, other in _suspected(found, check)
    ]
    worth = [fact for fact in tried if fact.left < (SELDOM if fact.option.startswith(("--zero", "--grav")) else NAMED)]
    worth.sort(key=lambda fact: fact.left)
    telling = [fact for fact in worth if fact.left < worth[0].left * 1.15][:2]
    return (*units, *(telling if usual >= WRONG else ()))


def _thinned(records: Sequence[Record], logs: Sequence[Smoothed], found: RecordedEstimate) -> Equations | None:
    """Equations of few windows with the plainest friction; None where there are too few."""
    model = found.model.with_friction(("viscous", "coulomb", "offset"))
    for span, power in ((0.2, 6), (0.3, 8), (0.1, 5), (0.5, 10)):
        every = equations_of(records, logs, model, span, power)
        if every is None:
            continue
        stride = max(1, every.nwindow // MOST)
        parts = []
        for part in every.parts:
            windows = part.windows.thinned(4)
            kept = slice(None, None, min(stride, max(1, len(windows) // 3)))
            parts.append(
                Part(
                    part.log,
                    part.record,
                    replace(
                        windows,
                        middles=windows.middles[kept],
                        coordinates=windows.coordinates[kept] + found.zeros[part.log],
                        speeds=windows.speeds[kept],
                        accelerations=windows.accelerations[kept],
                    ),
                    part.smoothed,
                )
            )
        return replace(every, parts=tuple(parts), scale=found.scale, delay=found.delay)
    return None


def _suspected(found: RecordedEstimate, check: _Check) -> Iterator[tuple[str, str, Equations]]:
    """What may be wrong, the option that mends it, and the equations that it would make."""
    model = check.equations.model
    n, names = model.njoint, model.joints
    one = np.eye(n)
    turned = "has the opposite sign"
    for joint in range(n):
        option = f"--scale {names[joint]}=-1"
        yield (
            f"the torque of joint {names[joint]} {turned}: {option}",
            option,
            check.with_torques(1.0 - 2.0 * one[joint]),
        )
    if n > 1:
        yield (
            "the torques of all joints have the opposite sign: --scale all=-1",
            "--scale all=-1",
            check.with_torques(-np.ones(n)),
        )
    for joint in range(n):
        for shift in QUARTERS if not model.slides[joint] else ():
            option = f"--zero {names[joint]}={shift:.4f}"
            yield (
                f"the zero of joint {names[joint]} is off by {np.degrees(shift):.0f}°: {option}",
                option,
                check.with_angles(shift * one[joint]),
            )
    for joint in range(1, n):
        pair = (joint - 1, joint)
        if pair not in model.coupled and not model.slides[list(pair)].any():
            option = f"--couple {joint},{joint + 1}"
            yield (
                f"a motor turns with joints {names[joint - 1]} and {names[joint]} together: {option}",
                option,
                check.with_model(model.with_coupled((*model.coupled, pair))),
            )
    if not isinstance(model.source, tuple):
        tree = model.source.nominal
        size = float(np.linalg.norm(tree.gravity)) or 9.81
        for axis in (*np.eye(3), *-np.eye(3)):
            direction = size * axis
            if np.allclose(direction, tree.gravity):
                continue
            other = arm_model(replace(tree, gravity=direction), model.friction, model.coupled).with_still(model.still)
            option = "--gravity " + ",".join(f"{each + 0.0:g}" for each in direction)
            yield f"gravity points elsewhere in the frame of the base: {option}", option, check.with_model(other)


def _units(found: RecordedEstimate, check: _Check) -> Iterator[Fact]:
    """Joints whose torques are so many times what the nominal bodies need that they are in another unit than those of
    the others.
    """
    equations = check.equations
    model, n = equations.model, equations.model.njoint
    if n < 2:
        return
    scales = []
    for joint in range(n):
        rows = np.concatenate([own[:, :, joint].reshape(-1, own.shape[-1]) for own in equations.solved[1]])
        sent = np.concatenate([torques[:, :, joint].ravel() for torques in equations.torques])
        columns = [rows[:, : model.nbody] @ (equations.scale * model.nominal)]
        columns += [rows[:, model.column(term, joint)] for term in ("viscous", "coulomb", "offset")]
        stacked = np.stack(columns, axis=1)
        size = np.sqrt((stacked**2).sum(axis=0))
        if not size[0] > 0.0:
            scales.append(np.nan)
            continue
        solved = np.linalg.lstsq(stacked / np.where(size > 0.0, size, 1.0), sent, rcond=1e-10)[0]
        share = abs(solved[0]) / max(float(np.linalg.norm(sent)), 1e-300)
        scales.append(abs(solved[0]) / size[0] if share > 0.5 else np.nan)
    known = np.array(scales)
    if np.isfinite(known).sum() < 2:
        return
    for joint in np.flatnonzero(np.isfinite(known)).tolist():
        others = np.delete(known, joint)
        middle = float(np.nanmedian(others))
        ratio = float(known[joint] / middle) if middle > 0.0 else 1.0
        if not 1.0 / UNIT < ratio < UNIT:
            guess = next((each for each in (1000.0, 0.001) if 0.4 < ratio / each < 2.5), None)
            unit = {1000.0: "mN m", 0.001: "kN m"}.get(guess or 0.0, "a motor current or another unit")
            factor = f"{1.0 / (guess or ratio):.3g}"
            option = f"--scale {model.joints[joint]}={factor}"
            yield Fact(
                f"the torque of joint {model.joints[joint]} is {ratio:.3g} times what the others' scale would make it: "
                f"{unit}? {option}",
                option,
                0.0,
            )
