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
from metaid.recorded.absolute import MOTOR, Absolute, absolute_joints, absolute_of
from metaid.recorded.doubts.scales import joint_scales, torque_scale
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.reading.log import Record
from metaid.recorded.weak_form.equations import Equations, Part, equations_of
from metaid.recorded.weak_form.linear_model import LinearModel, arm_model
from metaid.recorded.weak_form.possible import Possible
from metaid.recorded.weak_form.smoothed import Smoothed

MOST = 80  # windows of a check, of all logs
NAMED = 0.75  # of the torque that the model leaves unexplained: a fact that leaves less is named
SELDOM = 0.5  # the same of zeros and of gravity, which many other faults look like
WRONG = 0.08  # of the torque, that must be unexplained for a fact to be looked for
UNIT = 5.0  # a scale of a joint's torques that is farther from the others' is another unit
QUARTERS = (0.5 * np.pi, -0.5 * np.pi, np.pi)
THOUSANDS = (1000.0, 0.001)
FRICTION = 50.0  # times the torque of a joint's bodies that its friction may be
LIGHT = 0.02  # of the strongest joint's torque, for a joint that bodies hardly load


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
    measured: Absolute

    def left(self, equations: Equations, usual: Array | None = None, of_a_zero: bool = False) -> Array:
        """The share of its torque that a possible model leaves unexplained in each joint (njoint); that of the free
        fit, which leaves less, where this is not far below the `usual` (njoint).
        """
        solution, _, _ = equations.solved
        free = self._unexplained(equations, solution.values)
        if usual is not None and improvement(free, usual, of_a_zero) >= NAMED:
            return free
        possible = Possible(equations.model, equations.scale, self.fastest)
        return self._unexplained(equations, possible.closest(solution.values, solution.precision).values)

    @staticmethod
    def _unexplained(equations: Equations, values: Array) -> Array:
        rows = equations.solved[1]
        missed, whole = np.zeros(equations.model.njoint), np.zeros(equations.model.njoint)
        for own, torques in zip(rows, equations.torques, strict=True):
            left = torques - own[..., : len(values)] @ values
            missed += equations.model.trusted_alone((left**2).sum(axis=(0, 1)))
            whole += equations.model.trusted_alone((torques**2).sum(axis=(0, 1)))
        return np.asarray(np.sqrt(missed / np.maximum(whole, 1e-300)), dtype=np.float64)

    def with_torques(self, factors: Array) -> Equations:
        """The same with logged torques that are multiplied (njoint)."""
        parts = []
        for part in self._parts:
            torques = self.measured.torques_of_joints(self.measured.logged_torques(part.record.torques) * factors)
            parts.append(replace(part, record=part.record.with_torques(torques)))
        return replace(self.equations, parts=tuple(parts))

    def with_angles(self, offsets: Array) -> Equations:
        """The same with logged angles that are shifted (njoint)."""
        parts = []
        for part in self._parts:
            moved = part.windows.coordinates + self.measured.of_joints(offsets)
            parts.append(Part(part.log, part.record, replace(part.windows, coordinates=moved), part.smoothed))
        return replace(self.equations, parts=tuple(parts))

    def with_measured(self, other: Absolute) -> Equations:
        """The same of logs that measure the robot in an `other` way, motors that stand on the base with no friction of
        their own: more unknowns would speak for them.
        """
        parts, before = [], self.measured
        for part in self._parts:
            own = part.windows
            coordinates, speeds, accelerations = (
                other.of_joints(before.logged(each)) for each in (own.coordinates, own.speeds, own.accelerations)
            )
            windows = replace(own, coordinates=coordinates, speeds=speeds, accelerations=accelerations)
            torques = other.torques_of_joints(before.logged_torques(part.record.torques))
            parts.append(Part(part.log, part.record.with_torques(torques), windows, part.smoothed))
        return replace(self.equations, parts=tuple(parts))

    def with_model(self, model: LinearModel) -> Equations:
        parts = [Part(part.log, part.record, part.windows, part.smoothed) for part in self._parts]
        return replace(self.equations, parts=tuple(parts), model=model)

    @property
    def _parts(self) -> tuple[Part, ...]:
        return self.equations.parts


def together(left: Array, usual: Array) -> float:
    """What is left unexplained (njoint) as a share of the usual, of all joints together."""
    return float(np.linalg.norm(left) / max(float(np.linalg.norm(usual)), 1e-300))


def improvement(left: Array, usual: Array, of_a_zero: bool) -> float:
    """The same; of a wrong zero, which adds no unknowns, that of the joint that gains most, if all together do not
    lose.
    """
    share = together(left, usual)
    if not of_a_zero or share > 1.0:
        return share
    return min(share, float(np.where(usual >= WRONG, left / np.maximum(usual, WRONG), 1.0).min()))


def facts_of(records: Sequence[Record], found: RecordedEstimate, measured: Absolute | None = None) -> tuple[Fact, ...]:
    """What looks wrong in logs, the most telling first; of one joint one thing.

    Args:
        records: the logs, with what joints have of them.
        found: what they say.
        measured: how they measure the robot; by default its joints.
    """
    dead = [
        f"every torque of joint {name} is 0"
        for joint, name in enumerate(found.model.joints)
        if not (found.model.untrusted[joint] or any(record.torques[:, joint].any() for record in records))
    ]
    if dead:
        return tuple(Fact(text, "", 0.0) for text in dead)
    equations = _thinned(records, found.logs, found)
    if equations is None:
        return ()
    check = _Check(equations, found.fastest, absolute_of(found.model) if measured is None else measured)
    usual = check.left(equations)
    units = _units(check)
    if usual.max() < WRONG and not units:
        return ()
    worth, mended = [], {}
    for text, option, other in _suspected(found, check):
        if found.scale != 1.0:  # it may be what is wrong that looks like another unit of all torques
            other = replace(other, scale=torque_scale(other))
        is_zero = option.startswith("--zero")
        left = check.left(other, usual, is_zero)
        if improvement(left, usual, is_zero) < (SELDOM if option.startswith("--gravity") else NAMED):
            worth.append(Fact(text, option, together(left, usual)))
            mended[option] = other
    worth.sort(key=lambda fact: fact.left)
    if worth and units:
        factors = np.array([units[joint][0] if joint in units else 1.0 for joint in range(len(usual))])
        if together(check.left(check.with_torques(factors)), usual) <= worth[0].left:
            worth = []  # which another unit makes seem so
        else:  # of joints that are still in another unit once what tells most is mended
            units = _units(replace(check, equations=mended[worth[0].option]))
    telling = [fact for fact in worth if fact.left < worth[0].left * 1.15][:2]
    return (*(fact for _, fact in units.values()), *(telling if usual.max() >= WRONG else ()))


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
    yield from _read_against_the_base(check)
    for joint in range(1, n):
        pair = (joint - 1, joint)
        if pair not in model.sliding.coupled and not model.slides[list(pair)].any():
            option = f"--couple {joint},{joint + 1}"
            yield (
                f"a motor turns with joints {names[joint - 1]} and {names[joint]} together: {option}",
                option,
                check.with_model(model.with_coupled((*model.sliding.coupled, pair))),
            )
    if model.prior is not None:
        tree = model.prior.nominal
        size = float(np.linalg.norm(tree.gravity)) or 9.81
        for axis in (*np.eye(3), *-np.eye(3)):
            direction = size * axis
            if np.allclose(direction, tree.gravity):
                continue
            other = arm_model(replace(tree, gravity=direction), model.friction, model.sliding.coupled)
            option = "--gravity " + ",".join(f"{each + 0.0:g}" for each in direction)
            yield (
                f"gravity points elsewhere in the frame of the base: {option}",
                option,
                check.with_model(other.with_still(model.sliding.still)),
            )


def _read_against_the_base(check: _Check) -> Iterator[tuple[str, str, Equations]]:
    """The same of joints whose angles may be those of a link against the base: each of them, and all."""
    behind = absolute_joints(check.equations.model) if check.measured.is_plain else []
    for several in (*((name,) for name in behind), *([tuple(behind)] if len(behind) > 1 else [])):
        for how, where in (("", ""), (MOTOR, ", where its motor stands")):
            own = [f"{name}{how}" for name in several]
            option = " ".join(f"--absolute {each}" for each in own)
            yield (
                f"the angle of joint {' and '.join(several)} is read against the base{where}: {option}",
                option,
                check.with_measured(absolute_of(check.equations.model, own)),
            )


def _units(check: _Check) -> dict[int, tuple[float, Fact]]:
    """Joints, from 0 on, whose torques are so many times what the nominal bodies need that they are in another unit
    than those of the others, each with the factor that mends it.
    """
    units: dict[int, tuple[float, Fact]] = {}
    equations = check.equations
    names, signed = equations.model.joints, joint_scales(equations)
    known = signed[np.isfinite(signed)]
    # A joint that needs the other sign than most is wrong in another way than by its unit.
    scales = np.where(signed * np.median(known) > 0.0, np.abs(signed), np.nan) if len(known) else signed
    middle = float(np.median(np.abs(known))) if len(known) > 2 else equations.scale
    for joint, scale in enumerate(scales.tolist()):
        if equations.model.untrusted[joint]:
            continue
        ratio = scale / middle if np.isfinite(scale) else _beyond_friction(equations, joint)
        if 1.0 / UNIT < ratio < UNIT:
            continue
        factor = next((1.0 / unit for unit in THOUSANDS if 0.3 < ratio / unit < 3.0), 1.0 / ratio)
        unit = {0.001: "mN m", 1000.0: "kN m"}.get(factor, "a motor current or another unit")
        option = f"--scale {names[joint]}={factor:.3g}"
        text = f"the torque of joint {names[joint]} is {ratio:.3g} times what the others' scale would make it: {unit}?"
        units[joint] = factor, Fact(f"{text} {option}", option, 0.0)
    return units


def _beyond_friction(equations: Equations, joint: int) -> float:
    """By how much the torques of a joint whose bodies are hardly felt are larger than friction can make them; 1 where
    they are not.
    """
    model = equations.model
    needed = [(own[..., : model.nbody] @ (equations.scale * model.nominal)) for own in equations.solved[1]]
    usual = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in needed], axis=0))
    sent = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in equations.torques], axis=0))
    most = FRICTION * max(float(usual[joint]), LIGHT * float(usual.max()))
    return float(sent[joint] / most) * UNIT if sent[joint] > most > 0.0 else 1.0
