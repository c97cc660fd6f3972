"""The command `metaid estimate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import metaid
from metaid import show
from metaid.cli.common import (
    FIGURE_SUFFIXES,
    NOT_FOUND,
    PATH,
    json_option,
    names_of,
    numbers,
    print_json,
    refuse_output,
    say,
    typed,
    warn,
    whole_file,
)
from metaid.cli.recorded.printing import print_result
from metaid.errors import RecordError

if TYPE_CHECKING:
    from metaid.recorded import FileError, Payload, RecordedResult

MODEL_HELP = "Write .xml .urdf .py .h .toml .json, or torque.pdf."
NOMINAL_HELP = "A plant's name or file, an MJCF or URDF."
PAYLOAD_HELP = "A log with this weight, which tells drives' gains."
FRICTION_HELP = "As viscous,coulomb,spring; a wrong one lists all."
ABSOLUTE_HELP = "Read against the base; JOINT:motor: torque, too."
FIGURES = ("torque", "friction", "gravity", "bodies")  # each in the file that names it: `-o torque.pdf`


class LogsCommand(click.Command):
    """A command whose `--validate` has all logs that follow it, as a shell writes them out of a pattern: to fit what
    was meant to be held out would be said nowhere.
    """

    def parse_args(self, context: click.Context, arguments: list[str]) -> list[str]:
        each, held_out = list[str](), None
        for argument in arguments:
            if argument.startswith("-"):
                held_out = 0 if argument == "--validate" else None
            elif held_out is not None:
                each += ["--validate"] * (held_out > 0)
                held_out += 1
            each.append(argument)
        return super().parse_args(context, each)


@click.command(
    cls=LogsCommand, epilog="\b\nExample:\n  metaid estimate double-pendulum --nominal double-pendulum -o model.xml"
)
@click.argument("logs", metavar="LOG [LOG ...]", type=PATH, nargs=-1, required=True)
@click.option("--nominal", required=True, metavar="ROBOT", help=NOMINAL_HELP)
@click.option("--validate", metavar="LOG …", type=PATH, multiple=True, help="Logs to predict alone.")
@click.option("--law", metavar="PLANT", help="The torques were those that compensate this plant.")
@click.option("--joints", metavar="A,B,…", help="Of an MJCF or URDF those that move.")
@click.option("--friction", metavar="TERMS", help=FRICTION_HELP)
@click.option("--couple", "coupled", metavar="I,J", multiple=True, help="Two joints whose motors are coupled.")
@click.option("--absolute", metavar="JOINT", multiple=True, help=ABSOLUTE_HELP)
@click.option(
    "--map", "columns", metavar="OWN=OURS", multiple=True, help="What columns are: pwm=torque, q=angle:deg, hip=1."
)
@click.option(
    "--rate", type=float, metavar="HZ", hidden=True, help="Rows a second, of logs without times, or that count rows."
)
@click.option("--topic", metavar="NAME", hidden=True, help="Of joint states in a bag that has several.")
@click.option("--untrusted", metavar="A,B", help="Joints that move, but whose torques are not used.")
@click.option("--reversed", metavar="A,B", hidden=True, help="Joints that count the other way.")
@click.option("--order", metavar="A,B,…", hidden=True, help="All joints as logs have them.")
@click.option("--scale", metavar="JOINT=FACTOR", multiple=True, help="Multiply logged torques of a joint, or of 'all'.")
@click.option("--payload", "payloads", metavar="LOG=KG@X,Y,Z", multiple=True, help=PAYLOAD_HELP)
@click.option("--zero", metavar="JOINT=RAD", multiple=True, help="Add to the logged angles of a joint.")
@click.option(
    "--leave-out", metavar="LOG=S,S", multiple=True, hidden=True, help="From a time in a log to another, in s."
)
@click.option("--gravity", metavar="X,Y,Z", help="In the frame of the base, in m/s².")
@click.option("--zeros/--no-zeros", default=None, hidden=True, help="Encoders have a zero of their own in each log.")
@click.option(
    "--window", type=click.FloatRange(0.001, 100.0), metavar="S", hidden=True, help="Length of windows, in s."
)
@click.option("--delay", type=click.FloatRange(-1.0, 1.0), metavar="S", help="Of the torques, in s; else found.")
@click.option("-o", "outputs", type=PATH, multiple=True, help=MODEL_HELP)
@click.option("--report", type=PATH, metavar="FILE.html", help="Write one page with figures.")
@click.option("--even-if-not-found", is_flag=True, help="Print numbers and write files all the same.")
@click.option("--all", "whole", is_flag=True, help="Print every parameter, and what was tried.")
@json_option
def estimate(
    outputs: tuple[Path, ...], report: Path | None, even_if_not_found: bool, whole: bool, as_json: bool, **asked: Any
) -> int:
    """Identify a robot from logs of its motion. Each is a run, as CSV, Parquet, .mat, .npz, .json or a ROS bag: a time,
    and of each joint angle, torque and perhaps speed. `double-pendulum` is three. Exit status 3: not found.
    """
    from metaid.exporting import SUFFIXES

    for output in outputs:
        refuse_output(output, (*SUFFIXES, *FIGURE_SUFFIXES))
    models = [output for output in outputs if output.suffix not in FIGURE_SUFFIXES]
    figures = {output: _figure_of(output) for output in outputs if output not in models}
    if report is not None:
        refuse_output(report, (".html",), "--report")
    given = {name: text for name, text in asked.items() if text is not None}
    result = metaid.estimate(**{name: READ[name](text) if name in READ else text for name, text in given.items()})
    warn(result.nominal_repairs)
    has_numbers = result.verdict.is_found or even_if_not_found
    files = [_written(result, output) for output in models] if has_numbers else []
    if has_numbers:
        _draw(result, figures)
    if report is not None:
        with whole_file(report, (".html",), "--report") as partial:
            partial.write_text(show.render_log(result, typed(click.get_current_context()), files), encoding="utf-8")
    if as_json:
        print_json(result.summary_with(files))
    else:
        print_result(result, has_numbers, whole)
        for output, each in zip(models, files, strict=False):
            say(_of_file(each, result))
            for lacking in result.model.lacks(output.suffix):
                say(f"  {lacking}")
    return 0 if result.verdict.is_found else NOT_FOUND


def _written(result: RecordedResult, output: Path) -> FileError:
    """Writes a file and says how well it predicts, loaded again."""
    from metaid.exporting import SUFFIXES

    with whole_file(output, tuple(SUFFIXES)) as partial:
        result.model.write(partial)
    return result.error_of(output)


def _of_file(each: FileError, result: RecordedResult) -> str:
    """A file and its error, in a line."""
    if each.relative is None:
        return f"{each.path}: written ({each.why_not})"
    rows = "the logs to validate" if result.validation else "the logs, which it was fitted to"
    return f"{each.path}: loaded again it predicts the torques of {rows}, to {each.relative:.2%}"


def _figure_of(output: Path) -> str:
    """The figure that a file is of: its name, or what follows the last hyphen of it.  Raises click.UsageError."""
    name = output.stem.rpartition("-")[2]
    if name not in FIGURES:
        raise click.UsageError(
            f"-o {output}: the name says the figure (allowed: {', '.join(FIGURES)}, or anything and a hyphen before it)"
        )
    return name


def _draw(result: RecordedResult, figures: Mapping[Path, str]) -> None:
    """Writes figures to files, each by its name."""
    if not figures:
        return
    gallery = metaid.figures.LogGallery(result)
    for output, name in figures.items():
        if name not in gallery.makers:
            raise RecordError(f"{output}: gravity loads no joint (allowed: {', '.join(gallery.makers)})")
        with whole_file(output, FIGURE_SUFFIXES) as partial:
            metaid.figures.save(gallery.picture(name).figure, partial)
        say(f"{output}: written", err=True)


def _payload(text: str) -> Payload:
    """`LOG=KG[@X,Y,Z]` as a payload."""
    from metaid.recorded import Payload

    log, _, rest = text.rpartition("=")
    mass, _, place = rest.partition("@")
    try:
        where = tuple(float(each) for each in place.split(",")) if place else None
        if not log:
            raise ValueError
        return Payload(Path(log), float(mass), where)
    except ValueError:
        raise click.UsageError(f"--payload '{text}' (allowed: LOG=KG or LOG=KG@X,Y,Z, as load.csv=2.8)") from None


def _pair(text: str) -> tuple[int, int]:
    """`I,J` as two numbers of joints."""
    try:
        one, other = (int(each) for each in text.split(","))
    except ValueError:
        raise click.UsageError(f"--couple '{text}' (allowed: two numbers of joints, as 5,6)") from None
    return one, other


def _meaning(text: str) -> tuple[str, str]:
    """`OWN=OURS` as a column and what it is."""
    own, _, ours = text.rpartition("=")
    if not own or not ours:
        raise click.UsageError(
            f"--map '{text}' (allowed: a column and what it is, as pwm=torque_1, all of a word, as q=angle:deg, or a "
            "joint, as hip=1)"
        )
    return own, ours


def _stretches(texts: tuple[str, ...]) -> dict[str, list[tuple[float, float]]]:
    """`LOG=S,S …` as stretches, by log."""
    stretches: dict[str, list[tuple[float, float]]] = {}
    for text in texts:
        log, _, times = text.rpartition("=")
        try:
            begin, end = (float(each) for each in times.split(","))
        except ValueError:
            raise click.UsageError(f"--leave-out '{text}' (allowed: LOG=S,S, as log.csv=10.9,11.4)") from None
        stretches.setdefault(log, []).append((begin, end))
    return stretches


def _vector(text: str) -> tuple[float, ...]:
    """`X,Y,Z` as three numbers."""
    try:
        x, y, z = (float(each) for each in text.split(","))
    except ValueError:
        raise click.UsageError(f"--gravity '{text}' (allowed: three numbers, as 0,0,-9.81)") from None
    return x, y, z


def _terms(text: str) -> list[str]:
    """`A,B` as terms of friction; none of them where it is `none`."""
    return [term for term in text.split(",") if term and text != "none"]


# What the texts of options mean, by the parameter of `metaid.estimate`; the others are what click makes of them.
READ: dict[str, Callable[[Any], Any]] = {
    "joints": names_of,
    "payloads": lambda texts: [_payload(text) for text in texts],
    "friction": _terms,
    "coupled": lambda texts: [_pair(text) for text in texts],
    "scale": lambda texts: numbers(texts, "--scale"),
    "zero": lambda texts: numbers(texts, "--zero"),
    "gravity": _vector,
    "columns": lambda texts: dict(map(_meaning, texts)),
    "untrusted": lambda text: text.split(","),
    "reversed": lambda text: text.split(","),
    "order": names_of,
    "leave_out": _stretches,
}
