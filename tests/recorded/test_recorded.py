"""What a rig's log says: unknowns with their intervals, what was held out, files to take away, and bad logs refused."""

from __future__ import annotations

import json
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w
from conftest import Finished, wrong_chain
from places import ROOT
from random_arm import wrong_tree
from swinging import log_of, swinging_arm

from metaid.models import DEVIATIONS, Array, ChainModel
from metaid.models.tree import Tree, joint_torque, planar_tree
from metaid.plant import ArmPlant, Start, load_chain, load_plant
from metaid.recorded import (
    Choices,
    LinearModel,
    LogRun,
    RecordedEstimate,
    arm_model,
    chain_model,
    estimate,
    estimate_records,
    judge_records,
)

Metaid = Callable[..., Finished]
WRITE_LOG = ROOT / "examples" / "write_log.py"
SAID = """
[[links]]
length = 0.45
mass = 1.8
com = 0.2
inertia = 0.03

[[links]]
length = 0.38
mass = 0.7
com = 0.2
inertia = 0.006
damping = 0.0
"""


@pytest.fixture(scope="module")
def arm() -> Tree:
    """A shipped arm, its friction left out."""
    return swinging_arm()


def estimated(record: LogRun, model: LinearModel, choices: Choices | None = None) -> RecordedEstimate:
    found = estimate_records([record], model, choices)
    assert judge_records(found).is_found
    return found


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log of a simulated rig of two links with 0.1 mrad of noise, and what is believed of it."""
    folder = tmp_path_factory.mktemp("rig")
    simulated_log = runpy.run_path(str(WRITE_LOG))["simulated_log"]
    simulated_log("two-link", seconds=4.0, angle_noise=1e-4).to_csv(folder / "log.csv", index=False)
    (folder / "believed.toml").write_text(SAID)
    return folder


def test_log_of_a_simulated_rig_tells_its_lumps(rig: Path) -> None:
    """All of them to 1 %, within their intervals, from nominal masses that are wrong by half."""
    found = estimate(rig / "log.csv", rig / "believed.toml", friction=["viscous"])
    lumps = load_chain("two-link").chain.lumps_of(("gravity", "coriolis", "inertia"))
    table = found.verdict.lumps.set_index("name").loc[lumps.names]
    assert found.verdict.is_found
    assert table["determined"].all()
    np.testing.assert_allclose(table["identified"], lumps.vector, rtol=0.01)
    assert (table["low"] <= lumps.vector).all()
    assert (table["high"] >= lumps.vector).all()
    assert found.estimate.held_out.relative < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_log_of_an_arm_tells_its_base_parameters_and_friction(arm: Tree, noise: float) -> None:
    """Viscous, root and offset terms and a coupled pair of motors too, 95 % intervals nearly all around the truth."""
    damping, root, offset, together = (
        np.array([0.5, 0.2, 0.1]),
        np.array([1.0, 0.5, 0.3]),
        np.array([0.3, -0.2, 0.1]),
        0.4,
    )

    def friction(speeds: Array) -> Array:
        shared = together * np.sign(speeds[:, 1:2] + speeds[:, 2:3]) * np.array([0.0, 1.0, 1.0])
        return damping * speeds + root * np.sign(speeds) * np.sqrt(np.abs(speeds)) + offset + shared

    model = arm_model(wrong_tree(arm, 0)).with_coupled(((1, 2),))
    asked = Choices(friction=("viscous", "coulomb", "root", "offset"), zeros=False)
    found = estimated(log_of(arm, noise=noise, extra=friction, seconds=5.0), model, asked)
    model = found.model
    prior = model.prior
    assert not isinstance(prior, tuple)
    bodies = prior.base.of(arm.parameters)[prior.base.columns % 13 < 11]
    true = np.concatenate([bodies, damping, np.zeros(3), root, offset, np.zeros(4)])
    true[model.names.index("coulomb2_3")] = together
    inside = np.abs(found.values - true) <= 1.96 * found.deviations + 1e-9
    assert inside.mean() >= 0.9
    assert np.abs(found.values[: len(bodies)] - bodies).max() < 0.02 * np.abs(bodies).max()


@pytest.mark.slow
def test_delay_of_the_torques_is_found(arm: Tree) -> None:
    """8 ms to 0.2 ms, and without it the bodies would be wrong."""
    record, model = log_of(arm, late=0.008, seconds=2.0), arm_model(wrong_tree(arm, 0))
    found = estimated(record, model)
    assert found.delay == pytest.approx(0.008, abs=2e-4)
    assert estimate_records([record], model, Choices(delay=0.0)).held_out.relative > 10.0 * found.held_out.relative


def test_ends_that_are_read_often_are_not_taken_for_the_whole_log(rig: Path) -> None:
    """Of a log that is read often at both ends alone, as one whose repeated rows are left out but at rest, thirds of
    all of it are held out.
    """
    log = pd.read_csv(rig / "log.csv")
    often = (log.index < 200) | (log.index >= len(log) - 200) | (log.index % 10 == 0)
    found = estimate(log[often], rig / "believed.toml", friction=["viscous"])
    times = found.estimate.logs[0].times
    assert found.verdict.is_found
    assert all(fold.rows(0, times).mean() > 0.3 for fold in found.estimate.chosen.yardstick.folds)


@pytest.mark.slow
def test_spring_that_is_left_out_is_suspected_and_widens_the_intervals() -> None:
    """Nothing is wrong beyond both deviations that is called determined, though the model has no spring; it has one
    where nothing is said.
    """
    chain = load_chain("three-link").chain
    tree = planar_tree(chain, 9.81)
    spring = np.array([0.0, 0.5, 0.0])
    record = log_of(tree, noise=1e-4)
    record = record.with_torques(
        record.torques + spring * (record.angles + 0.5 * np.diff(record.angles, axis=0, append=0))
    )
    nominal = chain_model(wrong_chain(chain, 1), 9.81)
    sprung = estimate_records([record], nominal)
    assert sprung.model.having("spring") == [1]
    assert sprung.values[sprung.model.columns["spring", 1]] == pytest.approx(0.5, rel=0.02)
    found = estimate_records([record], nominal, Choices(friction=("viscous", "coulomb")))
    verdict, true = judge_records(found), chain.lumps_of(("gravity", "coriolis", "inertia")).vector
    table = verdict.lumps[: len(true)]
    known = table["determined"].to_numpy()
    assert any("a spring of joint 2" in reason for reason in verdict.reasons)
    reach = DEVIATIONS * np.hypot(table["sd"], table["sd_systematic"])[known]
    assert (np.abs(table["identified"][known] - true[known]) <= reach).all()


@pytest.mark.slow
def test_noise_asks_for_longer_windows(arm: Tree) -> None:
    """The length of the windows follows from the noise of the angles."""
    model = arm_model(wrong_tree(arm, 0))
    asked = Choices(delay=0.0, friction=("viscous",), zeros=False)
    spans = [estimated(log_of(arm, noise=noise, seconds=2.0), model, asked).equations.span for noise in (0.0, 3e-3)]
    assert spans[0] < spans[-1]


@pytest.mark.slow
def test_held_out_third_has_no_part_in_its_prediction(arm: Tree) -> None:
    """Torques of the last third may be anything: what the other two say stays the same."""
    record, model = log_of(arm, seconds=2.0), arm_model(wrong_tree(arm, 0))
    spoiled = record.torques.copy()
    spoiled[740:] *= -3.0
    choices = Choices(span=0.1, delay=0.0, friction=("viscous",), zeros=False)
    ours, theirs = (
        estimate_records([each], model, choices).held_out.parts for each in (record, record.with_torques(spoiled))
    )
    np.testing.assert_array_equal(ours[2].values, theirs[2].values)
    assert not np.allclose(ours[0].values, theirs[0].values)


@pytest.mark.slow
def test_log_of_another_robot_is_not_found(metaid: Metaid, rig: Path) -> None:
    """With the sign of a torque wrong it says whose and what mends it, writes nothing, and the exit status is 3."""
    log = pd.read_csv(rig / "log.csv")
    log["torque_2"] *= -1.0
    log.to_csv("wrong.csv", index=False)
    given = ("wrong.csv", "--nominal", str(rig / "believed.toml"), "--friction", "viscous", "--json")
    done = metaid("estimate", *given, "-o", "m.xml")
    shown = json.loads(done.out)
    assert (done.status, shown["verdict"]) == (3, "not found")
    assert any("the torque of joint 2 has the opposite sign: --scale 2=-1" in each for each in shown["reasons"])
    assert not Path("m.xml").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "mended"),
    [
        ({"scale": {"2": -1.0}}, "--scale 2=1"),
        ({"zero": {"1": 1.5708, "2": 0.01}}, "--zero 1=0.0000"),
        ({"zero": {"1": 3.1416, "2": 0.01}}, "--zero 1=0.0000"),
        ({"reversed": ["2"]}, "no --reversed 2"),
    ],
)
def test_what_mends_a_log_is_said_beside_what_was_said_of_it(rig: Path, given: dict[str, Any], mended: str) -> None:
    """Whoever says something wrong of a log is told the whole of what is right."""
    asked = {"friction": ["viscous"], "window": 0.2, "delay": 0.0}
    found = estimate(rig / "log.csv", rig / "believed.toml", **asked, **given)
    assert not found.verdict.is_found
    assert any(reason.endswith(mended) for reason in found.verdict.reasons)
    assert mended in [fact.option for fact in found.facts]


@pytest.mark.slow
def test_model_of_a_log_is_taken_away(metaid: Metaid, rig: Path) -> None:
    """As a plant file, as MJCF and as JSON: the first two need the torque that the lumps say."""
    given = (
        "estimate",
        str(rig / "log.csv"),
        "--nominal",
        str(rig / "believed.toml"),
        "--friction",
        "viscous",
    )
    done = metaid(*given, *(text for name in ("model.toml", "model.xml", "model.json") for text in ("-o", name)))
    assert (done.status, done.err) == (0, "")
    assert "FOUND: " in done.out
    said = json.loads(Path("model.json").read_text())
    assert {"gravity_1", "damping_2"} <= {lump["name"] for lump in said["lumps"]}
    assert len(said["covariance"]["values"]) == len(said["covariance"]["names"])
    rng = np.random.default_rng(0)
    states = rng.uniform(-1.0, 1.0, (3, 20, 2))
    true = load_chain("two-link")
    expected = joint_torque(planar_tree(true.chain, true.gravity), *states)
    taken, arm = load_chain("model.toml"), load_plant("model.xml")
    assert isinstance(arm, ArmPlant)
    for tree in (planar_tree(taken.chain, taken.gravity), arm.tree):
        np.testing.assert_allclose(joint_torque(tree, *states), expected, atol=0.02 * np.abs(expected).max())


@pytest.mark.slow
def test_untrusted_torque_has_no_part_in_what_is_found(metaid: Metaid, rig: Path) -> None:
    """Whatever it is, the numbers are the same to the last bit, and what the other joint shows is right."""
    log = pd.read_csv(rig / "log.csv")
    found = []
    for size in (3.0, -1000.0):
        log.assign(torque_1=size * np.sin(7.0 * log["time"])).to_csv("log.csv", index=False)
        given = ("--nominal", str(rig / "believed.toml"), "--friction", "viscous", "--untrusted", "1", "--json")
        found.append(json.loads(metaid("estimate", "log.csv", *given).out))
    assert found[0]["parameters"] == found[1]["parameters"]
    table = {each["name"]: each for each in found[0]["parameters"]}
    lumps = load_chain("two-link").chain.lumps_of(("gravity", "coriolis", "inertia"))
    for name in ("gravity_2", "inertia_2"):
        assert table[name]["value"] == pytest.approx(lumps.vector[list(lumps.names).index(name)], rel=0.02)
    assert [joint["of"] > 0.0 for joint in found[0]["held_out"]["torque"]["joints"]] == [False, True]


@pytest.mark.slow
def test_law_stands_in_for_torques(metaid: Metaid) -> None:
    """A log without torques tells as much, of a rig that oscillates as it compensates a plant that is too heavy."""
    rig, heavy = load_chain("two-link"), Path("heavy.toml")
    links = [{"length": 0.5, "mass": 3.0, "com": 0.3}, {"length": 0.4, "mass": 1.5, "com": 0.25}]
    heavy.write_text(tomli_w.dumps({"links": links}))
    sent = load_chain(heavy)
    rig.push(Start(np.array([0.1, -0.05]), np.array([0.1, -0.2])))
    rows = []
    for step in range(1500):
        angles, speeds = rig.states()
        rows.append([step * rig.timestep, *angles, *speeds])
        lumps = sent.chain.lumps
        rig.apply_torque(ChainModel(lumps, rig.gravity).torque(angles, speeds))
        rig.step()
    frame = pd.DataFrame(rows, columns=["time", "angle_1", "angle_2", "speed_1", "speed_2"])
    frame.to_csv("swinging.csv", index=False)
    given = ("swinging.csv", "--nominal", "two-link", "--friction", "none", "--json")
    done = metaid("estimate", *given, "--law", "heavy.toml")
    shown = json.loads(done.out)
    true = dict(zip(rig.chain.lumps.names, rig.chain.lumps.vector, strict=True))
    found = {each["name"]: each["value"] for each in shown["parameters"]}
    assert {name: found[name] for name in true} == pytest.approx(true, rel=0.01)


BAD = {
    "no time": (lambda log: log.drop(columns="time"), "no column 'time'"),
    "no angle": (lambda log: log.drop(columns="angle_2"), "no column 'angle_2'"),
    "a third joint": (lambda log: log.assign(angle_3=0.0), "column 'angle_3' is of no joint"),
    "degrees": (
        lambda log: log.assign(**{name: 57.3 * log[name] for name in log if name.startswith("angle")}),
        "degrees",
    ),
    "speeds in degrees": (lambda log: log.assign(speed_1=57.3 * log["speed_1"]), "degrees"),
    "times that stand": (lambda log: log.assign(time=1.0), "the times of all rows are the same"),
    "times in minutes": (lambda log: log.assign(time=1e-5 * log["time"]), "no rate of 10 Hz to 10 kHz"),
    "times of a coarse clock": (
        lambda log: log.assign(time=10.0 * (log["time"] // 1.0)),
        "at the time of the row above",
    ),
    "words": (lambda log: log.assign(torque_2="lost"), "torque_2 has no number in 100% of the rows"),
    "no motion": (lambda log: log.assign(angle_1=0.0, angle_2=0.1, speed_1=0.0, speed_2=0.0), "no joint moves"),
    "few rows": (lambda log: log[:50], "50 rows"),
    "little motion": (lambda log: log[:120], "too short"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_log_is_refused_in_one_line(metaid: Metaid, rig: Path, kind: str) -> None:
    """It says where it is wrong, nothing is written, and the exit status is 2."""
    spoil, says = BAD[kind]
    spoil(pd.read_csv(rig / "log.csv")).to_csv("bad.csv", index=False)
    done = metaid("estimate", "bad.csv", "--nominal", str(rig / "believed.toml"), "-o", "model.json")
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert says in done.err
    assert sorted(path.name for path in Path().iterdir()) == ["bad.csv"]


@pytest.mark.slow
def test_noise_of_a_plant_at_rest_is_not_taken_for_speeds_in_another_unit(metaid: Metaid, rig: Path) -> None:
    """Nothing is found, for no joint moves far enough."""
    log, random = pd.read_csv(rig / "log.csv"), np.random.default_rng(0)
    for joint in (1, 2):
        log[f"angle_{joint}"] = 0.1 + 1e-3 * random.standard_normal(len(log))
        log[f"speed_{joint}"] = 1e-2 * random.standard_normal(len(log))
    log.to_csv("rest.csv", index=False)
    done = metaid("estimate", "rest.csv", "--nominal", str(rig / "believed.toml"), "--friction", "viscous")
    assert (done.status, done.err) == (3, "")
    assert "no joint goes farther than 0.0" in " ".join(done.out.split())


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["log.xls"], "the ending says the format"),
        (["none.csv"], "No such file"),
        (["text.csv"], "no column 'time'"),
        (["void.csv"], "not a table"),
        (["log.csv", "--nominal", "three-link"], "no column 'angle_3'"),
        (["log.csv", "--friction", "viscuos"], "did you mean 'viscous'?"),
        (["log.csv", "--couple", "1"], "two numbers of joints"),
        (["log.csv", "--untrusted", "3"], "unknown joint '3'"),
        (["log.csv", "--untrusted", "1,2"], "every joint"),
        (["log.csv", "--map", "pwm"], "a column and what it is"),
        (["log.csv", "--map", "pwm=torque_1"], "unknown column 'pwm'"),
        (["log.csv", "--couple", "2,3"], "two of 1 to 2"),
        (["log.csv", "-o", "model.step"], "the ending says the format"),
        (["log.csv", "--law", "three-link"], "of 3 joints (allowed: 2"),
    ],
)
def test_wrong_request_is_refused_in_one_line(metaid: Metaid, rig: Path, given: list[str], says: str) -> None:
    """It says what is allowed, with exit status 2."""
    Path("log.csv").write_text((rig / "log.csv").read_text())
    Path("text.csv").write_text("a log\nof a rig\n")
    Path("void.csv").write_text("")
    plant = [] if "--nominal" in given else ["--nominal", "two-link"]
    done = metaid("estimate", *given, *plant)
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert says in done.err


@pytest.mark.slow
def test_parquet_is_read_or_its_package_named(metaid: Metaid, rig: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same as from CSV; without pyarrow one line says how that is installed."""
    choices = ("--friction", "viscous", "--window", "0.2", "--delay", "0")
    given = ("estimate", "--nominal", str(rig / "believed.toml"), *choices, "--json")
    pytest.importorskip("pyarrow")
    pd.read_csv(rig / "log.csv").to_parquet("log.parquet")
    ours, theirs = json.loads(metaid(*given, "log.parquet").out), json.loads(metaid(*given, str(rig / "log.csv")).out)
    assert ours["parameters"] == theirs["parameters"]
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = metaid(*given, "log.parquet")
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert "python -m pip install 'pyarrow>=" in done.err
