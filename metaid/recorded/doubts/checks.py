"""Facts that a log may have wrong: each is tried, and named with the option that mends it.

A fact is named where, mended, the possible model explains far more of the torques; two at once where none does.
Nothing is mended here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.recorded.absolute import Absolute, absolute_of
from metaid.recorded.doubts.conventions import (
    LOST,
    NAMED,
    SIGNS,
    WRONG,
    Check,
    Suspected,
    improvement,
    suspected,
    together,
)
from metaid.recorded.doubts.falling import falling_torques, named_as_falling
from metaid.recorded.doubts.odd_logs import odd_log
from metaid.recorded.doubts.scales import UNIT, scales_of
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.reading.log import Record
from metaid.recorded.weak_form.equations import Equations, Part, equations_of
from metaid.recorded.weak_form.smoothed import Smoothed

MOST = 80  # windows of a check, of all logs
SAME = 0.005  # of the torque: less that is unexplained tells nothing
SELDOM = 0.5  # as NAMED of gravity, which many other faults look like
BOTH = 0.7  # of what one leaves: as NAMED of two at once, for there are many pairs
FIRST, TRIED = 12, 16  # facts of which others are tried beside, and pairs that are tried on a possible model
THOUSANDS = (1000.0, 0.001)
DRIVEN = 0.1  # of the terms that cancel in a joint without a motor, that it has beside them
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


def facts_of(records: Sequence[Record], found: RecordedEstimate, measured: Absolute | None = None) -> tuple[Fact, ...]:
    """What looks wrong in logs, the most telling first; of one joint one thing.

    Args:
        records: the logs, with what joints have of them.
        found: what they say.
        measured: how they measure the robot; by default its joints.
    """
    odd = odd_log(found) if found.held_out.relative > WRONG else None
    if odd is not None:
        return (Fact(odd, "", 0.0),)
    dead = found.model.passive & ~found.equations.held & (found.held_out.by_joint > DRIVEN)
    driven = tuple(_driven(name) for name in np.array(found.model.joints)[dead].tolist())
    equations = _thinned(records, found.logs, found)
    return driven if equations is None else (*_named(equations, found, measured), *driven)


def _named(equations: Equations, found: RecordedEstimate, measured: Absolute | None) -> tuple[Fact, ...]:
    """What looks wrong, beside joints that seem to have a motor.

    Args:
        equations: few windows of the logs.
        found: what they say.
        measured: how they measure the robot; by default its joints.
    """
    check = Check(equations, found.fastest, absolute_of(found.model) if measured is None else measured)
    usual = check.left()
    falling = falling_torques(check, usual)
    if falling.any():
        text, option = named_as_falling(check, falling)
        model = equations.model.with_untrusted(equations.model.untrusted | falling)
        return (Fact(text, option, 0.0), *_named(replace(equations, model=model), found, measured))
    units = _units(check)
    turned = _turned(found)
    if usual.max() < WRONG and not units:
        return turned
    every = list(suspected(check))
    worth, mended = [], {}
    for each in every:
        # It may be what is wrong that looks like another unit of all torques.
        other = each.check.with_scale() if found.scale != 1.0 or usual.max() > LOST else each.check
        is_zero = each.option.startswith("--zero")
        left = other.left(usual, is_zero)
        if improvement(left, usual, is_zero) < (SELDOM if each.option.startswith("--gravity") else NAMED):
            worth.append(_fact([each], together(left, usual)))
            mended[each.option] = other
    worth.sort(key=lambda fact: fact.left)
    least = worth[0].left if worth else 1.0
    both = _both(every, usual, BOTH * least) if least * usual.max() > LOST else None
    if both is not None:
        return (both,)
    if any(fact.option in (SIGNS, *(each.option for each in turned)) for fact in worth):
        turned = ()  # which of the two it is, is known
    if worth and units:
        factors = np.array([units[joint][0] if joint in units else 1.0 for joint in range(len(usual))])
        if together(check.with_torques(factors).left(), usual) <= worth[0].left:
            worth = []  # which another unit makes seem so
        else:  # of joints that are still in another unit once what tells most is mended
            units = _units(mended[worth[0].option])
    telling = [fact for fact in worth if fact.left < worth[0].left * 1.15][:2]
    return (*(fact for _, fact in units.values()), *turned, *(telling if usual.max() >= WRONG else ()))


def _driven(name: str) -> Fact:
    """That a joint whose torques are all 0 does not move as one without a motor does."""
    option = f"--untrusted {name}"
    text = f"every torque of joint {name} is 0, but a motor seems to move it: {option} fits nothing to its torque"
    return Fact(text, option, 0.0)


def _turned(found: RecordedEstimate) -> tuple[Fact, ...]:
    """That gravity points the other way, or that all torques are turned, where the nominal bodies need the opposite of
    what every joint carries: bodies that carry it may predict as well, or nearly so. Of a pendulum the torque that
    accelerates it tells that it was zeroed where it hangs.
    """
    prior, is_pendulum = found.model.prior, found.model.is_pendulum
    known, moved = (each[np.isfinite(each)] for each in (found.carried, found.accelerated))
    if len(known) < (1 if is_pendulum else 2) or (known > 0.0).any():
        return ()
    if is_pendulum:
        name = found.model.joints[0]
        text, option = f"the zero of joint {name} is off by 180°", f"--zero {name}={np.pi:.4f}"
        return (Fact(f"{text}: {option}", option, 0.0),) if len(moved) and (moved > 0.0).all() else ()
    assert prior is not None
    option = "--gravity " + ",".join(f"{0.0 - each:g}" for each in prior.nominal.gravity)
    text = (
        "the nominal bodies need the opposite of what every joint carries: gravity points the other way in the frame "
        f"of the base, {option}, or the torques of all joints have the opposite sign, {SIGNS}"
    )
    return (Fact(text, option, 0.0),)


def _fact(mended: Sequence[Suspected], left: float) -> Fact:
    option = " ".join(each.option for each in mended)
    return Fact(f"{', and '.join(each.text for each in mended)}: {option}", option, left)


def _both(every: Sequence[Suspected], usual: Array, below: float) -> Fact | None:
    """The two of all that may be wrong that leave least at once, whatever the unit of all torques is then; None where
    none leaves less than `below`, in a possible model or in the free fit, which leaves less.

    Args:
        every: each by itself.
        usual: what a possible model leaves unexplained of each joint (njoint) as it is.
        below: of the unexplained torque.
    """
    first = sorted(every, key=lambda each: together(each.check.free, usual))[:FIRST]
    pairs = {
        frozenset((one.option, other.option)): (one, other)
        for one in first
        for other in suspected(one.check)
        if one.of != other.of
    }
    best = sorted(pairs.values(), key=lambda pair: together(pair[1].check.free, usual))[:TRIED]
    scaled = [(pair, pair[1].check.with_scale()) for pair in best]
    tried = [
        _fact(pair, together(check.left(), usual)) for pair, check in scaled if together(check.free, usual) < below
    ]
    return min((fact for fact in tried if fact.left < below), key=lambda fact: fact.left, default=None)


def _thinned(records: Sequence[Record], logs: Sequence[Smoothed], found: RecordedEstimate) -> Equations | None:
    """Equations of few windows with the plainest friction; None where there are too few. Nothing is held against the
    torque of a joint that is held.
    """
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
        trusted = model.with_untrusted(model.untrusted | every.held)
        return replace(every, model=trusted, parts=tuple(parts), scale=found.scale, delay=found.delay)
    return None


def _units(check: Check) -> dict[int, tuple[float, Fact]]:
    """Joints, from 0 on, whose torques are so many times what the nominal bodies need that they are in another unit
    than those of the others, each with the factor that mends it; 1 where the other joints say that it is the bodies.
    """
    units: dict[int, tuple[float, Fact]] = {}
    names = check.equations.model.joints
    ratios = _ratios(check.equations)
    factors = np.ones(len(names))
    for joint, ratio in ratios.items():
        factors[joint] = next((1.0 / unit for unit in THOUSANDS if 0.3 < ratio / unit < 3.0), 1.0 / ratio)
    for joint, ratio in ratios.items():
        factor = float(factors[joint])
        if _is_confirmed(check, joint, factors):
            text = (
                f"joint {names[joint]} needs {ratio:.3g} times the torque that the nominal bodies do, as other joints"
            )
            units[joint] = 1.0, Fact(f"{text} confirm: these bodies are wrong, not its unit", "", 0.0)
            continue
        unit = {0.001: "mN m", 1000.0: "kN m"}.get(factor, "a motor current or another unit")
        option = f"--scale {names[joint]}={factor:.3g}"
        text = f"the torque of joint {names[joint]} is {ratio:.3g} times what the others' scale would make it: {unit}?"
        units[joint] = factor, Fact(f"{text} {option}", option, 0.0)
    return units


def _is_confirmed(check: Check, joint: int, factors: Array) -> bool:
    """Whether any joint is explained far worse once the torque of one is multiplied as well: bodies that one joint
    carries are moved by the others, too.

    Args:
        check: windows of the logs.
        joint: whose unit is in doubt, from 0 on.
        factors: of all torques that are in doubt (njoint).
    """
    mended = check.with_torques(factors).free
    kept = check.with_torques(np.where(np.arange(len(factors)) == joint, 1.0, factors)).free
    return bool((NAMED * mended > np.maximum(kept, SAME)).any())


def _ratios(equations: Equations) -> dict[int, float]:
    """Joints, from 0 on, whose torques are so many times what the others' scale would make them."""
    ratios = {}
    signed = scales_of(equations).joined
    known = signed[np.isfinite(signed)]
    # A joint that needs the other sign than most is wrong in another way than by its unit.
    scales = np.where(signed * np.median(known) > 0.0, np.abs(signed), np.nan) if len(known) else signed
    middle = float(np.median(np.abs(known))) if len(known) > 2 else equations.scale
    for joint, scale in enumerate(scales.tolist()):
        if equations.model.untrusted[joint]:
            continue
        ratio = scale / middle if np.isfinite(scale) else _beyond_friction(equations, joint)
        if not 1.0 / UNIT < ratio < UNIT:
            ratios[joint] = ratio
    return ratios


def _beyond_friction(equations: Equations, joint: int) -> float:
    """By how much the torques of a joint whose bodies are hardly felt are larger than friction can make them, which may
    be some times what another joint is sent; 1 where they are not.
    """
    model = equations.model
    needed = [(own[..., : model.nbody] @ (equations.scale * model.nominal)) for own in equations.solved[1]]
    usual = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in needed], axis=0))
    sent = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in equations.torques], axis=0))
    most = FRICTION * max(float(usual[joint]), LIGHT * float(usual.max()))
    most = max(most, UNIT * float(np.delete(sent, joint).max(initial=0.0)))
    return float(sent[joint] / most) * UNIT if sent[joint] > most > 0.0 else 1.0
