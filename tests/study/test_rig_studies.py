"""Studies of a plant behind a socket: the trials of the built-in one, whatever goes wrong meanwhile."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import optuna
import pytest
from conftest import Finished
from places import ROOT
from rig import Serve, Server

import metaid
from metaid.episode import run_stepwise
from metaid.errors import AbsentPlant, StudyError
from metaid.study import Problem, load_study

pytestmark = pytest.mark.slow

TRIALS_ALONE = {"estimate.enabled": False}  # where only trials are looked at


def rig_files(folder: Path, server: Server, trials: int = 9, more: str = "") -> Path:
    """A plant file for the rig, and a study of it with the nominal model of `two-link-tpe`."""
    (folder / "rig.toml").write_text(
        f'socket = "{server.address}"\njoints = 2\nstep_timeout = 60.0\nmotion = "stepped"\n{more}'
    )
    nominal = (ROOT / "studies" / "two-link-tpe.toml").read_text().partition("[[nominal.links]]")
    head = f'plant = "rig.toml"\nsampler = "cmaes"\nseed = 1\ntrials = {trials}\n'
    (folder / "find-rig.toml").write_text(head + nominal[1] + nominal[2])
    return folder / "find-rig.toml"


def test_plant_behind_a_socket_gives_the_trials_of_the_built_in_one(serve: Serve, tmp_path: Path) -> None:
    """The same MuJoCo model stepped by another process, its connection lost twice: every factor is the same to the
    last bit, and every value is to the last bit that of the plain loop (the compiled one rounds its sums otherwise).
    """
    server = serve("--body", "mujoco", "--watchdog", "60", "--fault", "drop@700", "--fault", "late@2500")
    study = load_study(rig_files(tmp_path, server), TRIALS_ALONE)
    found = metaid.run(study, storage=str(tmp_path / "rig.db"))
    changes = {"sampler": "cmaes", "trials": 9, "search.widen": False, **TRIALS_ALONE}  # no bound of a rig is moved
    metaid.run(load_study("two-link-tpe", changes), name="built-in", storage=str(tmp_path / "built-in.db"))
    rig = metaid.trials("find-rig", str(tmp_path / "rig.db"))
    built_in = metaid.trials("built-in", str(tmp_path / "built-in.db"))
    assert (rig["state"] == built_in["state"]).all()
    numbers = [column for column in rig.columns if column != "state"]
    exact = [column for column in numbers if column != "value"]
    assert (rig[exact].to_numpy() == built_in[exact].to_numpy()).all()
    assert rig["value"].to_numpy() == pytest.approx(built_in["value"].to_numpy(), rel=1e-14)
    problem = Problem(load_study("two-link-tpe", changes))
    plant, nominal = problem.open_plant(), problem.nominal.lumps
    for number in (0, 4, 8):
        record, _ = run_stepwise(plant, nominal.scaled(rig.loc[number, problem.names].to_numpy(float)), problem.episode)
        assert rig.loc[number, "value"] == problem.measure.value(record, problem.episode)
    assert found["true"].isna().all()
    assert server.stops.count("the connection ended") == 2


def test_study_of_a_rig_is_run_shown_and_reported_without_calling_it_again(
    serve: Serve, metaid: Callable[..., Finished], tmp_path: Path
) -> None:
    """After the run the rig may be switched off: tables, report, figures and the finished run need no plant."""
    server = serve("--stepped", "--watchdog", "60")
    rig_files(tmp_path, server, trials=3)
    assert metaid("plant", "show", "rig.toml").status == 0
    assert metaid("study", "check", "find-rig.toml").status == 0
    assert metaid("study", "create", "find-rig.toml").status == 0
    assert metaid("study", "run", "find-rig").status == 0
    server.process.kill()
    server.process.wait()
    shown = json.loads(metaid("study", "show", "find-rig", "--json").out)
    assert shown["trials"]["total"] == 3
    assert all(lump["true"] is None for lump in shown["lumps"])
    assert metaid("study", "run", "find-rig").status == 0
    assert metaid("study", "report", "find-rig", "-o", "report.html").status == 0
    assert "A rig, drawn by the nominal model" in Path("report.html").read_text()
    gone = metaid("study", "run", "find-rig", "--trials", "20")
    assert gone.status == 2
    assert "no connection to tcp://" in gone.err
    assert len(gone.err.splitlines()) == 1
    assert json.loads(metaid("study", "show", "find-rig", "--json").out)["trials"]["total"] == 3


def test_candidate_that_loses_the_rig_every_time_fails_and_the_run_goes_on(serve: Serve, tmp_path: Path) -> None:
    """Three tries; then the trial is FAIL with its reason, and the next candidate has its turn."""
    path = str(tmp_path / "rig.db")
    server = serve("--body", "mujoco", "--watchdog", "60", *(f"--fault=drop@{step}" for step in (2000, 2001, 2002)))
    metaid.run(load_study(rig_files(tmp_path, server, trials=8), TRIALS_ALONE), storage=path)
    trials = metaid.trials("find-rig", path)
    failed = trials[trials["state"] == "FAIL"]
    assert len(trials) == 8
    assert len(failed) == 1
    reason = (
        optuna.load_study(study_name="find-rig", storage=f"sqlite:///{path}")
        .trials[failed.index[0]]
        .user_attrs["reason"]
    )
    assert "the connection was closed; the episode was tried 3 times" in reason
    assert (trials["state"].iloc[failed.index[0] + 1 :] != "FAIL").all()


def test_run_ends_where_the_rig_dies_and_goes_on_from_there(serve: Serve, tmp_path: Path) -> None:
    """Every episode before it is in the DB, in mid-generation too; in the end the trials are those of a run that was
    never stopped.
    """
    path, listen = str(tmp_path / "rig.db"), f"unix:{tmp_path / 'rig.sock'}"
    dying = serve("--body", "mujoco", "--watchdog", "60", "--fault=die@2500", listen=listen)
    study = load_study(rig_files(tmp_path, dying), TRIALS_ALONE)
    with pytest.raises(AbsentPlant, match=r"no connection to unix:.*tried 3 times"):
        metaid.run(study, storage=path)
    kept = metaid.trials("find-rig", path)
    assert len(kept) == int(kept["steps"].cumsum().searchsorted(2500))
    assert len(kept) % 7 > 0
    serve("--body", "mujoco", "--watchdog", "60", listen=listen)
    metaid.run(study, storage=path)
    changes = {"sampler": "cmaes", "trials": 9, "search.widen": False, **TRIALS_ALONE}
    metaid.run(load_study("two-link-tpe", changes), name="built-in", storage=path)
    again, built_in = metaid.trials("find-rig", path), metaid.trials("built-in", path)
    assert (again[["gravity_1", "steps"]] == built_in[["gravity_1", "steps"]]).all(axis=None)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"workers": 2}, "is one rig: workers is 2"),
    ],
)
def test_setting_that_a_rig_has_no_use_for_is_refused(
    serve: Serve, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    """One body, one worker; no physics but its own."""
    with pytest.raises(StudyError, match=message):
        load_study(rig_files(tmp_path, serve()), changes)


def test_more_workers_than_bodies_are_refused(serve: Serve, metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """Also when the run asks for them; drawing and filming, which need a simulation, say so."""
    rig_files(tmp_path, serve())
    assert metaid("study", "create", "find-rig.toml").status == 0
    assert "one rig: workers is 2 (allowed: 1)" in metaid("study", "run", "find-rig", "--workers", "2").err
    assert "no links to simulate or draw" in metaid("plant", "draw", "rig.toml", "-o", "rig.png").err


@pytest.mark.parametrize("address", ["127.0.0.1:5555", "tcp://host", "tcp://:1", "udp://host:1", "unix:", "tcp://a:b"])
def test_address_of_another_form_is_refused(metaid: Callable[..., Finished], tmp_path: Path, address: str) -> None:
    """In one line that says which forms there are."""
    (tmp_path / "rig.toml").write_text(f'socket = "{address}"\njoints = 2\n')
    done = metaid("plant", "show", "rig.toml")
    assert done.status == 2
    assert "rig.toml: socket:" in done.err


def test_link_that_runs_away_after_a_rich_push_has_fallen_on_a_rig(tmp_path: Path) -> None:
    """Without being asked for; not after other pushes, nor on a simulated plant unless its study says so."""
    rig = tmp_path / "rig.toml"
    rig.write_text('socket = "tcp://127.0.0.1:9"\njoints = 3\n')
    wanted: dict[str, Any] = {"plant": str(rig), "workers": 1}
    multiples = []
    for changes in (wanted, {**wanted, "episode.pushes": "tip"}, {**wanted, "episode.fall_runaway": 2.0}, {}):
        spec = load_study("three-link-coast", {**changes, "search.coordinates": "plain"})
        multiples.append(Problem(spec).episode.fall_rule.runaway)
    assert multiples == [5.0, math.inf, 2.0, math.inf]
    with pytest.raises(StudyError, match="fall_runaway"):
        load_study("three-link-coast", {"episode.fall_runaway": 1.0})


def test_study_settings_of_a_rig_keep_what_was_measured_at_it(serve: Serve, tmp_path: Path) -> None:
    """The pushes in the DB are the rig's, not the nominal model's, and their floats are exact."""
    study = rig_files(tmp_path, serve("--body", "mujoco"), trials=1)
    metaid.run(study, storage=str(tmp_path / "rig.db"))
    found = metaid.load_findings("find-rig", str(tmp_path / "rig.db"))
    built_in = Problem(load_study("two-link-tpe"))
    spec = load_study("two-link-tpe", {"sampler": "cmaes"})
    assert (found.problem.episode.pushes == Problem(spec).episode.pushes).all()
    assert (found.problem.robot.start_speeds == built_in.robot.start_speeds).all()
    assert not (Problem(load_study(study)).robot.start_speeds == built_in.robot.start_speeds).all()
