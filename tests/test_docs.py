"""The documents are true: their commands and Python blocks run, their links and pictures exist, help has examples."""

from __future__ import annotations

import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import click
import pytest
from conftest import Finished
from places import ROOT
from remembered import estimate_once

from metaid import results
from metaid.cli import app
from metaid.plant import PlantSettings, chain_of
from metaid.store import Store
from soak.lies import PLANT

DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"(<!-- not run: [^\n]+ -->\n)?^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
NO_SCREEN = "metaid plant view"
SERVES = "metaid dashboard"
RIG = "python examples/socket_rig.py"
LOG = "python examples/write_log.py"
PYTHON_FILE = re.compile(r"\b(?:benchmarks|docs|examples|metaid|soak|tests)/[\w/]+\.py\b")

Metaid = Callable[..., Finished]


def blocks(document: Path) -> Iterator[tuple[str, str]]:
    """Language and text of each block that is to be run, in order."""
    for skipped, language, text in BLOCK.findall(document.read_text(encoding="utf-8")):
        if not skipped:
            yield language, text


def serve_and_interrupt(arguments: list[str]) -> None:
    """Starts a command that serves until Ctrl-C, waits until it says where, and sends Ctrl-C."""
    program = [sys.executable, "-c", "from metaid.cli import main; main()", *arguments[:-1], "0"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            server.stdout.readline()
            assert "http://127.0.0.1:" in server.stdout.readline()
        finally:
            server.send_signal(signal.SIGINT)
        server.stdout.read()
    assert server.returncode == 130


@pytest.fixture
def rigs() -> Iterator[list[subprocess.Popen[str]]]:
    """Example rigs that a document starts; ended after it."""
    started: list[subprocess.Popen[str]] = []
    yield started
    for rig in started:
        with rig:
            rig.kill()


def start_rig(command: str) -> subprocess.Popen[str]:
    """The example rig as a document starts it, listening."""
    _, script, *arguments = shlex.split(command)
    log = Path("rig.log")
    with log.open("w") as output:
        rig = subprocess.Popen([sys.executable, str(ROOT / script), *arguments], stdout=output, text=True)
    while "listening at" not in log.read_text():
        assert rig.poll() is None
        time.sleep(0.02)
    return rig


def write_log(command: str) -> None:
    """The log of a simulated rig, as the example writes it."""
    _, script, *arguments = shlex.split(command)
    subprocess.run([sys.executable, str(ROOT / script), *arguments], check=True)


def run_command(metaid: Metaid, command: str) -> None:
    """One line of a document, as typed after the prompt."""
    name, *arguments = shlex.split(command, comments=True)
    assert name == "metaid", f"only metaid's own commands are run here: mark '{command}' with <!-- not run: why -->"
    if command.startswith(SERVES):
        serve_and_interrupt(arguments)
        return
    done = metaid(*arguments)
    if done.status != 0 and "nothing on this machine can render" in done.err:
        return  # tests/test_video.py asserts that the machine that checks can
    if command.startswith(NO_SCREEN):
        assert "there is no screen here" in done.err
        return
    assert done.status == 0, f"{command}: {done.err}"


@pytest.mark.slow
@pytest.mark.usefixtures("few_candidates")
@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_block_runs(
    metaid: Metaid, monkeypatch: pytest.MonkeyPatch, document: Path, rigs: list[subprocess.Popen[str]]
) -> None:
    """Files are written, commands and Python run, in order and in one empty folder."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    estimate_once(monkeypatch)
    names: dict[str, object] = {}
    for language, text in blocks(document):
        if language == "toml":
            name = re.match(r"# (\S+\.toml)\n", text)
            assert name, f"a TOML block begins with '# FILE.toml': {text[:60]}"
            Path(name[1]).write_text(text)
        elif language == "xml":
            name = re.match(r"<!-- (\S+\.(?:xml|urdf)) -->\n", text)
            assert name, f"an XML block begins with '<!-- FILE.xml -->': {text[:60]}"
            Path(name[1]).write_text(text)
        elif language == "console":
            for line in text.splitlines():
                assert line.startswith("$ "), f"a console block holds commands alone: {line}"
                if line.startswith(f"$ {RIG}"):
                    rigs.append(start_rig(line[2:]))
                elif line.startswith(f"$ {LOG}"):
                    write_log(line[2:])
                else:
                    run_command(metaid, line[2:])
        elif language == "python":
            exec(compile(text, document.name, "exec"), names)
    if document.name == "your-rig.md":
        assert_rig_is_found_as_it_says(document.read_text(encoding="utf-8"))


def assert_rig_is_found_as_it_says(text: str) -> None:
    """All lumps, as near as it says, with intervals that hold the truth, which the rig's side alone knows."""
    said = re.search(r"It finds all five lumps to ([\d.]+) %: (.*?)\.\s`output-error`", text, re.DOTALL)
    assert said is not None
    stated = [float(number) for number in re.findall(r"\d+\.\d+", said[2])]
    kinds = ("gravity", "coriolis", "inertia")
    true = chain_of(PlantSettings.model_validate(PLANT).links).lumps_of(kinds).vector_of(kinds)
    with closing(Store("metaid.db")) as store:
        lumps = results.lumps_frame(store, "find-rig")
    assert ((lumps["low"] <= true) & (lumps["high"] >= true)).all()
    assert lumps["identified"].tolist() == pytest.approx(stated, abs=5e-5)
    assert (lumps["identified"] / true - 1.0).abs().max() < 0.01 * float(said[1])


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_and_pictures_exist(document: Path) -> None:
    """Every relative link leads to a file of the repository."""
    text = document.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if "://" not in target:
            assert (document.parent / target).exists(), target


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.stem)
def test_python_files_that_a_document_names_exist(document: Path) -> None:
    """A module or a test that moves takes its mention along."""
    named = PYTHON_FILE.findall(document.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_pictures_are_small() -> None:
    """A newcomer with a slow line sees them: 150 kB each, 1 MB for a film."""
    for path in (ROOT / "docs" / "images").iterdir():
        assert path.stat().st_size < (1_000_000 if path.suffix == ".gif" else 150_000), path.name


def commands(group: click.Group = app, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command and group of the command line."""
    yield above
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, (*above, name))
        else:
            yield (*above, name)


@pytest.fixture(scope="module")
def three_link(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB in which the study that examples are about has been run, and the log of a rig beside it."""
    from metaid import run

    path = tmp_path_factory.mktemp("examples") / "metaid.db"
    run("three-link", storage=str(path))
    write_log(f"{LOG} three-link --seconds 3 -o {path.with_name('log.csv')}")
    return path


def examples_of(shown: str) -> list[str]:
    """The commands under "Example" in a help."""
    return [line.strip() for line in re.findall(r"^ +metaid .*$", shown.partition("Example")[2], re.MULTILINE)]


def commands_of_documents() -> set[str]:
    """Every line that `test_every_block_runs` runs."""
    consoles = [text for path in DOCUMENTS for language, text in blocks(path) if language == "console"]
    return {line[2:] for text in consoles for line in text.splitlines()}


@pytest.mark.slow
@pytest.mark.usefixtures("few_candidates")
@pytest.mark.parametrize("command", list(commands()), ids=" ".join)
def test_help_fits_a_screen_and_its_example_runs(
    metaid: Metaid, three_link: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    """At most 30 lines of 80 columns; what stands under "Example" works as it stands. What a document runs, or the help
    of metaid itself has, is run there; here only where an example after it needs it.
    """
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    estimate_once(monkeypatch)
    shown = metaid(*command, "--help").out
    assert len(shown.splitlines()) <= 30
    assert max(map(len, shown.splitlines())) <= 80
    examples = examples_of(shown)
    assert examples
    elsewhere = commands_of_documents() | set(examples_of(metaid("--help").out) if command else [])
    while examples and examples[-1] in elsewhere:
        examples.pop()
    if not any(example == "metaid study create three-link" for example in examples):
        shutil.copy(three_link, "metaid.db")
        shutil.copy(three_link.with_name("log.csv"), "log.csv")
    for example in examples:
        run_command(metaid, example)
