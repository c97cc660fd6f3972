"""What the user says that columns are: one by one, or all of a word at once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from metaid.errors import RecordError, unknown
from metaid.recorded.reading.units import SIZES
from metaid.recorded.reading.words import LAST_NUMBER

KINDS = ("angle", "speed", "torque")


def called(
    columns: Sequence[str], joints: Sequence[str], mapping: Mapping[str, str], log: str
) -> tuple[dict[str, str], dict[str, str]]:
    """Every column that may be read, with what it is called by the user, or by itself; and the units that he says.

    Args:
        columns: of the log.
        joints: the names of the robot's joints.
        mapping: what columns mean that the user names: `time`, or `angle_`, `speed_`, `torque_` with a joint, or one of
            these words alone for all columns that differ but in their joint; with a unit behind a colon. Or what all of
            a word mean in their order, as `time,angle,speed,-7,torque_1`: one time, of each joint an angle and a speed,
            seven that are not read, the torque of the first.
        log: its name, for messages.

    Raises:
        RecordError: there is no such column, meaning or unit.
    """
    numbers = [*(str(i + 1) for i in range(len(joints))), *joints]
    ours = {"time", *(f"{kind}_{joint}" for kind in KINDS for joint in numbers)}
    allowed = {*ours, *KINDS}
    names = {column: column for column in columns}
    units: dict[str, str] = {}
    said: set[str] = set()
    for own, meaning in _one_by_one(columns, joints, mapping, log, ours):
        if meaning.partition(":")[0] not in allowed and own.partition(":")[0] in allowed:
            own, meaning = meaning, own
        meaning, _, unit = meaning.partition(":")
        if meaning not in allowed:
            raise RecordError(f"{log}: map {own}: {unknown('meaning', meaning, sorted(allowed))}")
        means = _of_all(columns, joints, own, meaning) if meaning in KINDS else {own: meaning} if own in names else {}
        if not means:
            what, there = ("word", words_of(columns, joints)) if meaning in KINDS else ("column", columns)
            raise RecordError(f"{log}: map: {unknown(what, own, there)}")
        names |= means
        said |= {*means, *means.values()}
        if unit:
            sizes = SIZES[meaning.partition("_")[0]]
            if unit not in sizes:
                raise RecordError(f"{log}: map {own}: {unknown('unit', unit, sizes)}")
            units |= dict.fromkeys(means, unit)
    return {column: name for column, name in names.items() if column in said or name not in said}, units


def _one_by_one(
    columns: Sequence[str], joints: Sequence[str], mapping: Mapping[str, str], log: str, ours: set[str]
) -> Iterator[tuple[str, str]]:
    """A column or a word, and its meaning, one after the other, whatever several mean in their order, of what `called`
    is given; `ours` is what one column may mean.  Raises RecordError as it does.
    """
    for own, meaning in mapping.items():
        if "," not in meaning:
            yield own, meaning
            continue
        found = _with_word(columns, joints, own)
        if not found:
            raise RecordError(f"{log}: map: {unknown('word', own, words_of(columns, joints))}")
        wanted: list[str | None] = []
        for part in meaning.split(","):
            kind, colon, unit = part.strip().partition(":")
            if re.fullmatch(r"-\d+", kind):
                wanted += [None] * int(kind[1:])
            elif kind in ours or kind in KINDS:
                names = [kind] if kind in ours else [f"{kind}_{joint + 1}" for joint in range(len(joints))]
                wanted += [f"{name}{colon}{unit}" for name in names]
            else:
                every = ("time", *KINDS, f"torque_{joints[0]}", "-1", "-2", "…")
                raise RecordError(f"{log}: map {own}: {unknown('meaning', part, every)}")
        if len(wanted) != len(found):
            raise RecordError(
                f"{log}: map {own}: {meaning} are {len(wanted)} columns (allowed: all {len(found)}, in their order; "
                "-2 stands for two that are not read)"
            )
        yield from ((column, each) for column, each in zip(found, wanted, strict=True) if each is not None)


def words_of(columns: Iterable[str], joints: Sequence[str]) -> dict[str, dict[str, str]]:
    """What is left of columns' names without those of joints or numbers, and the columns of each such word, with the
    joint or number of each.
    """
    words: dict[str, tuple[str, dict[str, str]]] = {}
    for column in columns:
        for word, joint in _without_joint(column, joints):
            words.setdefault(_bare(word), (word, {}))[1][column] = joint
    return {word: found for word, found in words.values() if word}


def _of_all(columns: Sequence[str], joints: Sequence[str], word: str, kind: str) -> dict[str, str]:
    """What all columns mean that have a `word` beside a joint's name or number; one alone needs neither."""
    found = _with_word(columns, joints, word)
    alone = list(found) or [column for column in columns if column == word]
    if len(alone) == len(joints) == 1:
        return {alone[0]: f"{kind}_1"}  # whatever number it has
    base = 0 if "0" in found.values() else 1
    return {
        column: f"{kind}_{int(joint) - base + 1}" if joint.isdigit() else f"{kind}_{joint}"
        for column, joint in found.items()
    }


def _with_word(columns: Sequence[str], joints: Sequence[str], word: str) -> dict[str, str]:
    """The columns of a `word`, in their order, with the joint or number of each."""
    return {_bare(each): own for each, own in words_of(columns, joints).items()}.get(_bare(word), {})


def _without_joint(column: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """A column's name without that of each joint, or without its last number, and what was taken out."""
    named = [joint for joint in joints if not joint.isdigit()]
    inside = [(re.sub(rf"(?<![^\W_]){re.escape(joint)}(?![^\W_])", "", column), joint) for joint in named]
    last = LAST_NUMBER.search(column)
    number = [(column[: last.start()] + column[last.end() :], str(int(last[0])))] if last else []
    return [(own.strip(" _.-/[]()"), joint) for own, joint in (*inside, *number) if own != column]


def _bare(word: str) -> str:
    """A word without case and what stands between its parts."""
    return re.sub(r"[\W_]+", "", word).casefold()
