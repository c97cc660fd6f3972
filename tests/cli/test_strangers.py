"""Files and DBs from strangers can do no harm: they name nothing outside their folder, run nothing, show as text."""

from __future__ import annotations

import ast
import json
import os
import pickle
import shutil
import sqlite3
import urllib.request
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import optuna
import pandas as pd
import pytest
from browser import served
from conftest import Finished

import metaid as package
from metaid.store import Store

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]

LINK = "[[links]]\nlength = 0.5\nmass = 1.0\n"
STUDY = 'trials = 60\nplant = "{plant}"\nnominal = "{nominal}"\n'


@pytest.fixture
def secret(tmp_path: Path, metaid: Metaid) -> Path:
    """A plant file outside the folder `theirs`, which has one of its own, another in a sub-folder, and two links out
    of it.
    """
    outside = tmp_path / "secret.toml"
    outside.write_text(LINK)
    (tmp_path / "theirs" / "parts").mkdir(parents=True)
    for own in ("theirs/own.toml", "theirs/parts/arm.toml"):
        (tmp_path / own).write_text(LINK)
    (tmp_path / "theirs" / "link.toml").symlink_to(outside)
    (tmp_path / "theirs" / "way").symlink_to(tmp_path, target_is_directory=True)
    return outside


@pytest.mark.parametrize("key", ["plant", "nominal"])
@pytest.mark.parametrize(
    "name", ["../secret.toml", "parts/../../secret.toml", "ABSOLUTE", "link.toml", "way/secret.toml"]
)
def test_study_file_names_nothing_outside_its_folder(metaid: Metaid, secret: Path, key: str, name: str) -> None:
    """Not upwards, not from the root, not by a symbolic link; nothing of the file is told."""
    named = {"plant": "own.toml", "nominal": "own.toml", key: str(secret) if name == "ABSOLUTE" else name}
    Path("theirs/study.toml").write_text(STUDY.format(**named))
    answered = metaid("study", "create", "theirs/study.toml")
    assert answered.status == 2
    assert "outside the file's own folder" in answered.err
    assert answered.err.count("\n") == 1
    assert not Path("metaid.db").exists()


@pytest.mark.parametrize("plant", ["own.toml", "parts/arm.toml", "one-link"])
def test_study_file_names_what_is_in_its_folder_or_shipped(metaid: Metaid, secret: Path, plant: str) -> None:
    """Relative to the file, wherever the user is."""
    Path("theirs/study.toml").write_text(STUDY.format(plant=plant, nominal="own.toml"))
    assert metaid("study", "check", "theirs/study.toml").status == 0


HINGE = '<joint axis="0 1 0"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>'
BODY = f"<worldbody><body>{HINGE}</body></worldbody>"
OUT_OF_IT = {
    "include": f'<mujoco>{BODY}<include file="../secret.xml"/></mujoco>',
    "include within an include": f'<mujoco>{BODY}<include file="parts/part.xml"/></mujoco>',
    "mesh": f'<mujoco>{BODY}<asset><mesh name="m" file="../secret.stl"/></asset></mujoco>',
    "folder of meshes": f'<mujoco><compiler meshdir=".."/>{BODY}<asset><mesh file="secret.stl"/></asset></mujoco>',
    "link": f'<mujoco>{BODY}<asset><mesh name="m" file="link.stl"/></asset></mujoco>',
    "height field": f'<mujoco>{BODY}<asset><hfield name="h" size="1 1 1 1" file="/ROOT/secret.stl"/></asset></mujoco>',
    "model": f'<mujoco>{BODY}<asset><model name="m" file="../secret.xml"/></asset></mujoco>',
    "package": (
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="package://secret.stl"/></geometry></visual>'
        "</link></robot>"
    ),
}


@pytest.mark.parametrize("name", OUT_OF_IT)
@pytest.mark.parametrize("by_plant_file", [True, False])
def test_arm_that_a_study_names_has_no_part_outside_the_studys_folder(
    metaid: Metaid, secret: Path, name: str, by_plant_file: bool
) -> None:
    """Neither its own file nor what that includes; the user who names the arm himself may have parts anywhere."""
    theirs, kind = secret.parent / "theirs", "urdf" if name == "package" else "mjcf"
    for hidden in ("secret.xml", "secret.stl"):
        (secret.parent / hidden).write_text("<mujoco/>")
    (theirs / "link.stl").symlink_to(secret.parent / "secret.stl")
    (theirs / "parts" / "part.xml").write_text('<mujoco><include file="../secret.xml"/></mujoco>')
    arm = theirs / ("arm.urdf" if kind == "urdf" else "arm.xml")
    arm.write_text(OUT_OF_IT[name].replace("/ROOT", str(secret.parent)))
    (theirs / "arm.toml").write_text(f'{kind} = "{arm.name}"\n')
    plant = "arm.toml" if by_plant_file else arm.name
    (theirs / "study.toml").write_text(STUDY.format(plant=plant, nominal="pa10"))
    answered = metaid("study", "create", "theirs/study.toml")
    assert answered.status == 2
    assert "is outside the study's own folder (allowed: files within it)" in answered.err
    assert "outside" not in metaid("plant", "show", str(theirs / plant)).err


def test_path_on_the_command_line_is_the_users_own(metaid: Metaid, secret: Path) -> None:
    """The user may use any file, by a relative or an absolute path."""
    Path("theirs/study.toml").write_text(STUDY.format(plant="own.toml", nominal="own.toml"))
    for path in ("secret.toml", str(secret)):
        assert metaid("study", "check", "theirs/study.toml", "--set", f"plant={path}").status == 0
        assert metaid("plant", "show", path).status == 0


def test_file_too_large_for_a_person_to_have_written_is_refused_unread(metaid: Metaid) -> None:
    """A disk's worth of comments takes neither memory nor time."""
    with Path("huge.toml").open("wb") as file:
        file.truncate(1 << 40)
    answered = metaid("plant", "show", "huge.toml")
    assert answered.status == 2
    assert "too large" in answered.err


@pytest.mark.parametrize("start", ["", "[", "[[", "a = {", "a = {b = 1, ", "  "])
@pytest.mark.parametrize("part", ["a", " a\t", "'a.'", r'"a\""', "é-1"])
def test_key_of_more_parts_than_any_setting_has_is_refused_unread(metaid: Metaid, start: str, part: str) -> None:
    """The parser's memory grows with the square of them: 50 000 would take 9 GB."""
    Path("dotted.toml").write_text(f"description = '{'a.' * 100}'\n{start}{'.'.join([part] * 50_000)} = 1")
    for command in (("plant", "show"), ("study", "create")):
        answered = metaid(*command, "dotted.toml")
        assert answered.status == 2
        assert "dotted.toml: not valid TOML: a dotted key of more than 16 parts" in answered.err


class Bait:
    """Who unpickles it makes a folder."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, ("unpickled",)


@pytest.fixture
def baited(metaid: Metaid, studied: Path) -> Path:
    """A DB with pickles wherever Optuna and its samplers keep any, in every trial and study."""
    path = Path("baited.db")
    shutil.copy(studied, path)
    bait = pickle.dumps(Bait())
    system = {
        "cma:optimizer:0": bait.hex(),
        "cma:restart:0:optimizer:0": bait.hex(),
        "grid_search:search_space": bait.hex(),
    }
    with closing(sqlite3.connect(path)) as connection:
        for table, key in (("trial", "trial_id"), ("study", "study_id")):
            ids = [
                row[0] for row in connection.execute(f"SELECT {key} FROM {'trials' if table == 'trial' else 'studies'}")
            ]
            for kind in ("system", "user"):
                rows = [(one, name, json.dumps(value)) for one in ids for name, value in system.items()]
                connection.executemany(
                    f"INSERT INTO {table}_{kind}_attributes ({key}, key, value_json) VALUES (?, ?, ?)", rows
                )
        connection.commit()
    return path


@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
def test_nothing_in_a_db_is_unpickled(metaid: Metaid, baited: Path) -> None:
    """Every command that reads a DB, going on with a study and the dashboard's pages included. The bait is a real one:
    Optuna's own CMA-ES takes it.
    """
    for asked in (
        ["list"],
        ["show", "boundary"],
        ["run", "plain", "--trials", "820"],
        ["validate", "boundary", "--pushes", "1"],
    ):
        assert metaid("study", *asked, "--storage", str(baited)).status == 0
    for ending, command in (("csv", "export"), ("html", "report")):
        assert metaid("study", command, "counted", "--storage", str(baited), "-o", f"written.{ending}").status == 0
    store = Store(str(baited))
    with served(store) as address:
        number = store.optuna.get_study_id_from_name("boundary")
        for page in (
            "/api/studies",
            "/api/studies/1",
            f"/api/studies/{number}",
            f"/api/studies/{number}/param_importances",
        ):
            with urllib.request.urlopen(address + page) as answer:
                assert answer.status == 200
    assert not Path("unpickled").exists()
    study = optuna.load_study(study_name="boundary", storage=store.optuna, sampler=optuna.samplers.CmaEsSampler())
    study.ask(study.trials[0].distributions)
    assert Path("unpickled").exists()
    store.close()


FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal", "joblib", "yaml", "xmlrpc"}
FORBIDDEN_CALLS = {
    "eval",
    "exec",
    "compile",
    "__import__",
    "system",
    "popen",
    "loads_pickle",
    "read_pickle",
    "getoutput",
}


@pytest.mark.parametrize("source", sorted(Path(package.__file__).parent.rglob("*.py")), ids=lambda path: path.stem)
def test_source_has_neither_pickle_nor_eval_nor_shell(source: Path) -> None:
    """No module of ours imports, calls or asks for any; numpy is not allowed to either."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert not {alias.name.partition(".")[0] for alias in node.names} & FORBIDDEN_MODULES
        elif isinstance(node, ast.ImportFrom):
            assert (node.module or "").partition(".")[0] not in FORBIDDEN_MODULES
        elif isinstance(node, ast.Call):
            called = node.func
            name = (
                called.id if isinstance(called, ast.Name) else called.attr if isinstance(called, ast.Attribute) else ""
            )
            of_ours = isinstance(called, ast.Attribute) and name == "compile"  # re.compile, a statement's, a model's
            assert name not in FORBIDDEN_CALLS or of_ours
            for keyword in node.keywords:
                assert not (keyword.arg in ("shell", "allow_pickle") and getattr(keyword.value, "value", True))


EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e=cmd|' /C calc'!A0"


def rename(path: Path, old: str, new: str) -> None:
    """Gives a study a name that metaid would not have let it have, as another program can."""
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE studies SET study_name = ? WHERE study_name = ?", (new, old))
        connection.commit()


def test_names_in_a_db_cannot_command_the_terminal(metaid: Metaid, studied: Path) -> None:
    """Titles, tables, JSON, errors and hints write them out; JSON still says the very name."""
    shutil.copy(studied, "evil.db")
    rename(Path("evil.db"), "counted", EVIL)
    where = "--storage", "evil.db"
    told = [
        metaid("study", "list", *where),
        metaid("study", "show", EVIL, *where),
        metaid("study", "show", EVIL, "--json", *where),
        metaid("study", "show", "nosuch", *where),
        metaid("study", "run", EVIL, "--trials", "125", *where),
        metaid("study", "delete", EVIL, "--yes", *where),
    ]
    assert [answer.status for answer in told] == [0, 0, 0, 2, 0, 0]
    assert all((answer.out + answer.err).replace("\n", "").isprintable() for answer in told)
    assert json.loads(told[2].out)["name"] == EVIL


@pytest.mark.parametrize(
    "arguments",
    [
        ("study", "create", "two-link-tpe", "--set", "episode.measure=\udced"),
        ("study", "list", "--storage", 300 * "x"),
    ],
)
def test_texts_that_no_file_could_hold_are_refused_in_a_line(metaid: Metaid, arguments: tuple[str, ...]) -> None:
    """Bytes that are not UTF-8, and a file name longer than any file system takes."""
    answered = metaid(*arguments)
    assert answered.status == 2
    assert answered.err.count("\n") == 1


def test_export_has_numbers_and_states_only(metaid: Metaid, studied: Path) -> None:
    """No cell is text of a stranger's, which a spreadsheet could take for a formula."""
    shutil.copy(studied, "evil.db")
    rename(Path("evil.db"), "plain", "=1+1")
    assert metaid("study", "export", "=1+1", "--storage", "evil.db", "-o", "t.csv").status == 0
    table = pd.read_csv("t.csv")
    assert set(table.pop("state")) == {"COMPLETE", "PRUNED"}
    assert all(pd.api.types.is_numeric_dtype(kind) for kind in table.dtypes)
    assert all(name.isidentifier() for name in table.columns)


def test_hint_of_what_to_run_next_is_one_word_to_a_shell(metaid: Metaid) -> None:
    """A name is quoted where it is to be copied into a shell."""
    shown = metaid("study", "create", "one-link-count", "--name", "$(touch owned); x")
    assert shown.out.rstrip().endswith("metaid study run '$(touch owned); x'")
