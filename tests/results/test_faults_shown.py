"""What a study says of the faults that it searched, and which it refuses to search."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from chain_studies import chain_study, random_chain

from metaid.cli.printed import print_study
from metaid.errors import StudyError
from metaid.frames import json_rows
from metaid.results import identified_model, lumps_frame, read_findings, read_snapshot, summary
from metaid.results.lump_tables import fault_table
from metaid.show.notes import note
from metaid.store import Store
from metaid.study import Problem, StudySpec, create_study, load_study, run_study
from metaid.study.estimates import estimate_of

pytestmark = pytest.mark.slow


def late_and_tilted(
    *kinds: str,
    takes_up: bool = False,
    faults: dict[str, Any] | None = None,
    nlink: int = 2,
    trials: int = 2,
    **link: float,
) -> StudySpec:
    """A study of `nlink` links that searches faults of some `kinds`, or `takes_up` faults by itself. Torques come 4 ms
    late, and the base is tilted by 10 mrad, unless other `faults` are given.
    """
    faults = {"angle_noise": 1e-3, "speed_sensor": False, "delay": 2, "tilt": 0.01} if faults is None else faults
    estimate = {"faults": "proposed" if takes_up else list(kinds)}
    settings: dict[str, Any] = {"trials": trials, "seed": 1, "episode": {"measure": "smoothed"}, "estimate": estimate}
    return chain_study(random_chain(nlink, 1), faults, link, **settings)


def run(store: Store, spec: StudySpec) -> dict[str, Any]:
    """What `study show --json` says of it once it is run."""
    create_study(store, spec)
    run_study(store, spec.name)
    return summary(store, spec.name)


def test_faults_stand_beside_the_lumps_wherever_a_study_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In JSON, in the terminal, in the verdict there, and in the dashboard's note."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    shown = run(store, late_and_tilted("delay", "tilt"))
    delay, tilt = shown["faults"]
    assert shown["verdict"] == "found"
    assert (delay["name"], delay["unit"], delay["true"]) == ("delay", "s", 0.004)
    assert (tilt["name"], tilt["unit"], tilt["true"]) == ("tilt", "rad", 0.01)
    for fault in (delay, tilt):
        assert fault["determined"]
        assert fault["low"] < fault["identified"] < fault["high"]
        assert fault["error"] == fault["identified"] - fault["true"]
        assert abs(fault["error"]) < 4.0 * fault["sd"] < 0.01 * fault["true"]
    assert json.loads(json.dumps(shown))["faults"] == shown["faults"]
    print_study(store, "chain")
    printed = capsys.readouterr().out
    assert "Faults searched beside the lumps" in printed
    assert f"- delay {delay['identified']:.4g} ± " in printed
    assert "| fault | identified |" in note(read_findings(store, "chain"))
    model = identified_model(read_snapshot(store, "chain"))
    for suffix in (".toml", ".xml", ".urdf", ".py", ".h"):
        assert "found beside it, and not in it: delay 0.004 s, tilt 0.01 rad" in " ".join(model.text(suffix).split())


def test_what_the_plant_file_says_of_a_searched_fault_is_not_believed() -> None:
    """The twin of a plant whose delay is searched has none at first; otherwise it has the one that is in the file."""
    searched, believed = (Problem(late_and_tilted(*kinds)).experiment() for kinds in (("delay",), ()))
    assert (searched.loop.delay, believed.loop.delay) == (0, 2)


def test_friction_without_a_nominal_value_is_found_on_a_plant_without_other_faults(tmp_path: Path) -> None:
    """Its readings are kept because faults are searched, and agree with the twin to rounding."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    shown = run(store, late_and_tilted("viscous", faults={}, damping=0.02))
    assert shown["verdict"] == "found"
    assert shown["max_error"] < 1e-6
    assert [fault["identified"] for fault in shown["faults"]] == pytest.approx([0.02, 0.02], rel=1e-6)
    model = identified_model(read_snapshot(store, "chain"))
    assert model.torque([0.0, 0.0], [1.0, -2.0]) == pytest.approx([0.02, -0.04], rel=1e-3)
    assert [link["damping"] for link in model.links] == pytest.approx([0.02, 0.02], rel=1e-3)


def test_fault_that_is_not_explained_has_no_interval(tmp_path: Path) -> None:
    """Where a tilt is there and a delay is searched: the reason proposes to search both."""
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        create_study(store, late_and_tilted("delay", nlink=1))
        run_study(store, "chain")
        snapshot = read_snapshot(store, "chain")
    verdict, estimate = snapshot.verdict, snapshot.estimate
    (delay,) = json_rows(fault_table(snapshot, False))
    assert verdict.word == "approximate"
    assert delay["identified"] is not None
    assert delay["sd"] is delay["low"] is delay["high"] is None
    assert estimate is not None
    reason = " ".join(verdict.reasons)
    assert "the model does not explain what was seen, but with a tilt of " in reason
    assert 'set [estimate] faults = ["delay", "tilt"]' in reason
    assert estimate.proposal is not None


def test_fault_that_explains_the_trials_is_taken_up(tmp_path: Path) -> None:
    """It stands beside the lumps with its interval, and the reasons say what the misfit is without it."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    noise = {"angle_noise": 1e-3, "speed_sensor": False}
    shown = run(store, late_and_tilted(takes_up=True, faults={**noise, "delay": 4}))
    (delay,) = shown["faults"]
    taken = shown["estimate"]["taken_up"]
    assert shown["verdict"] == "found"
    assert delay["true"] == 0.008
    assert delay["low"] < delay["identified"] < delay["high"]
    assert abs(delay["error"]) < 4.0 * delay["sd"] < 0.01 * delay["true"]
    assert shown["max_error"] < 0.01
    assert shown["reasons"][0].startswith("the study took up a delay of 8 ms: with that the misfit falls from ")
    assert taken["faults"] == ["delay"]
    assert taken["misfit_without"] > 10.0 * shown["misfit"]
    assert not taken["rivals"]
    assert lumps_frame(store, "chain").attrs["faults"] == shown["faults"]


def test_estimate_begins_with_that_of_the_first_trials_that_show_something(tmp_path: Path) -> None:
    """Where all pushes of the first trial fell at once, that of the first two: faults are looked for once."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    late = {"angle_noise": 1e-3, "speed_sensor": False, "delay": 4}
    run(store, late_and_tilted(takes_up=True, faults=late, trials=3))
    estimate = read_snapshot(store, "chain").estimate
    assert estimate is not None
    experiment, (first, *others) = estimate.seen()
    experiment, trials = replace(experiment, remembered={}), (replace(first, steps=0 * first.steps), *others)
    found = estimate_of(experiment, trials)
    begun = experiment.estimate(trials[:2])
    assert found is not None
    assert found.taken_up.kinds == begun.faults.searched.kinds == ("delay",)
    assert list(experiment.remembered.values()) == [None, begun]


def test_no_fault_is_taken_up_where_none_is_needed(tmp_path: Path) -> None:
    """A study of a plant that has none searches none."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    shown = run(store, late_and_tilted(takes_up=True, faults={"angle_noise": 1e-3}, nlink=1))
    assert shown["verdict"] == "found"
    assert shown["faults"] == []
    assert "taken_up" not in shown["estimate"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"estimate.faults": ["tilt", "offset"]}, "move alike .allowed: tilt, or offset"),
        ({"estimate.faults": ["delay", "delay"]}, "names a fault twice .allowed: each once"),
        ({"estimate.faults": ["late"]}, "'delay', 'lag', 'tilt', .* or 'limit'"),
        ({"estimate.faults": ["delay"], "estimate.enabled": False}, "only an estimate finds them"),
        ({"estimate.faults": ["delay"], "estimate.compare": "count"}, "counts do not show them"),
        (
            {"estimate.faults": ["viscous"], "estimate.lumps": ["gravity", "inertia", "damping"]},
            "already searched, as the lumps 'damping' .allowed: one of them",
        ),
        ({"estimate.torque_limit": 5.0}, "torque_limit: only an estimate from readings knows of it .allowed: on a rig"),
    ],
)
def test_faults_that_cannot_be_searched_are_refused(changes: dict[str, Any], message: str) -> None:
    """In one line that says what is allowed."""
    with pytest.raises(StudyError, match=message):
        load_study("three-link-coast", changes)


@pytest.mark.parametrize("change", [{"estimate.torque_limit": [5.0, 4.0]}, {"estimate.enabled": False}])
def test_torque_limit_that_is_not_of_every_joint_or_that_nothing_uses_is_refused(change: dict[str, Any]) -> None:
    """Nobody is to believe that it counts where it does not."""
    with pytest.raises(StudyError, match=r"torque_limit.*allowed: (one, or 3|on a rig)"):
        load_study("noisy-three-link", {"estimate.torque_limit": 5.0, **change})


def test_gain_of_the_only_motor_is_refused() -> None:
    """All lumps times the same would move alike."""
    with pytest.raises(StudyError, match=r"cannot be told from the lumps.*two joints or more"):
        load_study("one-link-count", {"estimate.faults": ["gain"]})


def test_friction_of_an_arm_is_no_fault() -> None:
    """It is among the base parameters, and the message says so."""
    with pytest.raises(StudyError, match=r"rotors of an arm's joints are among its base parameters.*allowed: delay"):
        load_study("scara", {"estimate.faults": ["viscous"]})
