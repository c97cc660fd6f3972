"""Rigs that share no code with metaid: a study by default says what it finds of them, whatever they have."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import ROOT

from benchmarks import benches
from benchmarks.bench_torque import true_torque
from benchmarks.benches import run_bench, try_bench
from metaid.exporting import file_torques
from metaid.results import identified_model
from soak.bench import Bench, Imperfections, arm_of_links, arm_of_mjcf
from soak.bench.__main__ import example_rig

TORQUES = np.random.default_rng(0).normal(scale=2.0, size=(200, 2)).tolist()


def test_chain_of_the_bench_moves_as_that_of_the_example() -> None:
    """By equations of another kind, Kane's in space and Lagrange's in the plane."""
    plant: dict[str, Any] = tomllib.loads((ROOT / "plants" / "two-link.toml").read_text())
    bench = Bench(arm_of_links(plant), 0.002, Imperfections(), is_planar=True)
    links = example_rig().Links({**plant, "timestep": 0.002}, False)
    for body in (bench, links):
        body.push([0.3, -0.2])
        for torque in TORQUES:
            body.advance(torque)
    assert np.allclose(bench.states(), links.states(), atol=1e-7)


def test_arm_of_the_bench_moves_as_in_mujoco(tmp_path: Path) -> None:
    """With joints that are not at the origins of their bodies, and a rotor."""
    path = tmp_path / "arm.xml"
    path.write_text("""<mujoco><worldbody><body pos="0 0 0.3" quat="0.9 0.1 0.3 0.1">
    <joint axis="0 0 1" pos="0.05 0 0.02" armature="0.03"/>
    <inertial pos="0.02 0.1 0.1" mass="3" diaginertia="0.1 0.12 0.05"/>
    <body pos="0.1 0 0.25" quat="0.8 0 0.5 0.2"><joint axis="0 1 0" pos="0 0.02 0"/>
    <inertial pos="0.1 0.03 0.2" mass="2" quat="0.9 0.2 0.1 0.3" diaginertia="0.04 0.05 0.03"/></body></body>
    </worldbody></mujoco>""")
    bench = Bench(arm_of_mjcf(path), 0.002, Imperfections(), is_planar=False)
    arm = example_rig().Arm(path, 0.002)
    for body in (bench, arm):
        body.push([0.3, -0.8], [1.0, -0.5])
        for torque in TORQUES:
            body.advance(torque)
    assert np.allclose(bench.states(), arm.states(), atol=1e-6)


@pytest.mark.slow
def test_lengths_of_a_bench_that_are_wrong_and_said_to_be_exact_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """By as much as 36 mm: the verdict says what they are to blame for, and no confident number is given."""
    monkeypatch.setattr(benches, "TRIALS", 2)
    snapshot, _ = run_bench("encoders", "2", 0.002, 0, '[estimate]\nlengths = "exact"\nfaults = []\n')
    verdict = snapshot.verdict
    assert verdict.word != "found"
    assert "shows what the model has not, wrong geometry" in verdict.reasons[-1]
    assert "a chain may leave its lengths to the study" in verdict.reasons[-1]


@pytest.mark.slow
def test_rotor_of_a_bench_is_found_by_default_and_handed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 500 Hz, with encoder steps of 0.38 mrad and a nominal model that is wrong by up to 25 % in each number: with
    the rotor every file needs the torques that the bench's own equations ask for.
    """
    monkeypatch.setattr(benches, "TRIALS", 1)
    snapshot, _ = run_bench("rotors", "2", 0.002, 0)
    assert snapshot.estimate is not None
    faults = snapshot.estimate.estimate.faults
    assert dict(zip(faults.searched.names, faults.values, strict=True)) == pytest.approx({"rotor_2": 0.0057}, rel=0.01)
    model = identified_model(snapshot)
    assert model.about["verdict"] == "found"
    states = tuple(np.random.default_rng(0).normal(size=(3, 20, 2)))
    needed = true_torque({"rotors": (0.0057, 0.0057)}, "2", *states)
    for suffix in (".py", ".h", ".xml"):
        model.write(path := tmp_path / f"found{suffix}")
        torques = file_torques(path, "bench", *states, ["joint_1", "joint_2"]).torques
        assert np.allclose(torques, needed, atol=1e-3 * np.abs(needed).max())
    assert any("rotors" in lack for suffix in (".toml", ".urdf") for lack in model.lacks(suffix))


@pytest.mark.slow
def test_cogging_of_a_bench_is_found_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    """With how often it repeats in a turn: the bench adds 0.03 N m times sin (14 q + 1) in each joint. It acts by where
    a joint is, not by where an encoder has it: intervals hold.
    """
    monkeypatch.setattr(benches, "TRIALS", 2)
    judged = try_bench("cogging", "2", 0.002, 4)
    assert judged.verdict == "found"
    assert judged.worst < 1e-5
    assert judged.held == judged.lumps
    true = {"cos": 0.03 * np.sin(1.0), "sin": 0.03 * np.cos(1.0)}
    wanted = {f"cogging_{part}_{joint}": value for part, value in true.items() for joint in (1, 2)}
    assert json.loads(judged.taken_up) == pytest.approx(wanted, rel=0.02)


@pytest.mark.slow
def test_limits_of_the_torques_of_a_bench_are_found_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody has said them, and the bench cuts off what it is commanded."""
    monkeypatch.setattr(benches, "TRIALS", 1)
    judged = try_bench("limits", "2", 0.002, 0)
    assert judged.verdict == "found"
    assert judged.worst < 1e-3
    assert json.loads(judged.taken_up) == pytest.approx({"limit_1": 2.0, "limit_2": 0.5}, rel=1e-3)


@pytest.mark.slow
def test_limits_so_low_that_the_nominal_model_loses_the_plant_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """From one trial, in which most of what is commanded is cut off."""
    monkeypatch.setitem(benches.ROWS, "low", ("", benches.ENCODER | {"torque_limit": (1.2, 0.3)}))
    monkeypatch.setattr(benches, "TRIALS", 1)
    judged = benches.try_bench("low", "2", 0.002, 2)
    assert judged.verdict == "found"
    assert judged.worst < 1e-3
    assert judged.held == judged.lumps


@pytest.mark.slow
def test_bench_whose_delay_jitters_is_approximate_and_within_its_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    """The twin has a delay that does not."""
    monkeypatch.setattr(benches, "TRIALS", 1)
    judged = try_bench("delay", "2", 0.002, 0)
    assert judged.verdict == "approximate"
    assert judged.worst < 0.02
    assert judged.held == judged.lumps
    assert json.loads(judged.taken_up)["delay"] == pytest.approx(0.003, rel=0.02)


@pytest.mark.slow
def test_dry_friction_of_a_bench_is_found_though_it_builds_up_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    """It begins with none when a push strikes, has damped bristles and stiction: no push says which, and no lump pays
    for it.
    """
    monkeypatch.setattr(benches, "TRIALS", 2)
    judged = try_bench("tenth", "2", 0.002, 2)
    assert judged.misfit < 5.0
    assert judged.worst < 2e-4
    assert judged.held == judged.lumps
    assert json.loads(judged.taken_up) == pytest.approx({"dry_1": 0.016, "dry_2": 0.012}, rel=0.01)


@pytest.mark.slow
def test_stiction_of_a_bench_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """No model of metaid has it, and in an arm it hides in the noise of the encoders."""
    monkeypatch.setattr(benches, "TRIALS", 1)
    snapshot, _ = run_bench("friction", "arm", 0.002, 0)
    verdict = snapshot.verdict
    assert verdict.word == "approximate"
    assert any("stiction in joint" in reason for reason in verdict.reasons)


@pytest.mark.slow
@pytest.mark.parametrize("links", ["2", "3"])
def test_bench_whose_torques_are_rough_is_approximate_and_within_its_intervals(
    links: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their noise throws any twin far off, and lets three links fall that nobody pushes."""
    monkeypatch.setattr(benches, "TRIALS", 2)
    judged = try_bench("rough", links, 0.002, 0)
    assert judged.verdict == "approximate"
    assert judged.worst < 0.02
    assert judged.held == judged.lumps


@pytest.mark.slow
def test_bench_with_everything_on_is_approximate_and_within_its_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 1 kHz. The inertia of a rotor is nearly that of a link, so that without the rotor links seem certain that are
    wrong by a third.
    """
    monkeypatch.setattr(benches, "TRIALS", 3)
    judged = try_bench("all", "2", 0.001, 2)
    assert judged.verdict == "approximate"
    assert judged.worst < 0.05
    assert judged.held == judged.lumps
    assert "rotor_2" in judged.taken_up
