"""`metaid study …`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

import metaid
from metaid import show
from metaid.cli.checks.until import describe_reached, share
from metaid.cli.common import NOT_FOUND, Group, json_option, open_store, pairs, print_json, say, storage_option, warn
from metaid.cli.interrupted import Interruption
from metaid.errors import MetaidError, StorageError, StudyError, WorkerError, printable

if TYPE_CHECKING:
    from metaid.study import Progress, StudySpec


def _complete_study_file(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    from metaid.files import shipped_names

    return [name for name in shipped_names("studies") if name.startswith(incomplete)]


def complete_name(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    try:
        with open_store(context.params.get("storage") or "metaid.db") as store:
            # A name that a shell would read as more than a word is not offered to it.
            return [name for name in store.names() if name.startswith(incomplete) and shlex.quote(name) == name]
    except MetaidError:
        return []


def _complete_study(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    return sorted(
        {*_complete_study_file(context, parameter, incomplete), *complete_name(context, parameter, incomplete)}
    )


name_argument = click.argument("name", shell_complete=complete_name)


@click.group(cls=Group, epilog="\b\nExample:\n  metaid study create three-link\n  metaid study run three-link")
def study() -> None:
    """Searches for the lumps of a plant, kept in a study DB."""


@study.command(epilog="\b\nExample:\n  metaid study create three-link --name wide --set search.low=0.4")
@click.argument("source", metavar="STUDY", shell_complete=_complete_study_file)
@click.option("--name", help="Name in the DB (default: the file's).")
@click.option(
    "--from", "start_from", metavar="OTHER", help="Take what the study OTHER of the DB identified as nominal model."
)
@storage_option
@click.option(
    "--set",
    "changes",
    metavar="KEY=VALUE",
    multiple=True,
    help="Change a setting of the file, e.g. search.sigma=0.1; may be repeated.",
)
@click.option("--exist-ok", is_flag=True, help="Do nothing if the DB has a study with these settings already.")
def create(
    source: str, name: str | None, start_from: str | None, storage: str, changes: tuple[str, ...], exist_ok: bool
) -> None:
    """Make a study in the DB from STUDY, a shipped name or the path of a study file."""
    made, shown = _make(storage, source, changes, name, start_from, exist_ok)
    say(f"study '{made}' is in {shown}; run it with: metaid study run {shlex.quote(made)}")


def _make(
    storage: str, source: str, changes: Sequence[str], name: str | None, start_from: str | None, exist_ok: bool
) -> tuple[str, str]:
    """Makes a study in the DB and prints what is to be known before a trial; its name, and how the DB is shown.

    Args:
        storage: of the DB.
        source: a shipped name, or the path of a study file.
        changes: of its settings, `KEY=VALUE`.
        name: in the DB, or None for that of the file.
        start_from: the study in the DB whose model is its nominal one, or None.
        exist_ok: whether the DB may have it.
    """
    from metaid.study import advice, create_study, ensure_study, question

    spec = load_study(source, changes)
    with open_store(storage, create=start_from is None) as store:
        if start_from is not None:
            from metaid.results import started_from

            spec = started_from(store, spec, start_from)
        warnings = [advice(spec), None if spec.is_arm else _undetermined(spec)]
        made = (ensure_study if exist_ok else create_study)(store, spec, name)
    warn([question(spec)])
    for line in filter(None, warnings):
        say(line, err=True)
    return made, store.shown


def load_study(source: str, changes: Sequence[str]) -> StudySpec:
    """A study file with `KEY=VALUE` changes."""
    return metaid.load_study(source, {key: _toml_value(text) for key, text in pairs(changes, "--set").items()})


def _toml_value(text: str) -> Any:
    """A value as a study file would have it; bare words are strings."""
    from metaid.files import parse_toml

    try:
        return parse_toml(f"value = {text}")["value"]
    except ValueError:
        return text


@study.command(epilog="\b\nExample:\n  metaid study check three-link --set episode.measure=count")
@click.argument("source", metavar="STUDY", shell_complete=_complete_study)
@storage_option
@click.option(
    "--set", "changes", metavar="KEY=VALUE", multiple=True, help="Change a setting of the file, as in create."
)
@click.option(
    "--until", callback=share, metavar="SHARE", help="Also how many pushes and minutes 'study run --until' would take."
)
@json_option
def check(source: str, storage: str, changes: tuple[str, ...], until: float | None, as_json: bool) -> None:
    """What STUDY can determine, and how well, by its nominal model, before any trial.

    STUDY is a shipped name, the path of a study file, or the name of a study in the DB.
    """
    from metaid.cli.checks.determined import print_check
    from metaid.study import problem_of, question

    spec = _stored(source, storage, changes) or load_study(source, changes)
    shown = metaid.check(spec, until=until)
    warn([question(spec)])
    if as_json:
        print_json(shown)
    else:
        print_check(problem_of(spec), shown)


def _stored(name: str, storage: str, changes: Sequence[str]) -> StudySpec | None:
    """The settings of a study that a DB has and that does not ship under that `name`; None where there is no such."""
    from metaid.files import find_file
    from metaid.study import stored_spec

    with suppress(StudyError):
        find_file("studies", name, StudyError)
        return None
    try:
        with open_store(storage) as store:
            spec = stored_spec(store, name) if name in store.names() else None
    except StorageError:
        return None  # what is wrong is that there is no such file
    if spec is not None and changes:
        raise click.UsageError(f"--set changes a study file, and '{name}' is in {storage}")
    return spec


def _undetermined(spec: StudySpec) -> str | None:
    """What the pushes of a study do not determine, in one line; None if they do, or if it costs nothing to see it in
    the verdict: the estimate from simulated trials says the same, and trying it beforehand takes as long.
    """
    from metaid.cli.checks.determined import judge_of
    from metaid.study import identifiability, problem_of

    problem = problem_of(spec)
    if problem.spec.is_simulated and problem.is_told_by_estimate:
        return None
    names = identifiability(problem).undetermined_names
    if not names:
        return None
    what = f"{judge_of(problem)} with these pushes cannot determine {', '.join(names)}"
    return f"warning: {what} (see metaid study check)"


@study.command(epilog="\b\nExample:\n  metaid study run three-link --workers 2")
@name_argument
@storage_option
@click.option("--create", "make", is_flag=True, help="Make the study first, as create --exist-ok does.")
@click.option(
    "--trials",
    type=click.IntRange(1),
    metavar="TOTAL",
    help="Trials in all, those in the DB included (default: the study's).",
)
@click.option(
    "--workers", type=click.IntRange(1, 1024), help="Who evaluates: threads, or Ray actors (default: the study's)."
)
@click.option(
    "--engine",
    type=click.Choice(["local", "ray"]),
    default="local",
    show_default=True,
    help="Threads on this machine, or Ray actors.",
)
@click.option("--ray-address", metavar="A", help="A running Ray cluster, e.g. 10.0.0.1:6379.")
@click.option(
    "--patience",
    type=click.FloatRange(0, min_open=True),
    help="Seconds that a Ray worker, or a DB server, may be silent [default: 120, and 300].",
)
@click.option(
    "--until",
    callback=share,
    metavar="SHARE",
    help="With output-error: end once all lumps at once are known so well with 95 %, e.g. 0.5%.",
)
@click.option("--quiet", is_flag=True, help="Print nothing while it runs.")
@click.make_pass_decorator(Interruption, ensure=True)
def run(
    interruption: Interruption,
    name: str,
    storage: str,
    make: bool,
    trials: int | None,
    workers: int | None,
    engine: str,
    ray_address: str | None,
    patience: float | None,
    until: float | None,
    quiet: bool,
) -> None:
    """Run a study, or go on with it. Ctrl-C is safe: whole generations are in the DB.

    With --create, NAME is a shipped study or the path of a study file.
    The trials depend on the study's settings and seed alone, not on workers, engine, or how often it was stopped.
    The exit status is 3 where all trials are spent and the lumps were not found.
    """
    from metaid.cli.live import Live
    from metaid.cli.printed import print_study
    from metaid.study import run_study

    if make:
        name, _ = _make(storage, name, (), None, None, exist_ok=True)
    with open_store(storage) as store:
        with Live(store, name, quiet) as live:
            before = live.trials

            def say_stopped() -> None:
                live.close()
                say(f"stopped; {_how_to_go_on(live.trials, store.shown, name)}", err=True)

            def watch(progress: Progress) -> None:
                live.update(progress)
                interruption.raise_if_requested()

            interruption.defer(say_stopped)
            try:
                done = run_study(store, name, trials, workers, engine, ray_address, watch, patience, until)
            except WorkerError as problem:
                raise WorkerError(f"{problem}; {_how_to_go_on(live.trials, store.shown, name)}") from None
            except KeyboardInterrupt:
                interruption.say_last_words()
                raise click.exceptions.Exit(128 + interruption.number) from None
        if 0 < before == done.trials:
            say(f"study '{name}' was finished already; trials in {store.shown}: {before}", err=True)
        shown = print_study(store, name)
        if until is not None:
            say(describe_reached(shown, until))
        if shown["verdict"] == "not found":
            raise click.exceptions.Exit(NOT_FOUND)


def _how_to_go_on(trials: int, storage: str, name: str) -> str:
    return f"{trials} trials are in {storage}; go on with: metaid study run {shlex.quote(name)}"


@study.command(epilog="\b\nExample:\n  metaid study delete three-link --yes")
@name_argument
@storage_option
@click.option("--yes", is_flag=True, help="Do not ask.")
def delete(name: str, storage: str, yes: bool) -> None:
    """Delete a study and its trials from the DB."""
    from metaid.study import delete_study

    with open_store(storage) as store:
        store.spec(name)  # refuses a name that is not there before asking
        if not yes:
            click.confirm(printable(f"Delete study '{name}' from {store.shown}?"), abort=True, err=True)
        delete_study(store, name)
        show.delete_companion(store, name)
    say(f"study '{name}' is deleted")
