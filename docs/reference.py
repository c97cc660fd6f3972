"""Writes the generated parts of docs/reference.md: every key of every file, every command, every call.

    python docs/reference.py

Keys, types, limits and defaults are those of the code. What a key means, and its unit, is in docs/keys.toml; a key that
is missing there is an error. Commands are as `--help` has them, calls as their docstrings do. `tests/test_reference.py`
fails where the page is not what this prints.
"""

from __future__ import annotations

import inspect
import re
import tomllib
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import annotated_types
import click
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

import metaid
from metaid.cli import app
from metaid.excitation import LimitsSettings
from metaid.files import Settings
from metaid.plant import ArmSettings, PlantSettings, SocketSettings
from metaid.study.settings import NominalSettings, OfArm, StudySettings

PAGE = Path(__file__).with_name("reference.md")
KEYS = Path(__file__).with_name("keys.toml")
PART = re.compile(r"(<!-- generated: ([\w-]+) -->\n).*?(<!-- end of \2 -->\n)", re.DOTALL)

FILES: dict[str, type[Settings]] = {
    "keys-chain": PlantSettings,
    "keys-arm": ArmSettings,
    "keys-rig": SocketSettings,
    "keys-limits": LimitsSettings,
}
BESIDE: dict[str, type[Settings]] = {"keys-arm": PlantSettings}  # told there already
MOST = 8  # parameters of a call that are named
EVERYWHERE = ("--storage", "--json")  # options that the page tells once


def page(text: str) -> str:
    """The page with its generated parts made anew from the code."""
    parts = {name: keys(settings, BESIDE.get(name)) for name, settings in FILES.items()}
    parts |= {"keys-study": study_keys(of_arm=False), "keys-arm-study": study_keys(of_arm=True)}
    parts |= {"commands": commands(), "calls": calls()}
    named = [name for _, name, _ in PART.findall(text)]
    assert sorted(named) == sorted(parts), f"parts of the page: {named}, of the code: {list(parts)}"
    return PART.sub(lambda found: f"{found[1]}\n{parts[found[2]]}\n{found[3]}", text)


def keys(settings: type[Settings], beside: type[Settings] | None = None) -> str:
    """A table of all keys of a file, but for those that mean the same in that of `beside`."""
    told = set(key_rows(beside)) if beside else set()
    return key_table(row for row in key_rows(settings) if row not in told)


def key_table(rows: Iterator[str]) -> str:
    """A table of rows."""
    return "\n".join(["| key | default | allowed | |", "|---|---|---|---|", *rows]) + "\n"


def study_keys(of_arm: bool) -> str:
    """A table of the keys of a study file that only an arm has, or of all others."""
    rows = rows_and_owners(StudySettings)
    return key_table(row for row, owner in rows if (OfArm in owner.__bases__) == of_arm)


def key_rows(settings: type[Settings]) -> Iterator[str]:
    """A row for each key."""
    return (row for row, _ in rows_and_owners(settings))


def rows_and_owners(settings: type[Settings]) -> Iterator[tuple[str, type]]:
    """A row for each key, and the class that has it."""
    meanings = tomllib.loads(KEYS.read_text(encoding="utf-8"))
    for table, heir, name, field in fields(settings):
        owner, meaning = meaning_of(meanings, heir, name)
        default = meaning.get("default") or default_text(field)
        within = f"{allowed(field)} {meaning.get('unit', '')}".strip()
        cells = (dotted(table, name), default, within, meaning["text"])
        yield f"| {' | '.join(cells)} |", owner


def dotted(table: str, name: str) -> str:
    """A key as `--set` takes it; of a list of tables after its heading."""
    if not table or table.startswith("`[["):
        return f"{table} `{name}`".strip()
    return f"`{table.strip('`[]')}.{name}`"


def meaning_of(meanings: dict[str, Any], owner: type, name: str) -> tuple[type, dict[str, str]]:
    """What docs/keys.toml says of a key, and the class in whose table it does: its own, or one that it inherits it
    from.
    """
    for base in owner.__mro__:
        if name in meanings.get(base.__name__, {}):
            return base, meanings[base.__name__][name]
    raise KeyError(f"docs/keys.toml does not say what `{name}` of [{owner.__name__}] means")


def fields(settings: type[Settings], table: str = "") -> Iterator[tuple[str, type[Settings], str, FieldInfo]]:
    """Table, class, name and field of every key of a file, those of nested tables after the others."""
    nested: list[tuple[str, type[Settings], bool]] = []
    for name, field in settings.model_fields.items():
        inner = [each for each in members(field.annotation) if inspect.isclass(each) and issubclass(each, Settings)]
        nested += [(name, each, is_list(field.annotation)) for each in inner if each is not NominalSettings]
        if not inner or len(members(field.annotation)) > len(inner):
            yield table, settings, name, field
    for name, each, is_many in nested:
        inside = table.strip("`[]") + "." * bool(table) + name
        yield from fields(each, f"`[[{inside}]]`" if is_many else f"`[{inside}]`")


def members(annotation: Any) -> list[Any]:
    """The types that a key may have, without None; of a list what is in it."""
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return members(inside[0])
    if origin in (types.UnionType, typing.Union):
        return [each for part in inside if part is not type(None) for each in members(part)]
    if origin in (tuple, list) and inspect.isclass(inside[0]) and issubclass(inside[0], Settings):
        return [inside[0]]
    return [annotation]


def is_list(annotation: Any) -> bool:
    """Whether a key is a list of tables."""
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    return origin in (tuple, list) or (origin is typing.Annotated and is_list(inside[0]))


def default_text(field: FieldInfo) -> str:
    """The default of a key as a file would have it; a dash where a file must say it."""
    if field.default is PydanticUndefined and field.default_factory is None:
        return "–"
    value = field.get_default(call_default_factory=True)
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:.10g}"
    if isinstance(value, dict):
        return "none"
    if isinstance(value, tuple | list):
        return ", ".join(f"`{each}`" for each in value) or "none"
    return f"`{value}`" if value != "" else "none"


def allowed(field: FieldInfo) -> str:
    """What a key may be: words, or a range of numbers."""
    return "; ".join(dict.fromkeys(text for text in ranges(field.annotation, tuple(field.metadata)) if text))


def ranges(annotation: Any, metadata: tuple[Any, ...]) -> Iterator[str]:
    """The same of a type with constraints."""
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        yield from ranges(inside[0], (*inside[1:], *metadata))
    elif origin in (types.UnionType, typing.Union):
        for part in inside:
            yield from ranges(part, metadata)
    elif origin is Literal:
        yield ", ".join(f"`{each}`" for each in inside)
    elif origin in (tuple, list):
        yield from ranges(inside[0], ())
    elif origin is dict:
        yield from ranges(inside[1], ())
    elif annotation in (int, float):
        yield limits(metadata)


def limits(metadata: tuple[Any, ...]) -> str:
    """A range of numbers as an interval: a round bracket leaves its end out."""
    flat = [each for part in metadata for each in (part.metadata if isinstance(part, FieldInfo) else [part])]
    low = next((f"[{each.ge:.10g}" for each in flat if isinstance(each, annotated_types.Ge)), None)
    low = low or next((f"({each.gt:.10g}" for each in flat if isinstance(each, annotated_types.Gt)), None)
    high = next((f"{each.le:.10g}]" for each in flat if isinstance(each, annotated_types.Le)), None)
    high = high or next((f"{each.lt:.10g})" for each in flat if isinstance(each, annotated_types.Lt)), None)
    return f"{low or '(−∞'}, {high or '∞)'}" if low or high else ""


def commands() -> str:
    """Every command: the first paragraph of its help, its arguments and options."""
    parts = []
    for path, command in every_command(app, ("metaid",)):
        context = click.Context(command, info_name=path[-1])
        arguments = [each.make_metavar(context) for each in command.params if isinstance(each, click.Argument)]
        said = inspect.cleandoc(command.help or "").partition("\n\n")[0]
        parts.append(f"#### `{' '.join([*path, *arguments])}`\n\n{escaped(said)}\n")
        options = [each for each in command.params if isinstance(each, click.Option) and not is_everywhere(each)]
        if options:
            parts.append("\n".join(map(option_line, options)) + "\n")
    return "\n".join(parts)


def is_everywhere(option: click.Option) -> bool:
    """Whether the page has told of an option already."""
    return option.opts[0] in EVERYWHERE


def every_command(group: click.Group, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command that is no group, with the words that call it."""
    for name in sorted(group.commands):
        command = group.commands[name]
        if isinstance(command, click.Group):
            yield from every_command(command, (*path, name))
        else:
            yield (*path, name), command


def option_line(option: click.Option) -> str:
    """An item of the list of options."""
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    is_plain = not option.is_flag and not option.multiple and isinstance(option.default, str | int | float)
    default = "needed" if option.required else f"default {option.default}" if is_plain else ""
    text = escaped(option.help or "")
    return f"- {names}{value_text(option)}: {text}{f' ({default})' if default else ''}"


def value_text(option: click.Option) -> str:
    """What follows the name of an option."""
    kind = option.type
    if option.is_flag:
        return ""
    if option.metavar:
        return f" {option.metavar}"
    if isinstance(kind, click.Choice):
        return f" {' or '.join(map(str, kind.choices))}"
    if isinstance(kind, click.IntRange | click.FloatRange):
        low = "(−∞" if kind.min is None else f"{'(' if kind.min_open else '['}{kind.min:.10g}"
        return f" {low}, {'∞)' if kind.max is None else f'{kind.max:.10g}]'}"
    return " FILE" if isinstance(kind, click.Path) else " TEXT"


def calls() -> str:
    """Every public call but the errors in a line, with what the first sentence of its docstring says."""
    lines = []
    for name in metaid.__all__:
        thing = getattr(metaid, name)
        if inspect.ismodule(thing):
            continue
        if inspect.isclass(thing) and issubclass(thing, Exception):
            continue
        signature = "" if getattr(thing, "_is_protocol", False) else signature_of(thing)
        lines.append(f"- `metaid.{name}{signature}`: {escaped(first_sentence(thing))}")
    return "\n".join(lines) + "\n"


def first_sentence(thing: Any) -> str:
    """Of a docstring."""
    paragraph = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    return re.split(r"(?<=\.)\s+(?=[A-Z])|(?<=[:;])\s", paragraph)[0].rstrip(":;")


def signature_of(thing: Any) -> str:
    """Names of the parameters; a sign of equality after those with a default."""
    parameters = inspect.signature(thing).parameters.values()
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    shown = [f"{stars.get(each.kind, '')}{each.name}{'' if each.default is each.empty else '='}" for each in parameters]
    return f"({', '.join([*shown[:MOST], *(['…'] if len(shown) > MOST else [])])})"


def escaped(text: str) -> str:
    """What a help text says, as Markdown does."""
    return text.replace("\b\n", "").replace("<", "&lt;")


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
