"""Facts that a log may have wrong: each is tried, and named with the option that mends it.

A fact is named where, mended, the possible model explains far more of the torques; two at once where none does.
Nothing is mended here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from metaid.models import Array
from metaid.recorded.absolute import Absolute, absolute_of
from metaid.recorded.doubts.contacts import contacts
from metaid.recorded.doubts.conventions import (
    LOST,
    NAMED,
    SIGNS,
    WRONG,
    Check,
    Fact,
    Suspected,
    gravity_option,
    improvement,
    opposed,
    suspected,
    together,
    told_apart,
)
from metaid.recorded.doubts.falling import falling_torques, named_as_falling
from metaid.recorded.doubts.odd_logs import odd_log
from metaid.recorded.doubts.scales import BESIDE
from metaid.recorded.doubts.units import units_of
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.given import Option
from metaid.recorded.weak_form.equations import Equations, first_equations
from metaid.recorded.weak_form.normal import FAR_ZERO

MOST = 80  # windows of a check, of all logs
SELDOM = 0.5  # as NAMED of gravity, which many other faults look like
BOTH = 0.7  # of what one leaves: as NAMED of two at once, for there are many pairs
ALIKE = 1.15  # times what the most telling fact leaves: a fact that leaves less is told beside it
MOSTLY = 0.5  # of the joints that tell
FIRST, TRIED = 12, 16  # facts of which others are tried beside, and pairs that are tried on a possible model
DRIVEN = 0.1  # of the terms that cancel in a joint, that a motor leaves beside them where no log has a torque
ALONE_DRIVEN = 0.3  # the same of a joint that alone has none


def facts_of(found: RecordedEstimate, measured: Absolute | None = None) -> tuple[Fact, ...]:
    """What looks wrong in logs, the most telling first; of one joint one thing.

    Args:
        found: what logs say, with what joints have of them.
        measured: how they measure the robot; by default its joints.
    """
    odd = odd_log(found) if found.held_out.relative > WRONG else None
    if odd is not None:
        return (odd,)
    most = DRIVEN if found.model.is_free else ALONE_DRIVEN
    dead = found.model.passive & ~found.equations.held & (found.held_out.by_joint > most)
    driven = tuple(_driven(name, found.model.is_free) for name in found.model.named(dead))
    plain = first_equations(found.logs, found.model.with_friction(BESIDE))
    if plain is None:
        return driven
    check = _thinned(found, plain, absolute_of(found.model) if measured is None else measured)
    named = _confirmed(check, found)
    if found.model.is_free or not named:  # what else is wrong leaves as much of a joint without a motor
        named = *named, *driven
    contact = None if named else contacts(found, plain)
    return named if contact is None else (contact,)


def _confirmed(check: Check, found: RecordedEstimate) -> tuple[Fact, ...]:
    """The same, without what bodies that are a guess make seem so: it is not named where these are doubted."""
    named, doubt = _named(check, found), found.equations.doubt
    if not named or doubt == 1.0:
        return named
    doubting = replace(check, equations=replace(check.equations, doubt=doubt))
    doubted = {fact.options for fact in _named(doubting, found)}
    return tuple(fact for fact in named if fact.options in doubted)


def _named(check: Check, found: RecordedEstimate) -> tuple[Fact, ...]:
    """What looks wrong in few windows of the logs, beside joints that seem to have a motor."""
    usual = check.left()
    falling = falling_torques(check, usual)
    if falling.any():
        model = replace(check.equations.model, untrusted=check.equations.model.untrusted | falling)
        return (named_as_falling(check, falling), *_named(check.with_model(model), found))
    units = units_of(check)
    turned = _turned(found)
    if usual.max() < WRONG and not units:
        return turned
    every = [each for each in suspected(check) if each.check.equations.is_solved]
    worth = []
    for each in every:
        # It may be what is wrong that looks like another unit of all torques.
        other = each.check.with_scale() if found.scale != 1.0 or usual.max() > LOST else each.check
        name = each.options[0].name
        is_zero = name == "zero"
        left = other.left(usual, is_zero)
        if improvement(left, usual, is_zero) < (SELDOM if name == "gravity" else NAMED):
            worth.append(each._replace(check=other, left=together(left, usual)))
    worth.sort(key=lambda each: each.left)
    least = worth[0].left if worth else 1.0
    both = _both(every, usual, BOTH * least) if least * usual.max() > LOST else None
    if both is not None:
        return (both,)
    if any(each.options in (SIGNS, *(fact.options for fact in turned)) for each in worth):
        turned = ()  # which of the two it is, is known
    if worth and units:
        factors = np.array([units[joint][0] if joint in units else 1.0 for joint in range(len(usual))])
        if together(check.with_torques(factors).left(), usual) <= worth[0].left:
            worth = []  # which another unit makes seem so
        else:  # of joints that are still in another unit once what tells most is mended
            units = units_of(worth[0].check)
    alike = [each for each in worth if each.left < worth[0].left * ALIKE][:2] if usual.max() >= WRONG else []
    telling = told_apart(alike)
    if telling and telling[0].options[-1].number != np.pi and opposed(telling[0].check) < MOSTLY:
        turned = ()  # which what is mended made seem so: a half turn is as gravity that points the other way
    return (*(fact for _, fact in units.values()), *turned, *(each.fact for each in telling))


def _driven(name: str, is_free: bool) -> Fact:
    """That a joint whose torques are all 0 does not move as one without a motor does, where all are so or one has."""
    text = f"every torque of joint {name} is 0, but a motor seems to move it: "
    if is_free:
        return Fact((f"{text}name the columns of torques, with --map OWN=torque",))
    return Fact((text, (Option("untrusted", name),), " fits nothing to its torque"))


def _turned(found: RecordedEstimate) -> tuple[Fact, ...]:
    """That gravity points the other way, or that all torques are turned, where the nominal bodies need the opposite of
    what every joint carries: bodies that carry it may predict as well, or nearly so. Of a pendulum the torque that
    accelerates it tells that it was zeroed where it hangs.
    """
    is_pendulum = found.model.is_pendulum
    known, moved = (each[np.isfinite(each)] for each in (found.carried, found.accelerated))
    if len(known) < (1 if is_pendulum else 2) or (known > 0.0).any():
        return ()
    if is_pendulum:
        name = found.model.joints[0]
        option = Option("zero", name, np.pi)
        is_off = len(moved) and (moved > 0.0).all()
        return (Fact((f"the zero of joint {name} is off by 180°: ", (option,))),) if is_off else ()
    text = (
        "the nominal bodies need the opposite of what every joint carries: gravity points the other way in the frame "
        "of the base, "
    )
    option = gravity_option(-found.model.tree.gravity)
    return (Fact((text, (option,), ", or the torques of all joints have the opposite sign, ", SIGNS)),)


def _both(every: Sequence[Suspected], usual: Array, below: float) -> Fact | None:
    """The two of all that may be wrong that leave least at once, whatever the unit of all torques is then; None where
    none leaves less than a share `below` of the `usual` (njoint), in a possible model or in the free fit, which leaves
    less.
    """
    first = sorted(every, key=lambda each: together(each.check.free, usual))[:FIRST]
    pairs = {
        frozenset((one.options, other.options)): other._replace(
            text=f"{one.text}, and {other.text}", options=(*one.options, *other.options)
        )
        for one in first
        for other in suspected(one.check)
        if one.of != other.of
    }
    solved = [pair for pair in pairs.values() if pair.check.equations.is_solved]
    best = sorted(solved, key=lambda pair: together(pair.check.free, usual))[:TRIED]
    scaled = [pair._replace(check=pair.check.with_scale()) for pair in best]
    tried = [
        pair._replace(left=together(pair.check.left(), usual))
        for pair in scaled
        if together(pair.check.free, usual) < below
    ]
    least = min(tried, key=lambda each: each.left, default=None)
    return least.fact if least is not None and least.left < below else None


def _thinned(found: RecordedEstimate, every: Equations, measured: Absolute) -> Check:
    """Few of all windows of logs that are `measured` so. Nothing is held against the torque of a joint that is held."""
    # What is wrong moves the zeros that are fitted beside it, too.
    zeros = found.zeros if np.abs(found.zeros).max(initial=0.0) < FAR_ZERO else np.zeros_like(found.zeros)
    stride = max(1, every.nwindow // MOST)
    parts = []
    for part in every.parts:
        windows = part.thinned()
        few = windows.only(np.arange(0, len(windows), min(stride, max(1, len(windows) // 3))))
        parts.append(few.shifted(zeros[part.log]))
    trusted = replace(every.model, untrusted=every.model.untrusted | every.held)
    few_windows = replace(every, model=trusted, parts=tuple(parts), scale=found.scale, delay=found.delay)
    return Check(few_windows, measured)
