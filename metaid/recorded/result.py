"""All of it in one call: from logs and a nominal robot to what the logs say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from metaid.errors import BranchesError, RecordError, unknown
from metaid.files import shipped_logs
from metaid.plant import ArmPlant, MujocoPlant, load_plant
from metaid.recorded.absolute import Absolute, absolute_of
from metaid.recorded.branches import joints_named
from metaid.recorded.choosing import Choices, usual_still
from metaid.recorded.doubts.checks import facts_of
from metaid.recorded.doubts.odd_logs import beyond_learned
from metaid.recorded.estimating import MANY_STARTS, RecordedEstimate, estimate_records
from metaid.recorded.gains import Gains, Payload, drive_gains
from metaid.recorded.given import Given
from metaid.recorded.held_out import HeldOut, Yardstick
from metaid.recorded.reading.log import Intake, every_run, short_names
from metaid.recorded.reading.readings import LogRun
from metaid.recorded.reading.stretches import Stretches, without
from metaid.recorded.telling.judging import judge_records
from metaid.recorded.telling.told import RecordedResult
from metaid.recorded.weak_form.folds import Fold, Span
from metaid.recorded.weak_form.linear_model import TERMS, LinearModel
from metaid.recorded.weak_form.nominal import model_of
from metaid.recorded.weak_form.smoothed import Smoothed, smoothed, smoothed_beside

Log = str | Path | pd.DataFrame


def estimate(
    logs: Sequence[Log] | Log,
    nominal: str | Path | Mapping[str, Any],
    *,
    joints: Sequence[str] | None = None,
    validate: Sequence[Log] | Log = (),
    payloads: Sequence[Payload] = (),
    law: str | Path | None = None,
    friction: Sequence[str] | None = None,
    coupled: Sequence[tuple[int, int]] = (),
    scale: Mapping[str, float] | None = None,
    zero: Mapping[str, float] | None = None,
    gravity: Sequence[float] | None = None,
    window: float | None = None,
    delay: float | None = None,
    zeros: bool | None = None,
    columns: Mapping[str, str] | None = None,
    topic: str | None = None,
    rate: float | None = None,
    untrusted: Sequence[str] = (),
    reversed: Sequence[str] = (),
    order: Sequence[str] | None = None,
    absolute: Sequence[str] = (),
    leave_out: Stretches | None = None,
) -> RecordedResult:
    """What logs say of a robot: its `verdict` with the frame of `lumps`, its `summary`, and its `model` to write.

    What trials of a study say is `metaid.study(NAME).estimate`.

    Args:
        logs: paths or frames, each a run of its own, or the name of shipped ones, `double-pendulum`.
        nominal: the nominal robot: the name of a shipped plant, or the path of a plant file, an MJCF or a URDF;
            or a dict with the keys of a plant file.
        joints: of an MJCF or URDF those that move; the others are held. By default all; of one with branches those
            that the columns of the logs name.
        validate: a log, or several, that nothing is fitted to.
        payloads: logs with a payload, which tell the gains of the drives; torques are multiplied with these.
        law: the plant that the torques compensated, where the logs have none.
        friction: the terms of every joint, of viscous, coulomb, root, offset, load, spring, and hysteresis or bent; by
            default those that predict best what is left out.
        coupled: pairs of joints, from 1 on, whose motors are coupled.
        scale: by joint, or of `all`, what the logged torques are multiplied with.
        zero: by joint, in rad, what is added to the logged angles.
        gravity: in the frame of the base, in m/s²; by default the robot's own.
        window: length of the windows, in s; by default what predicts best what is left out, as the next two are.
        delay: by which torques act later than they are logged, in s.
        zeros: whether encoders have zeros of their own in each log.
        columns: what columns of the logs mean that are not understood: `{"encoder a": "angle_1"}`; how they call a
            joint, as `{"shldr": "shoulder"}`; of logs without names of columns what all mean in their order,
            `{"column": "time,angle,speed,torque"}`.
        topic: of joint states in bags that have several.
        rate: rows a second of logs without times, or whose times count rows.
        untrusted: joints that move, but whose torques are not used.
        reversed: joints whose angles, speeds and torques count the other way.
        order: all joints as the logs have them one after the other; by default from the base on, or by their names.
        absolute: joints whose angles are of the link against the base; `elbow:motor` where its torque is, too.
        leave_out: by log, stretches from a time to another, in s: `{"log.csv": [(10.9, 11.4)]}`.

    Raises:
        RecordError: a log cannot be used, or does not fit the robot.
        PlantError: a plant cannot be used.

    Example:
        >>> metaid.estimate("double-pendulum", "double-pendulum").verdict.word
        'approximate'
    """
    plant, chosen_joints = _plant_of(nominal, joints, _with_shipped(logs), topic)
    for term in friction or ():
        if term not in TERMS:
            raise RecordError(f"friction: {unknown('term', term, TERMS)}")
    choices = Choices(window, delay, None if friction is None else tuple(friction), zeros)
    pairs = [_joints(pair, plant.njoint) for pair in coupled] or plant.couples
    model = model_of(plant, gravity)
    measured = absolute_of(model, absolute)
    model = model.with_coupled(tuple(dict.fromkeys((*pairs, *measured.coupled))))
    model = replace(model, untrusted=_untrusted(untrusted, model))
    many = [log for log in _with_shipped(logs) if not any(_is_same(log, each.log) for each in payloads)]
    if not many:
        raise RecordError(f"no log{' without a payload' if payloads else ''} (allowed: one or more)")
    _refuse_beside(measured, {"law": law is not None, "payload": bool(payloads), "untrusted": bool(untrusted)})
    given = Given(
        model.joints,
        _by_joint("scale", scale or {}, model, 1.0),
        _by_joint("zero", zero or {}, model, 0.0),
        _by_joint("reversed", dict.fromkeys(reversed, -1.0), model, 1.0),
    )
    places = _places(order, model.joints)
    read_as = np.argsort(places)
    slides, untrusted_read, endless = (each[read_as] for each in (model.slides, model.untrusted, model.endless))
    held_out = _with_shipped(validate)
    every = *many, *held_out, *(each.log for each in payloads)
    named = short_names(str(log) for log in every if not isinstance(log, pd.DataFrame))
    if rate is not None and not 0.0 < rate < np.inf:
        raise RecordError(f"rate: {rate:g} rows a second (allowed: above 0)")
    needed = law is None, law is None and model.is_pendulum, rate, named
    intake = Intake(model.joints, slides, columns or {}, topic, untrusted_read, endless, *needed)

    def read(every: Sequence[Log], first: int) -> tuple[LogRun, ...]:
        found = tuple(record.mapped(lambda read: read[:, places]) for record in every_run(intake, every, first))
        if law is not None:
            compensated = load_plant(law)
            if compensated.njoint != plant.njoint:
                raise RecordError(
                    f"law {law} is of {compensated.njoint} joints (allowed: {plant.njoint}, as {plant.name} has)"
                )
            found = tuple(_compensated(record, compensated) for record in found)
        return tuple(measured.record(given.meant(record)) for record in found)

    records, others = read(many, 1), read(held_out, len(many) + 1)
    _refuse_some_without(records + others)
    after = len(many) + len(held_out) + 1
    loaded = [(record, each) for number, each in enumerate(payloads, after) for record in read([each.log], number)]
    records, others = without(leave_out or {}, records, others)
    with threadpool_limits(1):  # matrices this small are slower on several
        gains = _gains(records, loaded, model) if loaded else None
        if gains is not None:
            records, others = (
                tuple(each.with_torques(each.torques * gains.values) for each in every) for every in (records, others)
            )
        found = estimate_records(records, model, choices, gains)
        facts = tuple(fact.beside(given) for fact in facts_of(found, measured))
        verdict = judge_records(found, [fact.text for fact in facts], given)
        heard = [smoothed_beside(found.logs, other, found.model) for other in others]
        validation = tuple((own, _validated(found, own)) for own in heard)
    repairs = (*chosen_joints, *plant.repairs, *_turned(found), *beyond_learned(found, validation))
    return RecordedResult(plant.name, found, verdict, facts, validation, repairs)


def _turned(found: RecordedEstimate) -> Iterator[str]:
    """A sentence on the zeros that all logs share."""
    if found.turned is not None:
        said = [
            f"{joint} {1e3 * zero:+.3g}" for joint, zero in zip(found.model.joints, found.turned, strict=True) if zero
        ]
        yield f"zeros of encoders that all logs share are in the frames of what is written: {', '.join(said)} mrad"


def _plant_of(
    nominal: str | Path | Mapping[str, Any], joints: Sequence[str] | None, logs: Sequence[Log], topic: str | None
) -> tuple[MujocoPlant | ArmPlant, tuple[str, ...]]:
    """The nominal robot. Where its branches leave open which joints move, those of which the `logs` are; and a sentence
    that says so.  Raises as `estimate`.
    """
    try:
        return load_plant(nominal, joints), ()
    except BranchesError as met:
        named = joints_named(met, logs, topic) if joints is None else ()
        if not named:
            raise
    text = f"joints that logs name move, the others are held: {', '.join(named)} (--joints A,B of those that move)"
    return load_plant(nominal, named), (text,)


def _places(order: Sequence[str] | None, joints: Sequence[str]) -> list[int]:
    """Where each of the robot's joints stands in logs (njoint), from 0 on.  Raises RecordError where an `order` is not
    of all joints.
    """
    order = joints if order is None else order
    if sorted(order) != sorted(joints):
        raise RecordError(f"order {','.join(order)} (allowed: each once of {','.join(joints)})")
    return [list(order).index(joint) for joint in joints]


def _refuse_beside(measured: Absolute, given: Mapping[str, bool]) -> None:
    """Raises RecordError where what was `given` is of joints, and logs are `measured` otherwise."""
    for name, is_given in given.items():
        if is_given and not (measured.is_plain if name == "law" else measured.is_driven_by_joints):
            what = "absolute" if name == "law" else "a motor that stands on the base"
            raise RecordError(f"{name}: beside {what} (allowed: one of the two)")


def _refuse_some_without(records: Sequence[LogRun]) -> None:
    """Raises RecordError where some logs have torques, and others have none."""
    free = [record.name for record in records if not record.torques.any()]
    if len(free) not in (0, len(records)):
        raise RecordError(
            f"{free[0]}: every torque is 0, and not in other logs (allowed: torques in all logs, or in none)"
        )


def _compensated(record: LogRun, plant: Any) -> LogRun:
    """A log with the torques of the law that compensated a `plant` at what was read.  Raises RecordError where the log
    has no speeds.
    """
    if record.speeds is None:
        raise RecordError(f"{record.name}: no column 'speed_1', which the law is made of (allowed: a log with speeds)")
    return record.with_torques(plant.compensation(record.angles, record.speeds))


def _is_same(log: Log, other: Log) -> bool:
    """Whether two logs are one: the same frame, or the same path."""
    if isinstance(log, pd.DataFrame) or isinstance(other, pd.DataFrame):
        return log is other
    return Path(log) == Path(other)


def _gains(unloaded: Sequence[LogRun], loaded: Sequence[tuple[LogRun, Payload]], model: LinearModel) -> Gains:
    if model.prior is None:
        raise RecordError("payload: the robot is a planar chain of a plant file (allowed: an MJCF or URDF)")
    free, carrying = [smoothed(each) for each in unloaded], [(smoothed(each), payload) for each, payload in loaded]
    still = usual_still([*free, *(own for own, _ in carrying)])
    return drive_gains(free, carrying, model.with_still(still))


def _with_shipped(logs: Sequence[Log] | Log) -> list[Log]:
    """One log or several, with all runs in place of the name that they ship under."""
    every: list[Log] = []
    for log in [logs] if isinstance(logs, str | Path | pd.DataFrame) else logs:
        every += (not isinstance(log, pd.DataFrame) and shipped_logs(str(log))) or [log]
    return every


def _validated(found: RecordedEstimate, own: Smoothed) -> HeldOut:
    """How well a log is predicted that nothing was fitted to, its zeros from its first half."""
    yardstick = Yardstick((own,), (Fold((Span(0),)),))
    solution = replace(found.equations.solution, values=found.values, zeros=np.zeros((1, found.model.njoint)))
    return yardstick.judged(found.equations, [solution], MANY_STARTS)


def _by_joint(what: str, given: Mapping[str, float], model: LinearModel, usual: float) -> Any:
    """One number a joint (njoint) from those that were given by name, by number, or of `all`."""
    numbers = np.full(model.njoint, usual)
    for name, number in given.items():
        allowed = dict.fromkeys(("all", *model.places))
        if name not in allowed:
            raise RecordError(f"{what}: {unknown('joint', name, allowed)}")
        numbers[slice(None) if name == "all" else model.places[name]] = number
    return numbers


def _untrusted(names: Sequence[str], model: LinearModel) -> Any:
    """Which joints (njoint) were named, not all of them."""
    which = _by_joint("untrusted", dict.fromkeys(names, 1.0), model, 0.0) > 0.0
    if which.all():
        raise RecordError(f"untrusted: every joint (allowed: some of {', '.join(model.joints)})")
    return which


def _joints(pair: tuple[int, int], njoint: int) -> tuple[int, int]:
    """A pair of joints, from 0 on.  Raises RecordError where there are no such two."""
    one, other = sorted(pair)
    if not 1 <= one < other <= njoint:
        raise RecordError(f"coupled joints {pair[0]},{pair[1]} (allowed: two of 1 to {njoint})")
    return one - 1, other - 1
