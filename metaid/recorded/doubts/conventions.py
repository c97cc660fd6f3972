"""What a log may have wrong, and the equations that it would make: conventions that people have.

Torques with a turned sign, an encoder whose zero is off by a quarter turn, joints that count the other way or stand in
another order, angles that are read against the base, motors that turn with two joints and nobody said so, a base that
hangs or leans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from metaid.models import Array
from metaid.recorded.absolute import MOTOR, Absolute, absolute_joints, absolute_of
from metaid.recorded.doubts.scales import scales_of, torque_scale
from metaid.recorded.given import ALL, Advice, Given, Option, told
from metaid.recorded.weak_form.equations import Equations
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.nominal import arm_like
from metaid.recorded.weak_form.possible import Possible
from metaid.recorded.weak_form.windows import LogWindows

NAMED = 0.75  # of the torque that the model leaves unexplained: a fact that leaves less is named
WRONG = 0.08  # of the torque, that must be unexplained for a fact to be looked for
LOST = 0.3  # of the torque: where less is unexplained, the unit is known, and no two things are wrong at once
SIGNS = (Option("scale", ALL, -1.0),)  # all torques turned
QUARTERS = (0.5 * np.pi, -0.5 * np.pi, np.pi)


@dataclass(frozen=True)
class Check:
    """Windows of the logs that a fact is tried on: their `equations`, and how the logs `measured` the robot. The arm
    where gravity points elsewhere is kept by its option.
    """

    equations: Equations
    measured: Absolute
    leaning: dict[Option, LinearModel] = field(default_factory=dict, repr=False, compare=False)

    @property
    def free(self) -> Array:
        """The share of its torque that the free fit leaves unexplained in each joint (njoint)."""
        return self._unexplained(self.equations.solution.values)

    def left(self, usual: Array | None = None, of_a_zero: bool = False) -> Array:
        """The same of a possible model; of the free fit, which leaves less, where this is not far below the `usual`
        (njoint).
        """
        free = self.free
        if usual is not None and improvement(free, usual, of_a_zero) >= NAMED:
            return free
        return self._unexplained(Possible(self.equations).refined(self.equations.solution).values)

    def _unexplained(self, values: Array) -> Array:
        model = self.equations.model
        missed, whole = np.zeros(model.njoint), np.zeros(model.njoint)
        every = zip(self.equations.parts, self.equations.left(values), self.equations.torques, strict=True)
        for part, left, torques in every:
            missed += model.trusted_alone((left**2).sum(axis=(0, 1)))
            whole += part.whole(model, values[: model.nbody], torques).sum(axis=(0, 1))
        return np.asarray(np.sqrt(missed / np.maximum(whole, 1e-300)), dtype=np.float64)

    def with_scale(self) -> Check:
        """The same with the scale of all torques that the equations ask for."""
        return replace(self, equations=replace(self.equations, scale=torque_scale(self.equations)))

    def with_torques(self, factors: Array) -> Check:
        """The same with logged torques that are multiplied (njoint)."""
        own = self.measured
        return self._mended(torques=lambda sent: own.torques_of_joints(own.logged_torques(sent) * factors))

    def with_angles(self, offsets: Array) -> Check:
        """The same with logged angles that are shifted (njoint)."""
        shift = self.measured.of_joints(offsets)
        return self._mended(windows=lambda own: own.shifted(shift))

    def with_logged(self, turned: Array) -> Check:
        """The same of logs with signs or places of joints that are `turned` (njoint x njoint, orthogonal)."""
        own = self.measured
        other = replace(own, angles=turned @ own.angles, motors=turned @ own.motors)
        return replace(self.with_measured(other), measured=own)

    def with_measured(self, other: Absolute) -> Check:
        """The same of logs that measure the robot in an `other` way, motors that stand on the base with no friction of
        their own: more unknowns would speak for them.
        """
        before = self.measured
        mended = self._mended(
            windows=lambda own: own.mapped(lambda each: other.of_joints(before.logged(each))),
            torques=lambda sent: other.torques_of_joints(before.logged_torques(sent)),
        )
        return replace(mended, measured=other)

    def with_model(self, model: LinearModel) -> Check:
        """The same of another robot."""
        return replace(self, equations=self.equations.with_model(model))

    def _mended(
        self,
        windows: Callable[[LogWindows], LogWindows] = lambda own: own,
        torques: Callable[[Array], Array] = lambda sent: sent,
    ) -> Check:
        """The same with other `windows`, and other `torques` of the joints (nrow x njoint)."""
        parts = []
        for part in self.equations.parts:
            record = part.smoothed.record
            own = replace(part.smoothed, record=record.with_torques(torques(record.torques)))
            parts.append(replace(windows(part), smoothed=own))
        return replace(self, equations=replace(self.equations, parts=tuple(parts)))


@dataclass(frozen=True)
class Fact:
    """What looks wrong: a sentence without a full stop, with the options that mend it, or else with others."""

    advice: Advice

    @property
    def options(self) -> tuple[Option, ...]:
        """Those that mend it; none where none does."""
        return next((each for each in self.advice if not isinstance(each, str)), ())

    @property
    def option(self) -> str:
        """The same as text."""
        return told((self.options,))

    @property
    def text(self) -> str:
        """The sentence."""
        return told(self.advice)

    def beside(self, given: Given) -> Fact:
        """The same with options that hold beside what was `given`."""
        return replace(self, advice=given.beside(self.advice))


class Suspected(NamedTuple):
    """Something that may be wrong, in words, the `options` that mend it, the `check` of logs that are mended, and what
    is `left` of the unexplained torque then, where that is known.
    """

    text: str
    options: tuple[Option, ...]
    check: Check
    left: float = np.nan

    @property
    def of(self) -> tuple[str, str]:
        """What is wrong then: two that are of the same are one or the other."""
        return self.options[0].of

    @property
    def fact(self) -> Fact:
        return Fact((f"{self.text}: ", self.options))


def told_apart(alike: Sequence[Suspected]) -> list[Suspected]:
    """Those that explain `alike`, the most telling first, without those of the same thing that another explains as
    well: where nominal bodies need the opposite of what more joints carry, bodies are found that are upside down. What
    that does not tell is said as one or the other.
    """
    kept: list[Suspected] = []
    shares = [opposed(each.check) for each in alike]
    for each, share in zip(alike, shares, strict=True):
        if share == min(other for same, other in zip(alike, shares, strict=True) if same.of == each.of):
            is_other = any(other.of == each.of for other in kept)
            kept.append(each._replace(text=f"or {each.text}") if is_other else each)
    return kept


def opposed(check: Check) -> float:
    """The share of joints whose nominal bodies need the opposite of what they carry; 0 where none tells."""
    carried = scales_of(check.equations).by_weight
    known = carried[np.isfinite(carried)]
    return float((known < 0.0).mean()) if len(known) else 0.0


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


def suspected(check: Check) -> Iterator[Suspected]:
    """All that may be wrong in logs."""
    model = check.equations.model
    n, names = model.njoint, model.joints
    one, named = np.eye(n), not all(name.isdigit() for name in names)
    driven = np.flatnonzero(~(model.untrusted | model.passive)).tolist()
    for joint in driven:
        text = f"the torque of joint {names[joint]} has the opposite sign"
        yield Suspected(text, (Option("scale", names[joint], -1.0),), check.with_torques(1.0 - 2.0 * one[joint]))
    if len(driven) > 1:
        text = "the torques of all joints have the opposite sign"
        yield Suspected(text, SIGNS, check.with_torques(-np.ones(n)))
    moving = np.flatnonzero(~check.equations.held)
    for joint in moving[int(model.is_pendulum) :].tolist() if n > 1 else ():  # a pendulum's mirror image moves alike
        text = f"joint {names[joint]} counts the other way"
        yield Suspected(text, (Option("reversed", names[joint]),), check.with_logged(one - 2.0 * np.diag(one[joint])))
    orders = {tuple(names[::-1]): "from the last on"} | ({tuple(sorted(names)): "by the alphabet"} if named else {})
    for order, how in orders.items():
        if order != tuple(names):
            logged = one[[names.index(name) for name in order]]
            option = Option("order", ",".join(order))
            yield Suspected(f"the log has the joints {how}", (option,), check.with_logged(logged))
    for joint in range(moving.max(initial=-1) + 1):  # beyond the last that moves all is one body
        for shift in QUARTERS if not model.slides[joint] else ():
            text = f"the zero of joint {names[joint]} is off by {np.degrees(shift):.0f}°"
            yield Suspected(text, (Option("zero", names[joint], shift),), check.with_angles(shift * one[joint]))
    for shift in QUARTERS if n > 1 and model.is_pendulum else ():
        text = f"the zeros of all joints are off by {np.degrees(shift):.0f}°"
        yield Suspected(text, (Option("zero", ALL, shift),), check.with_angles(shift * np.ones(n)))
    yield from _read_against_the_base(check)
    for joint in range(1, n):
        pair = (joint - 1, joint)
        if pair not in model.sliding.coupled and not model.slides[list(pair)].any():
            text = f"a motor turns with joints {names[joint - 1]} and {names[joint]} together"
            coupled = model.with_coupled((*model.sliding.coupled, pair))
            yield Suspected(text, (Option("couple", f"{joint},{joint + 1}"),), check.with_model(coupled))
    if model.prior is not None:
        tree = model.tree
        size = float(np.linalg.norm(tree.gravity)) or 9.81
        for axis in (*np.eye(3), *-np.eye(3)):
            direction = size * axis
            if np.allclose(direction, tree.gravity):
                continue
            option = gravity_option(direction)
            if option not in check.leaning:
                check.leaning[option] = arm_like(model, replace(tree, gravity=direction))
            other = check.leaning[option].with_coupled(model.sliding.coupled)
            text = "gravity points elsewhere in the frame of the base"
            yield Suspected(text, (option,), check.with_model(other))


def gravity_option(gravity: Array) -> Option:
    """That gravity is another in the frame of the base (3), in m/s²."""
    return Option("gravity", ",".join(f"{each + 0.0:g}" for each in gravity))


def _read_against_the_base(check: Check) -> Iterator[Suspected]:
    """The same of joints whose angles may be those of a link against the base: each of them, and all."""
    model = check.equations.model
    behind = absolute_joints(model) if check.measured.is_plain else []
    for several in (*((name,) for name in behind), *([tuple(behind)] if len(behind) > 1 else [])):
        for how, where in (("", ""), (MOTOR, ", where its motor stands")):
            own = [f"{name}{how}" for name in several]
            text = f"the angle of joint {' and '.join(several)} is read against the base{where}"
            options = tuple(Option("absolute", each) for each in own)
            yield Suspected(text, options, check.with_measured(absolute_of(model, own)))
