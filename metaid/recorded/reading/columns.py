"""Which column of a log is what: by its name as people spell it, or as the user says.

Understood are a word for a kind (`angle`, `pos`, `q`; `speed`, `vel`, `dq`; `torque`, `effort`, `tau`) beside a joint's
name or number, before or after it: `angle_1`, `q1`, `/joint_states/elbow/position`, `actual_q_0`. One joint alone needs
neither. Where the robot's joints have no names, those of the log count, in the order of its columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError, first_of, joints_of
from metaid.recorded.reading import units
from metaid.recorded.reading.carts import of_cart
from metaid.recorded.reading.formats import Table
from metaid.recorded.reading.mapping import KINDS, called, words_of
from metaid.recorded.reading.readings import Repair
from metaid.recorded.reading.times import CLOCKS, SPELLED, counts_rows, numeric_times
from metaid.recorded.reading.words import (
    ALSO_ACCELERATIONS,
    CHANGES,
    INPUTS,
    KIND_OF,
    LAST_NUMBER,
    OTHERS,
    PLAIN,
    VOLTAGES,
    WISHED,
    WORDS,
    tokens_of,
)

BESIDE_CLOCKS = ("header", "field", "host", "ros", "unix", "data", "log")
MOST_NAMED = 3  # words of columns that may be torques, too


@dataclass(frozen=True, eq=False)
class Understood:
    """A table of which it is known which columns are what.

    Attributes:
        table: the table.
        times: the column of the times, or those of s and ns.
        unit: of the times, where its name says so.
        kinds: of angle, speed and torque the columns, joint by joint; none where no joint has one, and an empty name of
            a joint without a torque.
        notes: what was understood that is not spelled as metaid does.
        factors: by what the readings of columns are multiplied that are in units of their own.
        others: words of columns that may be torques, too, and are not read.
        radians: columns of angles that are surely in radians: the user says so, or they are converted.
    """

    table: Table
    times: tuple[str, ...]
    unit: str | None
    kinds: dict[str, tuple[str, ...]]
    notes: tuple[Repair, ...]
    factors: dict[str, float]
    others: tuple[str, ...] = ()
    radians: frozenset[str] = frozenset()

    def load(self) -> pd.DataFrame:
        """All columns that are read."""
        wanted = dict.fromkeys([*self.times, *(each for own in self.kinds.values() for each in own if each)])
        return self.table.load(list(wanted))

    def on_rate(self, rate: float) -> Understood:
        """The same with so many rows a second.  Raises RecordError where it has times that do not count rows."""
        if not self.times:
            return replace(self, table=self.table.on_rate(rate), times=("time",), unit="s")
        frame = self.table.load(list(self.times))
        if not counts_rows(numeric_times([frame[each] for each in self.times])):
            raise RecordError(
                f"{self.table.name}: has times, in '{self.times[0]}' (allowed: --rate for logs without, or whose times "
                "count rows)"
            )
        note = Repair("times", len(frame), f"{self.times[0]} counts rows: {rate:g} of them a second")
        return replace(self, table=self.table.on_rate(rate, self.times[0]), unit="s", notes=(*self.notes, note))


@dataclass(frozen=True)
class _Meant:
    """What a column's name means: a kind of a joint, by its place from 0 on or where it `is_numbered` by its number,
    whether it is only what was wished, and whether the user has said so.
    """

    column: str
    kind: str
    joint: int
    is_numbered: bool
    is_wished: bool
    is_said: bool


def understood(
    table: Table, joints: Sequence[str], slides: NDArray[np.bool_], mapping: Mapping[str, str]
) -> Understood:
    """Which columns of a table are what.

    Args:
        table: the table.
        joints: the names of the robot's joints.
        slides: which of them (njoint) are slides.
        mapping: what the user says that columns mean, as `called` has it, or how the log calls a joint.

    Raises:
        RecordError: some joints have a column of a kind and others have none, or a name means nothing.
    """
    said_joints, said_columns = _joints_said(table, joints, mapping)
    names, said_units = called(table.columns, said_joints, said_columns, table.name)
    own_joints = _joints_called(names.values(), said_joints)
    meant = list(_meanings(names, own_joints))
    unsaid = [column for column, name in names.items() if name == column]
    there = {each.kind for each in meant if not each.is_wished}
    by_unit = [replace(each, is_said=False) for each in _meanings(_by_unit(unsaid), own_joints)]
    meant += [each for each in by_unit if each.kind not in there]
    cart = {} if any(each.kind == "angle" for each in meant) else of_cart(unsaid, slides)
    if cart:
        names |= cart
        meant = list(_meanings(names, own_joints))
    kinds, base = {}, None
    for kind in KINDS:
        kinds[kind], own = _of_kind(table, kind, meant, own_joints)
        base = own if own is not None else base
    is_current = not kinds["torque"]
    if is_current:
        kinds["torque"], _ = _of_kind(table, "current", meant, own_joints)
    times, unit = _clock(names)
    unit = SPELLED.get(said_units.get("".join(times[:1]), ""), unit)
    factors: dict[str, float] = {}
    others = _others(table, kinds["torque"], names, joints)
    notes = _notes(times, kinds, names, joints, base)
    if cart:
        which = dict(zip(kinds["angle"], joints, strict=True))
        text = ", ".join(f"{column} is of {joint}" for column, joint in which.items())
        notes += (Repair("columns", len(cart), text),)
    if others:
        text = f"{first_of(others, MOST_NAMED)} may be torques, too: --map {others[0]}=torque reads them instead"
        notes += (Repair("columns", len(others), text),)
    for kind, own_columns in kinds.items():
        measured = "current" if is_current and kind == "torque" else kind
        own_units = {
            column: said_units.get(column) or units.unit_in(column, measured, joint)
            for column, joint in zip(own_columns, joints, strict=False)
            if column
        }
        own_factors, told = units.converted(own_units, measured)
        factors, notes = factors | own_factors, notes + told
    if is_current and kinds["torque"]:
        said = {each for column in kinds["torque"] for each in tokens_of(column) if each in WORDS["current"]}
        known = {"motor voltages": VOLTAGES, "inputs": INPUTS}
        what = next((what for what, words in known.items() if said and said <= {*words}), "motor currents")
        text = f"{what} stand for torques: every number is in their unit, until --scale says N m in one of it"
        notes += (Repair("currents", len(kinds["torque"]), text),)
    idle = [joint for joint, column in zip(joints, kinds["torque"], strict=False) if not column]
    if idle:
        text = f"no torque of {joints_of(idle)}: it is 0, as without a motor"
        notes += (Repair("torque", len(idle), text),)
    radians = frozenset(column for column in kinds["angle"] if column in said_units or column in factors)
    return Understood(table, times, unit, kinds, (*table.notes, *notes), factors, others, radians)


def angles_named(table: Table, joints: Sequence[str]) -> dict[str, str]:
    """The columns of a table that are angles of joints which they name, by the joint: some of all these `joints`."""
    meant = _meanings({column: column for column in table.columns}, joints)
    angles = [each for each in meant if each.kind == "angle" and not each.is_wished]
    return {joints[each.joint]: each.column for each in reversed(angles) if not each.is_numbered}


def driver_alone(columns: Iterable[str]) -> str | None:
    """The one of a log's `columns` that is a torque, a current or what a motor is sent, of any joint; else None."""
    drivers = [each for each in columns if {"torque", "current"} & {KIND_OF.get(word) for word in tokens_of(each)}]
    return drivers[0] if len(drivers) == 1 else None


def _others(table: Table, torques: Sequence[str], names: Mapping[str, str], joints: Sequence[str]) -> tuple[str, ...]:
    """Words of columns that may be torques, too, beside those that are read and that no user has named."""
    if not torques or any(names[column] != column for column in torques if column):
        return ()
    others = []
    for word, columns in words_of(table.columns, joints).items():
        tokens = set(tokens_of(word))
        is_torque = bool({"torque", "current"} & {KIND_OF.get(each) for each in tokens})
        if is_torque and not (OTHERS | WISHED) & tokens and len(columns) >= len(joints) and not {*torques} & {*columns}:
            others.append(word)
    return tuple(others)


def _joints_said(table: Table, joints: Sequence[str], mapping: Mapping[str, str]) -> tuple[list[str], dict[str, str]]:
    """How the user says that the log calls the joints (njoint), and what else he says.  Raises RecordError where no
    column has such a name.
    """
    said, others = list(joints), {}
    for own, meaning in mapping.items():
        number = meaning if meaning.isdecimal() and meaning not in joints else ""
        if meaning not in joints and not 1 <= int(number or 0) <= len(joints):
            others[own] = meaning
        elif any(_without(tokens_of(column), tokens_of(own)) for column in table.columns):
            said[int(number) - 1 if number else joints.index(meaning)] = own
        else:
            raise RecordError(f"{table.name}: map {own}={meaning}: no column has '{own}' beside another word")
    return said, others


def _joints_called(names: Iterable[str], joints: Sequence[str]) -> Sequence[str]:
    """What the log calls the joints: the words beside `angle`, one for each joint. Where the robot has but numbers for
    them, in the order of the columns, if torques have them, too; else those that are part of their names, as `elbow`
    of `left_elbow_joint`, where no column has a whole one.
    """
    names = list(names)
    own = joints_beside("angle", names)
    if all(joint.isdigit() for joint in joints):
        others = joints_beside("torque", names) or joints_beside("current", names)
        return own if len(own) == len(joints) and set(own) == set(others) else joints
    if any(_joint_in(tokens_of(name), joints)[0] is not None for name in names):
        return joints
    parts = [[word for word in own if {*tokens_of(word)} <= {*tokens_of(joint)}] for joint in joints]
    words = {part[0] for part in parts if len(part) == 1}
    return [part[0] for part in parts] if len(words) == len(joints) else joints


def joints_beside(kind: str, names: Iterable[str]) -> list[str]:
    """The words without a number that stand beside that of a `kind` in columns' names, each once, in their order."""
    words: list[str] = []
    for name in names:
        kinds = [each for each in tokens_of(name) if each in KIND_OF]
        joint = "_".join(each for each in tokens_of(name) if each not in {*kinds, *PLAIN, *WISHED})
        is_one = len(kinds) == 1 and joint and not re.search(r"\d", joint) and not OTHERS & set(tokens_of(name))
        if is_one and KIND_OF[kinds[0]] == kind:
            words.append(joint)
    return list(dict.fromkeys(words))


def _without(tokens: list[str], own: list[str]) -> list[str]:
    """A column's words without those of `own`, where these stand in it one after the other; else none."""
    at = next((at for at in range(len(tokens) - len(own) + 1) if tokens[at : at + len(own)] == own), None)
    return [] if at is None else tokens[:at] + tokens[at + len(own) :]


def _meanings(names: Mapping[str, str], joints: Sequence[str]) -> Iterator[_Meant]:
    """What columns mean by their own names, or by the user's for them; none where that is nothing that is read."""
    for column, name in names.items():
        joint, rest = _joint_in(tokens_of(name), joints)
        if sum(map(rest.count, CHANGES)) == 1 and any(KIND_OF.get(each) == "angle" for each in rest):
            rest = ["speed" if KIND_OF.get(each) == "angle" else each for each in rest if each not in CHANGES]
        kinds = [each for each in rest if each in KIND_OF]
        numbers = [int(each) for each in rest if each.isdigit()] or ([1] if len(joints) == 1 else [])
        words = {each for each in rest if not each.isdigit()} - {*kinds} - PLAIN - WISHED
        if len(kinds) != 1 or OTHERS & {*rest} or (joint is None and (words or not numbers)):
            continue
        place = numbers[-1] if joint is None else joint
        yield _Meant(column, KIND_OF[kinds[0]], place, joint is None, bool(WISHED & {*rest}), name != column)


def _by_unit(columns: Iterable[str]) -> dict[str, str]:
    """What columns are called that say what they are by a unit alone, as `elbow_deg` or `J1 [Nm]`: by its kind."""
    called = {}
    for column in columns:
        tokens = re.findall(r"[a-zµ]+|\d+", units.spaced(column))
        length = next((count for count in (2, 1) if tuple(tokens[-count:]) in units.KIND_OF), 0)
        if length:
            called[column] = " ".join((units.KIND_OF[tuple(tokens[-length:])], *tokens[:-length]))
    return called


def _joint_in(tokens: list[str], joints: Sequence[str]) -> tuple[int | None, list[str]]:
    """The joint whose name is in a column's, from 0 on, and what stands beside it; None where there is none. A name
    that is a number alone is taken as one.
    """
    best, rest = None, tokens
    for joint, name in enumerate(joints):
        own = tokens_of(name)
        if all(each.isdigit() for each in own):
            continue
        left = _without(tokens, own)
        if len(left) < len(rest) and any(each in KIND_OF for each in left):
            best, rest = joint, left
    return best, rest


def _of_kind(
    table: Table, kind: str, meant: Sequence[_Meant], joints: Sequence[str]
) -> tuple[tuple[str, ...], int | None]:
    """The columns of one kind, joint by joint, and the number of the first joint where they are numbered; measured
    ones, else of torques those that were sent. A joint may have no torque.
    """
    njoint = len(joints)
    for is_wished in (False, True) if kind in ("torque", "current") else (False,):
        every = [each for each in meant if each.kind == kind and (each.is_wished == is_wished or each.is_said)]
        own = [each for each in every if not each.is_said]
        own.sort(key=lambda each: bool(ALSO_ACCELERATIONS & {*tokens_of(each.column)}))
        said = {each.joint - each.is_numbered: each.column for each in every if each.is_said}
        named = {each.joint: each.column for each in reversed(own) if not each.is_numbered}
        numbered = {each.joint: each.column for each in reversed(own) if each.is_numbered}
        base = 0 if 0 in numbered else 1
        base = next(iter(numbered)) if njoint == len(numbered) == 1 else base  # whatever number one joint alone has
        by_number = {number - base: column for number, column in numbered.items()}
        inside = {*by_number} & {*range(njoint)}
        is_numbered = len(said) < njoint and bool(by_number) and len(named) < max(len(inside), 1)
        found = (by_number if is_numbered else named) | said
        if not found:
            continue
        if is_numbered and max(by_number) >= njoint:
            column = by_number[max(by_number)]
            first, last, by_name = (_of_joint(column, each) for each in (base, base + njoint - 1, joints[0]))
            by_name = "" if joints[0].isdigit() else f", or named as {by_name}"
            first = first if njoint == 1 else f"{first} to {last}"
            raise RecordError(
                f"{table.name}: column '{column}' is of no joint (allowed: {first}{by_name}; or --map of all)"
            )
        missing = [joint for joint in range(njoint) if joint not in found]
        if missing and kind in ("angle", "speed"):
            own_name = str(missing[0] + 1) if is_numbered else joints[missing[0]]
            example = next(iter(found.values()))
            there = ",".join(name for joint, name in enumerate(joints) if joint in found)
            raise RecordError(
                f"{table.name}: no column '{kind}_{own_name}' beside '{example}' (allowed: of all {njoint} joints"
                f"{'' if joints[0].isdigit() else f', or --joints {there}'})"
            )
        return tuple(found.get(joint, "") for joint in range(njoint)), base if is_numbered else None
    return (), None


def _of_joint(column: str, joint: int | str) -> str:
    """What a numbered column would be called of another joint."""
    return LAST_NUMBER.sub(lambda _: str(joint), column)


def _clock(names: Mapping[str, str]) -> tuple[tuple[str, ...], str | None]:
    """The column of the times, or those of s and ns, and the unit where the name says it."""
    split: dict[str, str] = {}
    clocks: dict[str, tuple[int, str | None]] = {}
    for column, name in names.items():
        inside = re.findall(r"[\[(]\s*([a-zµ]+)\s*[\])]", name)
        tokens = tokens_of(name)
        said = [SPELLED[each] for each in (*inside, *tokens[1:]) if each in SPELLED]
        unit = said[-1] if said else None
        words = [each for each in tokens if each in CLOCKS]
        if unit in ("s", "ns") and "stamp" in tokens:
            split.setdefault(unit, column)
        if words and {*tokens} <= {*CLOCKS, *SPELLED, *BESIDE_CLOCKS}:
            rank = 0 if name == "time" else 1 if "stamp" in tokens else 2 + CLOCKS.index(words[0])
            clocks[column] = rank, unit
    best = min(clocks, key=lambda column: clocks[column][0], default=None)
    if len(split) == 2 and (best is None or clocks[best][0] > 0):
        return (split["s"], split["ns"]), "ns"
    return ((), None) if best is None else ((best,), clocks[best][1])


def _notes(
    times: Sequence[str],
    kinds: Mapping[str, Sequence[str]],
    names: Mapping[str, str],
    joints: Sequence[str],
    base: int | None,
) -> tuple[Repair, ...]:
    """One line on columns that are not spelled as metaid does."""
    numbers = [str(i + 1) for i in range(len(joints))]
    said = []
    for kind, every in kinds.items():
        own = [column for column in every if column]
        usual = [[kind], *([f"{kind}_{name}" for name in each] for each in (numbers, joints))]
        if own and not any({names[column] for column in own} <= {*each} for each in usual):
            said.append(f"{own[0]} to {own[-1]} are {kind}s" if len(own) > 1 else f"{own[0]} is the {kind}")
    if times and names[times[0]] != "time":
        said.append(f"{' and '.join(times)} {'is' if len(times) == 1 else 'are'} the time")
    if not said:
        return ()
    count = sum(map(len, kinds.values()))
    more = " (they count from 0)" if base == 0 else ""
    return (Repair("columns", count, "; ".join(said) + more),)
