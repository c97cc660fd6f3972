"""What several commands share: groups that name what is allowed, the storage option, tables."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from metaid.errors import MetaidError, printable, unknown

if TYPE_CHECKING:
    from rich.segment import Segment

    from metaid.cli.layout import Column, Layout
    from metaid.store import Store


FIGURE_SUFFIXES = (".png", ".pdf", ".svg")
NOT_FOUND = 3  # exit status where trials are spent, or logs are read, without a result
PATH = click.Path(path_type=Path)


class Group(click.Group):
    """A group that prints its help where no command is given, and names the known commands where one is unknown."""

    def parse_args(self, context: click.Context, arguments: list[str]) -> list[str]:
        if not arguments and not context.resilient_parsing:
            lines = context.get_help().splitlines()
            click.echo("\n".join(line.rstrip() for line in lines))
            context.exit()
        return super().parse_args(context, arguments)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Each command with as many whole clauses of its help's first sentence as fit a line."""
        room = formatter.width - 6 - max(map(len, self.commands))
        rows = [(name, _clauses(command.get_short_help_str(1000), room)) for name, command in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(sorted(rows))

    def resolve_command(
        self, context: click.Context, arguments: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if arguments and not arguments[0].startswith("-") and self.get_command(context, arguments[0]) is None:
            raise click.UsageError(unknown("command", arguments[0], self.list_commands(context)))
        return super().resolve_command(context, arguments)


def _clauses(text: str, room: int) -> str:
    """A sentence without the last of its clauses where so many letters have no room for all."""
    while len(text) > room and (ends := [text.rfind(mark) for mark in (";", ":", ",") if mark in text]):
        text = f"{text[: ends[0]]}."
    return text


storage_option = click.option(
    "--storage",
    envvar="METAID_STORAGE",
    default="metaid.db",
    show_default=True,
    help="Study DB: a URL, or an SQLite file.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def open_store(storage: str, create: bool = False) -> contextlib.closing[Store]:
    """The study DB at `storage`, closed afterwards."""
    from metaid.store import Store

    return contextlib.closing(Store(storage, create))


def pairs(given: Sequence[str], option: str) -> dict[str, str]:
    """`KEY=VALUE …` as a dictionary."""
    split = {}
    for text in given:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise click.UsageError(f"{option} '{text}' is not of the form KEY=VALUE")
        split[key] = value
    return split


def numbers(given: Sequence[str], option: str) -> dict[str, float]:
    """`NAME=NUMBER …` as a dictionary of finite numbers."""
    values = {}
    for name, text in pairs(given, option).items():
        try:
            values[name] = float(text)
        except ValueError:
            raise click.UsageError(f"{option} {name}: '{text}' is not a number") from None
        if not math.isfinite(values[name]):
            raise click.UsageError(f"{option} {name}: '{text}' is not a finite number")
    return values


def escape_what_has_no_code() -> None:
    """Letters that stdout or stderr has no code for are written out, whatever PYTHONIOENCODING or the locale says."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and not _is_unicode(stream):
            stream.reconfigure(errors="backslashreplace")


def _is_unicode(stream: TextIO) -> bool:
    return (stream.encoding or "").lower().replace("-", "").startswith("utf")


def say(text: str, err: bool = False) -> None:
    """A line on stdout, or on stderr, broken between words where a terminal is narrower: nothing in it can command the
    terminal.
    """
    from metaid.cli.layout import wrapped

    with contextlib.suppress(OSError) if err else contextlib.nullcontext():  # there is nowhere left to say so
        stream = sys.stderr if err else sys.stdout  # click would write UTF-8 to one that is said to be ASCII
        click.echo(wrapped(printable(text), stream), file=stream)


def say_reasons(head: str, reasons: Sequence[str]) -> None:
    """A line that begins with `head` and the first of the reasons, and one for each other."""
    for number, reason in enumerate(reasons):
        say(f"- {reason}" if number else f"{head}: {reason}")


@contextlib.contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Within it a terminal shows on stderr that something is made, and `what`; the function says what comes next."""
    from rich.console import Console

    console = Console(stderr=True, markup=False, highlight=False)
    if not console.is_terminal:
        yield lambda _: None
        return
    with console.status(printable(f"{what} …")) as status:
        yield lambda following: status.update(printable(f"{following} …"))


def warn(sentences: Iterable[str | None]) -> None:
    """A line on stderr for each thing that is not as it should be, and that was mended or is asked about, if any."""
    for sentence in filter(None, sentences):
        say(f"warning: {sentence}", err=True)


def names_of(text: str | None) -> tuple[str, ...] | None:
    """The names in `A,B`; None where there is no text."""
    return None if text is None else tuple(name.strip() for name in text.split(",") if name.strip())


def print_json(data: Any) -> None:
    """JSON on stdout, printable letters as they are where stdout has a code for all of them."""
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    as_they_are = _is_unicode(sys.stdout) and text.replace("\n", "").isprintable()
    click.echo(text if as_they_are else json.dumps(data, indent=2, allow_nan=False))


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    note: str = "",
    words: Sequence[str] = (),
    dispensable: Sequence[str] = (),
) -> None:
    """Prints a table on stdout, whole at any width.

    Args:
        title: above it.
        columns: their headings.
        rows: the cells of each row.
        note: below it.
        words: headings of the columns, besides the first, that hold words: these are aligned left, numbers right.
        dispensable: headings of the columns that are left out where the terminal is too narrow, in this order.
    """
    from metaid.cli.layout import Column, laid_out, terminal_width

    made = [
        Column(heading, tuple(one_line(row[i]) for row in rows), i == 0 or heading in words)
        for i, heading in enumerate(columns)
    ]
    layout = laid_out(made, dispensable, width := terminal_width())
    say(one_line(title))
    if layout.widths:
        _print_rows(layout, width)
    else:
        _print_entries(made)
    if note:
        say(one_line(note))
    if layout.left_out:
        say(f"too narrow for: {', '.join(layout.left_out)}")


def _print_rows(layout: Layout, width: int | None) -> None:
    """A row a line."""
    from rich import box
    from rich.console import Console
    from rich.segment import Segment, Segments
    from rich.table import Table

    from metaid.cli.layout import GAPS, UNLIMITED

    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1) if layout.gap == GAPS[0] else (0, layout.gap - 1, 0, 0),
        pad_edge=layout.gap == GAPS[0],
    )
    for column, wide in zip(layout.columns, layout.widths, strict=True):
        table.add_column(column.heading, justify="left" if column.is_words else "right", width=wide, overflow="fold")
    for row in zip(*(column.cells for column in layout.columns), strict=True):
        table.add_row(*row)
    console = Console(markup=False, highlight=False)
    console.width = width or max(UNLIMITED, sum(layout.widths) + GAPS[0] * (len(layout.widths) + 1))
    for line in console.render_lines(table, pad=False):
        console.print(Segments([*_without_end_spaces(line), Segment.line()]), end="")


def _without_end_spaces(line: Sequence[Segment]) -> list[Segment]:
    """A line of a table up to its last letter."""
    from rich.segment import Segment

    kept = list(line)
    while kept and not kept[-1].text.strip():
        kept.pop()
    return [*kept[:-1], Segment(kept[-1].text.rstrip(), kept[-1].style)] if kept else []


def _print_entries(columns: Sequence[Column]) -> None:
    """A cell a line, an empty line before and after each row."""
    say("")
    for row in zip(*(column.cells for column in columns), strict=True):
        for column, cell in zip(columns, row, strict=True):
            say(f"  {column.heading}: {cell}" if column.heading else f"  {cell}")
        say("")


def one_line(text: str) -> str:
    """A text for one line of a table: nothing in it can command the terminal."""
    return printable(" ".join(text.split()))


def typed(context: click.Context) -> str:
    """The command that was typed, but for options that are as they are by default."""
    words = []
    for parameter in context.command.params:
        assert parameter.name is not None
        value = context.params[parameter.name]
        if context.get_parameter_source(parameter.name) is not click.core.ParameterSource.COMMANDLINE:
            continue
        values = value if isinstance(value, tuple) else (value,)
        if isinstance(parameter, click.Argument):
            words += [str(each) for each in values]
        elif isinstance(parameter, click.Option) and parameter.is_bool_flag:
            words.append((parameter.opts if value else parameter.secondary_opts)[0])
        else:
            words += [word for each in values for word in (parameter.opts[0], str(each))]
    return f"{context.command_path} {shlex.join(words)}"


def refuse_output(path: Path, suffixes: Sequence[str], option: str = "-o") -> None:
    """Refuses a file to be written whose ending is not among `suffixes`, or whose folder is not there."""
    if path.suffix not in suffixes:
        raise click.UsageError(f"{option} {path}: the ending says the format (allowed: {', '.join(suffixes)})")
    if not os.path.isdir(path.parent):
        raise click.UsageError(f"{option} {path}: no such folder {path.parent}")


@contextlib.contextmanager
def whole_file(path: Path, suffixes: Sequence[str], option: str = "-o") -> Iterator[Path]:
    """A temporary file beside `path` that takes its place when all went well: nothing is left half-written."""
    refuse_output(path, suffixes, option)
    partial = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield partial
        partial.replace(path)
    except OSError as problem:
        raise MetaidError(f"{path}: {problem.strerror}") from None
    finally:
        with contextlib.suppress(OSError):  # the name may be too long even to look for
            partial.unlink(missing_ok=True)
