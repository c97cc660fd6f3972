"""The command line as a user meets it: what works, and what every mistake is answered with."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import optuna
import pandas as pd
import pytest
from conftest import Finished

from metaid.cli import app
from metaid.models import IDEAL
from metaid.plant import load_plant

Metaid = Callable[..., Finished]


def test_study_from_creation_to_deletion(metaid: Metaid) -> None:
    """Create, run, show, list, export, delete: each says what it did."""
    assert "metaid study run three-link" in metaid("study", "create", "three-link").out
    ran = metaid("study", "run", "three-link", "--trials", "20", "--workers", "2")
    assert ran.status == 0
    for lump in ("gravity_1", "gravity_2", "gravity_3", "coriolis_1_2", "coriolis_1_3", "coriolis_2_3"):
        assert lump in ran.out
    assert "20 trials" in ran.out
    assert "three-link" in metaid("study", "list").out
    assert metaid("study", "export", "three-link", "-o", "trials.csv").status == 0
    assert metaid("study", "export", "three-link", "-o", "trials.parquet").status == 0
    csv, parquet = pd.read_csv("trials.csv", converters={"gravity_1": float}), pd.read_parquet("trials.parquet")
    assert len(csv) == len(parquet) == 20
    assert csv["gravity_1"].to_numpy() == pytest.approx(parquet["gravity_1"].to_numpy(), abs=0)
    assert metaid("study", "delete", "three-link", "--yes").status == 0
    assert metaid("study", "show", "three-link").status == 2


def test_show_prints_the_json_of_the_contract(metaid: Metaid) -> None:
    """Exactly the agreed fields, with numbers that hang together."""
    metaid("study", "create", "three-link-coast", "--name", "mine", "--set", "trials=100", "--set", "seed=3")
    metaid("study", "run", "mine", "--quiet")
    shown = json.loads(metaid("study", "show", "mine", "--json").out)
    head = ["name", "plant", "sampler", "measure", "seed", "verdict", "reasons", "source", "misfit", "trials", "best"]
    assert list(shown) == [*head, "lumps", "max_error", "model_error", "periods", "estimate", "why_no_estimate"]
    assert (shown["verdict"], shown["reasons"], shown["source"]) == ("found", [], "estimate")
    assert (shown["name"], shown["plant"], shown["sampler"], shown["measure"], shown["seed"]) == (
        "mine",
        "three-link",
        "cmaes",
        "spectral",
        3,
    )
    assert shown["trials"]["total"] == 100 == shown["trials"]["complete"] + shown["trials"]["pruned"]
    keys = ["name", "unit", "nominal", "factor", "identified", "sd", "low", "high", "true", "error", "determined"]
    kinds = (*IDEAL, "inertia")
    true_lumps = load_plant("three-link").chain.lumps_of(kinds).vector_of(kinds)
    for lump, true in zip(shown["lumps"], true_lumps, strict=True):
        assert list(lump) == keys
        assert lump["identified"] == pytest.approx(lump["factor"] * lump["nominal"])
        assert lump["true"] == true
        assert lump["error"] == pytest.approx(lump["identified"] / true - 1)
        assert lump["low"] <= lump["identified"] <= lump["high"]
    assert shown["max_error"] == max(abs(lump["error"]) for lump in shown["lumps"])


def test_study_without_trials_shows_nulls(metaid: Metaid) -> None:
    """Nothing is identified before anything was tried."""
    metaid("study", "create", "three-link-coast")
    shown = json.loads(metaid("study", "show", "three-link-coast", "--json").out)
    assert shown["best"] == {"number": None, "value": None}
    assert {lump["identified"] for lump in shown["lumps"]} == {None}
    assert metaid("study", "show", "three-link-coast").status == 0
    assert metaid("study", "list").status == 0


def test_episode_prints_the_json_of_the_contract(metaid: Metaid) -> None:
    """Over-compensated it oscillates, exactly compensated it coasts, under-compensated it falls."""
    keys = ["plant", "steps", "fell", "fall_step", "periods", "frequency_hz", "spectral_hz"]
    over, exact, under = (
        json.loads(metaid("episode", "one-link", "--factor", f"gravity_1={factor}", "--json").out)
        for factor in (1.2, 1.0, 0.8)
    )
    assert list(over) == list(exact) == list(under) == keys
    assert over["periods"][0] >= 3
    assert over["frequency_hz"][0] == pytest.approx(over["spectral_hz"], rel=0.1)
    assert (exact["fell"], exact["periods"], exact["frequency_hz"]) == (False, [0], [0.0])
    assert exact["spectral_hz"] < 1e-6
    assert under["fell"]
    assert 0 < under["fall_step"] < under["steps"] == 5000
    assert (under["frequency_hz"], under["spectral_hz"]) == ([None], None)


def test_episode_draws_joint_angles(metaid: Metaid) -> None:
    """-o writes a picture in the format of its ending."""
    assert metaid("episode", "two-link", "--factor", "gravity_1=1.1", "-o", "angles.png").status == 0
    assert Path("angles.png").read_bytes().startswith(b"\x89PNG")
    assert metaid("episode", "two-link", "-o", "angles.svg").status == 0
    assert "<svg" in Path("angles.svg").read_text()


def test_plants_are_listed_and_shown(metaid: Metaid) -> None:
    """Every shipped plant has a line, and shows its links and lumps."""
    listed = metaid("plant", "list").out
    for name, links in (("one-link", 1), ("two-link", 2), ("three-link", 3), ("five-link", 5), ("ten-link", 10)):
        assert name in listed
        shown = json.loads(metaid("plant", "show", name, "--json").out)
        assert len(shown["links"]) == links
        assert len(shown["lumps"]) == links * (links + 1) // 2
        assert metaid("plant", "show", name).status == 0


def test_plant_and_study_of_ones_own(metaid: Metaid) -> None:
    """Files in the user's folder work by path, a plant's path being relative to its study."""
    Path("rig").mkdir()
    Path("rig/arm.toml").write_text(
        "[[links]]\nlength = 0.5\nmass = 1.0\n[[links]]\nlength = 0.4\nmass = 0.5\ncom = 0.15\n"
    )
    Path("rig/find.toml").write_text(
        'plant = "arm.toml"\ntrials = 6\n'
        "[[nominal.links]]\nlength = 0.5\nmass = 1.2\n[[nominal.links]]\nlength = 0.4\nmass = 0.6\n"
    )
    assert metaid("study", "create", "rig/find.toml").status == 0
    assert metaid("study", "run", "find").status == 0
    shown = json.loads(metaid("study", "show", "find", "--json").out)
    assert (shown["sampler"], shown["verdict"]) == ("output-error", "found")


def test_storage_comes_from_the_environment(metaid: Metaid, monkeypatch: pytest.MonkeyPatch) -> None:
    """METAID_STORAGE names the DB for every command."""
    monkeypatch.setenv("METAID_STORAGE", "sqlite:///elsewhere.db")
    metaid("study", "create", "three-link-coast")
    assert Path("elsewhere.db").exists()
    assert not Path("metaid.db").exists()
    assert "three-link-coast" in metaid("study", "list").out


def test_creating_again_is_fine_only_if_asked_for_and_the_same(metaid: Metaid) -> None:
    """--exist-ok accepts the very same study and no other."""
    metaid("study", "create", "three-link-coast")
    assert metaid("study", "create", "three-link-coast", "--exist-ok").status == 0
    other = metaid("study", "create", "three-link-coast", "--exist-ok", "--set", "seed=2")
    assert other.status == 2
    assert "made from other settings" in other.err


def test_running_makes_the_study_where_asked_to(metaid: Metaid) -> None:
    """`run --create` makes a study or goes on with it, and leaves no DB for a name that is unknown."""
    unknown = metaid("study", "run", "three-link-cost", "--create")
    assert unknown.status == 2
    assert "three-link-coast" in unknown.err
    assert not Path("metaid.db").exists()
    for trials in ("2", "3"):
        metaid("study", "run", "three-link-coast", "--create", "--trials", trials, "--quiet")
    assert json.loads(metaid("study", "show", "three-link-coast", "--json").out)["trials"]["total"] == 3


@pytest.mark.parametrize(
    "command", [[], ["plant"], ["plant", "show"], ["episode"], ["study"], ["study", "create"], ["study", "run"]]
)
def test_help_fits_a_screen_and_teaches_with_an_example(metaid: Metaid, command: list[str]) -> None:
    """At most 30 lines, with an example."""
    shown = metaid(*command, "--help")
    assert shown.status == 0
    assert "Example:" in shown.out
    assert len(shown.out.splitlines()) <= 30


def test_shell_completion_knows_commands_and_names(monkeypatch: pytest.MonkeyPatch, metaid: Metaid) -> None:
    """The shell is offered sub-commands and shipped plants."""
    from click.shell_completion import BashComplete

    from metaid.cli import app

    def offered(words: list[str], incomplete: str) -> set[str]:
        completion = BashComplete(app, {}, "metaid", "_METAID_COMPLETE")
        return {item.value for item in completion.get_completions(words, incomplete)}

    assert offered([], "st") == {"study"}
    assert offered(["study"], "de") == {"delete"}
    assert offered(["plant", "show"], "t") >= {"two-link", "three-link", "ten-link"}
    metaid("study", "create", "three-link-coast")
    assert offered(["study", "run"], "th") == {"three-link-coast"}


ONE_LINK = "[[links]]\nlength = 0.5\nmass = 1.0\n"
MISTAKES = {
    "no such plant": (["plant", "show", "tree-link"], "unknown plant 'tree-link'; did you mean 'three-link'?"),
    "no such plant file": (["plant", "show", "my/arm.toml"], "no plant file at my/arm.toml"),
    "malformed TOML": (["plant", "show", "malformed.toml"], "malformed.toml: not valid TOML"),
    "binary file": (["plant", "show", "binary.toml"], "binary.toml: not valid TOML"),
    "negative mass": (
        ["plant", "show", "negative.toml"],
        "links: entry 1: mass: should be greater than or equal to 0.000001, not -1.0",
    ),
    "unknown key": (["plant", "show", "unknown.toml"], "unknown key 'lenght'; did you mean 'length'?"),
    "missing key": (["plant", "show", "missing.toml"], "links: entry 1: mass: Field required"),
    "no links": (["plant", "show", "empty.toml"], "links: Field required"),
    "com beyond the link": (["plant", "show", "beyond.toml"], "com 0.6 lies beyond the link's length 0.5"),
    "step too long": (["plant", "show", "slow.toml"], "timestep 0.1 s is too long"),
    "NaN": (["plant", "show", "nan.toml"], "mass: should be a finite number"),
    "unknown lump": (["episode", "two-link", "--factor", "gravity_3=1"], "unknown lump 'gravity_3'"),
    "factor that is no number": (["episode", "two-link", "--factor", "gravity_1=big"], "'big' is not a number"),
    "factor that is not finite": (["episode", "two-link", "--factor", "gravity_1=nan"], "not a finite number"),
    "factor out of range": (["episode", "two-link", "--factor", "gravity_1=1e300"], "allowed: 0 to 1000"),
    "factor without a value": (["episode", "two-link", "--factor", "gravity_1"], "not of the form KEY=VALUE"),
    "no steps": (["episode", "two-link", "--steps", "0"], "--steps"),
    "picture of unknown format": (["episode", "two-link", "-o", "angles.bmp"], "allowed: .png, .pdf, .svg"),
    "picture in no folder": (["episode", "two-link", "-o", "nowhere/angles.png"], "no such folder"),
    "no such study file": (["study", "create", "three-lnk"], "unknown study 'three-lnk'; did you mean 'three-link'?"),
    "bounds without the start": (
        ["study", "create", "three-link-coast", "--set", "search.low=1.1"],
        "is not within its bounds",
    ),
    "push too weak to be seen": (
        ["study", "create", "one-link-count", "--set", "episode.pushes=[[1e-12]]"],
        "push 1 gives the fastest link",
    ),
    "push too strong for the timestep": (
        ["study", "create", "one-link-count", "--set", "episode.pushes=[[0.01], [1e3]]"],
        "push 2 gives the fastest link",
    ),
    "zero trials": (
        ["study", "create", "three-link-coast", "--set", "trials=0"],
        "trials: should be greater than or equal to 1",
    ),
    "unknown sampler": (
        ["study", "create", "three-link-coast", "--set", "sampler=cmas"],
        "unknown sampler 'cmas'; did you mean",
    ),
    "unknown setting": (
        ["study", "create", "three-link-coast", "--set", "trails=3"],
        "unknown key 'trails'; did you mean 'trials'?",
    ),
    "storage that is no DB": (["study", "create", "three-link-coast", "--storage", "malformed.toml"], "not a study DB"),
    "storage that is another DB": (
        ["study", "create", "three-link-coast", "--storage", "other.db"],
        "but not a study DB",
    ),
    "storage in no folder": (
        ["study", "create", "three-link-coast", "--storage", "nowhere/metaid.db"],
        "no such folder",
    ),
    "storage that is a folder": (["study", "list", "--storage", "."], "not a file"),
    "storage that is no URL": (["study", "list", "--storage", "nosuch://x/y"], "nosuch"),
    "no storage yet": (["study", "show", "wide"], "no study DB at metaid.db"),
    "study that exists": (
        ["study", "create", "three-link-coast", "--storage", "ours.db"],
        "has a study 'three-link-coast' already",
    ),
    "study that does not": (["study", "run", "two-link", "--storage", "ours.db"], "unknown study 'two-link'"),
    "no trials to run": (["study", "run", "three-link-coast", "--storage", "ours.db", "--trials", "0"], "--trials"),
    "no workers": (["study", "run", "three-link-coast", "--storage", "ours.db", "--workers", "0"], "--workers"),
    "unknown engine": (
        ["study", "run", "three-link-coast", "--storage", "ours.db", "--engine", "rai"],
        "'local', 'ray'",
    ),
    "export of unknown format": (
        ["study", "export", "three-link-coast", "--storage", "ours.db", "-o", "t.xls"],
        ".csv, .parquet",
    ),
    "unknown command": (["study", "rum"], "unknown command 'rum'; did you mean 'run'?"),
    "unknown option": (["study", "run", "three-link-coast", "--trails", "3"], "--trails"),
    "missing name": (["study", "run"], "Missing argument"),
}


@pytest.fixture
def mistaken_files(metaid: Metaid) -> None:
    """Files to be mistaken about, in the user's folder."""
    import sqlite3

    files = {
        "malformed": "[[links]\nlength = ",
        "negative": "[[links]]\nlength = 0.5\nmass = -1.0\n",
        "unknown": "[[links]]\nlenght = 0.5\nmass = 1.0\n",
        "missing": "[[links]]\nlength = 0.5\n",
        "empty": "gravity = 9.81\n",
        "beyond": ONE_LINK + "com = 0.6\n",
        "slow": "timestep = 0.1\n" + ONE_LINK,
        "nan": "[[links]]\nlength = 0.5\nmass = nan\n",
    }
    for name, text in files.items():
        Path(f"{name}.toml").write_text(text)
    Path("binary.toml").write_bytes(bytes(range(256)))
    with sqlite3.connect("other.db") as connection:
        connection.execute("CREATE TABLE birds (name TEXT)")
    metaid("study", "create", "three-link-coast", "--storage", "ours.db")


@pytest.mark.slow
@pytest.mark.usefixtures("mistaken_files")
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_answered_in_one_line_with_status_2_and_nothing_written(metaid: Metaid, mistake: str) -> None:
    """One line on stderr that says what is wrong and what is allowed; every file is as it was."""
    arguments, message = MISTAKES[mistake]
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    answered = metaid(*arguments)
    assert answered.status == 2
    assert answered.out == ""
    assert message in answered.err
    assert answered.err.count("\n") == 1
    assert answered.err.startswith("metaid: ")
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_python_calls_do_what_the_commands_do(metaid: Metaid) -> None:
    """One call each, and the same numbers."""
    import metaid as package

    lumps = package.run("three-link-coast", trials=60)
    shown = json.loads(metaid("study", "show", "three-link-coast", "--json").out)
    assert lumps["identified"].tolist() == [lump["identified"] for lump in shown["lumps"]]
    assert package.lumps("three-link-coast").equals(lumps)
    assert len(package.trials("three-link-coast")) == 60
    assert package.studies()["name"].tolist() == ["three-link-coast"]
    assert package.summary("three-link-coast") == shown
    assert package.perturb("one-link", {"gravity_1": 1.2}) == json.loads(
        metaid("episode", "one-link", "--factor", "gravity_1=1.2", "--json").out
    )
    assert not package.evaluate("three-link-coast").fell
    truth = package.load_plant("three-link").true_lumps()
    assert truth is not None
    names = package.trials("three-link-coast").columns[-6:]
    nominal = package.lumps("three-link-coast")["nominal"].to_numpy()[:6]
    exact = dict(zip(names, (truth.vector / nominal).tolist(), strict=True))
    assert package.evaluate(package.load_study("three-link-coast"), exact).value < 1e-9
    assert np.isfinite(package.trials("three-link-coast")["value"]).all()


def test_public_names_are_not_hidden_by_modules() -> None:
    """Importing every module leaves each public name what it is: a function or a class, and the figures a module."""
    import importlib
    import pkgutil

    import metaid as package

    for module in pkgutil.walk_packages(package.__path__, "metaid."):
        importlib.import_module(module.name)
    assert all(callable(getattr(package, name)) for name in package.__all__ if name != "figures")
    assert package.figures.__name__ == "metaid.show.figures"


def test_list_tells_shipped_studies_and_names_plain_optuna_studies(metaid: Metaid) -> None:
    """One line for each study that is shipped; studies of the DB that metaid did not make are named below its own."""
    shipped = metaid("study", "list", "--shipped")
    assert "three-link-coast" in shipped.out
    assert "The six lumps of gravity and Coriolis forces" in shipped.out
    metaid("study", "create", "three-link")
    optuna.create_study(study_name="theirs", storage="sqlite:///metaid.db")
    optuna.create_study(study_name="three-link (thinned)", storage="sqlite:///metaid.db")
    out = metaid("study", "list").out
    assert out.splitlines()[-1] == "plain Optuna studies, which metaid did not make: theirs"


def test_best_value_below_zero_is_explained() -> None:
    """A frequency below zero is what is left where more noise was subtracted than there was."""
    from metaid.cli.printed import describe_tried

    trials = {"total": 9, "pruned": 0, "failed": 0}
    shown = {"trials": trials, "measure": "smoothed", "periods": 0, "best": {"number": 3, "value": -0.01}}
    assert "best -0.01 Hz at trial 3 (below zero: the noise" in "; ".join(describe_tried(shown))
    assert "below zero" not in "; ".join(describe_tried({**shown, "best": {"number": 3, "value": 0.01}}))


def test_lists_say_what_each_entry_is(metaid: Metaid) -> None:
    """Descriptions begin in the same place, and no summary of a command is a mere abbreviation."""
    lines = [line for line in metaid("plant", "list").out.splitlines() if " link" in line.lower()]
    assert len({line.index(word) for line in lines for word in ("One link,", "Two unequal") if word in line}) == 1
    for group in (app, *(each for each in app.commands.values() if isinstance(each, click.Group))):
        for command in group.commands.values():
            assert len(command.get_short_help_str().split()) >= 4, command.name
