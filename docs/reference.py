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
from metaid.study.settings import NominalSettings, StudySettings
from metaid.study.spatial import ArmStudySettings

PAGE = Path(__file__).with_name("reference.md")
KEYS = Path(__file__).with_name("keys.toml")
PART = re.compile(r"(<!-- generated: ([\w-]+) -->\n).*?(<!-- end of \2 -->\n)", re.DOTALL)

FILES: dict[str, type[Settings]] = {
    "keys-chain": PlantSettings,
    "keys-arm": ArmSettings,
    "keys-rig": SocketSettings,
    "keys-limits": LimitsSettings,
    "keys-study": StudySettings,
    "keys-arm-study": ArmStudySettings,
}


def page(text: str) -> str:
    """The page with its generated parts made anew from the code."""
    parts = {name: keys(settings) for name, settings in FILES.items()}
    parts |= {"commands": commands(), "calls": calls(), "figures": figures()}
    named = [name for _, name, _ in PART.findall(text)]
    assert sorted(named) == sorted(parts), f"parts of the page: {named}, of the code: {list(parts)}"
    return PART.sub(lambda found: f"{found[1]}\n{parts[found[2]]}\n{found[3]}", text)


def keys(settings: type[Settings]) -> str:
    """A table of all keys of a file."""
    meanings = tomllib.loads(KEYS.read_text(encoding="utf-8"))
    rows = ["| key | unit | default | allowed | |", "| --- | --- | --- | --- | --- |"]
    for table, owner, name, field in fields(settings):
        meaning = meaning_of(meanings, owner, name)
        default = meaning.get("default") or default_text(field)
        place = f"{table} " if table else ""
        cells = (f"{place}`{name}`", meaning.get("unit", ""), default, allowed(field), meaning["text"])
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def meaning_of(meanings: dict[str, Any], owner: type, name: str) -> dict[str, str]:
    """What docs/keys.toml says of a key, in the table of its class or of the class that it inherits it from."""
    for base in owner.__mro__:
        if name in meanings.get(base.__name__, {}):
            meaning: dict[str, str] = meanings[base.__name__][name]
            return meaning
    raise KeyError(f"docs/keys.toml does not say what `{name}` of [{owner.__name__}] means")


def fields(settings: type[Settings], table: str = "") -> Iterator[tuple[str, type[Settings], str, FieldInfo]]:
    """Table, class, name and field of every key of a file, those of nested tables after the others."""
    nested: list[tuple[str, type[Settings], bool]] = []
    for name, field in settings.model_fields.items():
        inner = [each for each in members(field.annotation) if inspect.isclass(each) and issubclass(each, Settings)]
        is_elsewhere = inner == [NominalSettings]
        nested += [(name, each, is_list(field.annotation)) for each in inner if not is_elsewhere]
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
    """A range of numbers in words."""
    flat = [each for part in metadata for each in (part.metadata if isinstance(part, FieldInfo) else [part])]
    low = next((f"from {each.ge:.10g}" for each in flat if isinstance(each, annotated_types.Ge)), None)
    low = low or next((f"above {each.gt:.10g}" for each in flat if isinstance(each, annotated_types.Gt)), None)
    high = next((f"to {each.le:.10g}" for each in flat if isinstance(each, annotated_types.Le)), None)
    high = high or next((f"below {each.lt:.10g}" for each in flat if isinstance(each, annotated_types.Lt)), None)
    return " ".join(part for part in (low, high) if part)


def commands() -> str:
    """Every command: what it does, its arguments and options."""
    parts = []
    for path, command in every_command(app, ("metaid",)):
        context = click.Context(command, info_name=path[-1])
        arguments = [each.make_metavar(context) for each in command.params if isinstance(each, click.Argument)]
        parts.append(f"#### `{' '.join([*path, *arguments])}`\n\n{escaped(inspect.cleandoc(command.help or ''))}\n")
        options = [each for each in command.params if isinstance(each, click.Option)]
        if options:
            rows = ["| option | default | |", "| --- | --- | --- |", *map(option_row, options)]
            parts.append("\n".join(rows) + "\n")
    return "\n".join(parts)


def every_command(group: click.Group, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command that is no group, with the words that call it."""
    for name in sorted(group.commands):
        command = group.commands[name]
        if isinstance(command, click.Group):
            yield from every_command(command, (*path, name))
        else:
            yield (*path, name), command


def option_row(option: click.Option) -> str:
    """A row of the table of options."""
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    is_plain = not option.is_flag and not option.multiple and isinstance(option.default, str | int | float)
    default = "needed" if option.required else str(option.default) if is_plain else ""
    return f"| {names}{value_text(option)} | {default} | {escaped(option.help or '')} |"


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
        low, high = kind.min, kind.max
        above = f"{'above' if kind.min_open else 'from'} {low:.10g}" if low is not None else ""
        return f" NUMBER {above}{f' to {high:.10g}' if high is not None else ''}"
    return " FILE" if isinstance(kind, click.Path) else " TEXT"


def calls() -> str:
    """Every public call with its signature and what its docstring says."""
    parts = []
    for name in metaid.__all__:
        thing = getattr(metaid, name)
        if inspect.ismodule(thing):
            continue
        is_error = inspect.isclass(thing) and issubclass(thing, Exception)
        is_face = getattr(thing, "_is_protocol", False)
        signature = "" if is_error or is_face else signature_of(thing)
        parts.append(f"#### `metaid.{name}{signature}`\n\n{doc_of(thing)}\n")
    return "\n".join(parts)


def figures() -> str:
    """Every public figure in a row."""
    from metaid.show import figures as module

    rows = ["| call | draws |", "| --- | --- |"]
    for name in sorted(module.__all__):
        thing = getattr(module, name)
        if inspect.isfunction(thing) and name.startswith("plot_"):
            first = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
            rows.append(f"| `metaid.figures.{name}{signature_of(thing)}` | {escaped(first)} |")
    return "\n".join(rows) + "\n"


def signature_of(thing: Any) -> str:
    """Names and defaults of the parameters, without their types."""
    parameters = inspect.signature(thing).parameters.values()
    shown = []
    for each in parameters:
        star = {each.VAR_POSITIONAL: "*", each.VAR_KEYWORD: "**"}.get(each.kind, "")
        default = each.default
        text = "…" if callable(default) else repr(default)
        shown.append(f"{star}{each.name}" + ("" if default is each.empty else f"={text}"))
    return f"({', '.join(shown)})"


def doc_of(thing: Any) -> str:
    """A docstring as a paragraph, and its parameters as a list; its example is for `help` and the site."""
    text = (inspect.getdoc(thing) or "").partition("\nExample:\n")[0]
    lines, out, section = text.splitlines(), [], False
    for line in lines:
        if re.fullmatch(r"(Args|Returns|Raises|Attributes):", line):
            out += ["", f"{line}", ""]
            section = True
        elif section and re.match(r"    \S", line):
            out.append(f"- {escaped(line.strip())}")
        elif section and line.startswith("     "):
            out[-1] += f" {escaped(line.strip())}"
        else:
            out.append(escaped(line))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(out)).strip()


def escaped(text: str) -> str:
    """What a help text says, as Markdown does: a bar would end a cell of a table."""
    return text.replace("\b\n", "").replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
