"""What a model lacks, the delay that is said and gaps of a log: nothing is surer than it can be."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import wrong_chain
from random_arm import wrong_tree
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from swinging import SAID, log_of, swinging, swinging_arm

from metaid.errors import RecordError
from metaid.models import DEVIATIONS, Array
from metaid.models.tree import joint_torque, planar_tree
from metaid.plant import load_chain
from metaid.recorded import (
    Choices,
    LinearModel,
    LogRun,
    RecordedVerdict,
    arm_model,
    chain_model,
    estimate,
    estimate_records,
    facts_of,
    judge_records,
)

pytestmark = pytest.mark.slow

# Said, for to find its terms takes longer than all else.
VISCOUS, BASE = Choices(friction=("viscous",)), Choices(friction=("viscous", "coulomb"))


def judged(record: LogRun, model: LinearModel, choices: Choices | None = None) -> RecordedVerdict:
    found = judge_records(estimate_records([record], model, choices))
    assert found.is_found
    return found


def outside(found: RecordedVerdict, true: Array, times: float = 1.0) -> list[str]:
    """Which of the first unknowns are determined, and do not have the `true` values within both deviations, so
    many `times` as wide and 0.01 % of them wider.
    """
    table = found.lumps[: len(true)]
    missed = np.abs(table["identified"] - true) - 1e-4 * np.abs(true)
    reach = DEVIATIONS * np.hypot(table["sd"], table["sd_systematic"])
    return list(table["name"][table["determined"] & (missed > times * reach)])


@pytest.fixture(scope="module")
def chain_log() -> tuple[LogRun, LinearModel, Array]:
    """The exact log of two links with friction, whose torques act 1 ms early, its model, and what is true."""
    chain, damping = load_chain("two-link").chain, np.array([0.05, 0.02])
    record = log_of(planar_tree(chain, 9.81), late=-0.001, extra=lambda speeds: damping * speeds)
    model = chain_model(wrong_chain(chain, 1), 9.81)
    return record, model, np.concatenate([chain.lumps_of(("gravity", "coriolis", "inertia")).vector, damping])


def test_delay_that_is_said_is_no_surer_than_the_log(chain_log: tuple[LogRun, LinearModel, Array]) -> None:
    """Half a control step makes friction wrong by a tenth: its interval holds that, and the verdict names the delay."""
    record, model, true = chain_log
    found = judged(record, model, Choices(delay=0.0, friction=("viscous",)))
    assert not outside(found, true)
    assert any("a delay of -1 ms would explain" in reason for reason in found.reasons)


def test_scale_of_a_joints_torques_is_suspected(chain_log: tuple[LogRun, LinearModel, Array]) -> None:
    """A motor's constant that is wrong by 5 % is named, and no lump is wrong by two half-widths of its interval."""
    record, model, true = chain_log
    found = judged(record.with_torques(record.torques * np.array([1.0, 1.05])), model, VISCOUS)
    assert not outside(found, true, times=2.0)
    assert any("another scale of the torques of joints 1, 2" in reason for reason in found.reasons)


def test_scale_of_all_torques_is_what_a_verdict_does_not_know(chain_log: tuple[LogRun, LinearModel, Array]) -> None:
    """It says so of every log, for nothing in one shows it."""
    record, model, _ = chain_log
    right, scaled = (
        judged(each, model, replace(VISCOUS, span=0.1)) for each in (record, record.with_torques(1.2 * record.torques))
    )
    np.testing.assert_allclose(scaled.lumps["identified"][:5], 1.2 * right.lumps["identified"][:5], rtol=1e-3)
    for found in (right, scaled):
        assert any(reason.startswith("every number scales with the torques") for reason in found.reasons)


def test_friction_that_bends_near_rest_is_suspected() -> None:
    """Dry friction that a joint has only from some of its speed on is named, and nothing is surer than it allows."""
    chain = load_chain("two-link").chain
    record = log_of(planar_tree(chain, 9.81), extra=lambda speeds: 0.2 * np.tanh(speeds / 1.0))
    found = judged(record, chain_model(wrong_chain(chain, 1), 9.81), BASE)
    true = chain.lumps_of(("gravity", "coriolis", "inertia")).vector
    assert not outside(found, true)
    assert any("friction that bends near rest of joints 1, 2" in reason for reason in found.reasons)


def test_joints_that_are_misplaced_are_suspected() -> None:
    """By 2 mm and 5 mrad, as arms are: they are named, and what is determined of the bodies is within its interval."""
    arm, random = swinging_arm(), np.random.default_rng(1)
    turns = Rotation.from_rotvec(0.005 * random.standard_normal((arm.njoint, 3))).as_matrix()
    place = arm.position + 0.002 * random.standard_normal((arm.njoint, 3))
    misplaced = replace(arm, position=place, rotation=arm.rotation @ turns)
    model = arm_model(wrong_tree(arm, 1))
    found = judged(log_of(misplaced, seconds=4.0), model, replace(BASE, delay=0.0))
    prior = model.prior
    assert not isinstance(prior, tuple)
    assert not outside(found, prior.base.of(arm.parameters)[prior.base.columns % 13 < 11])
    assert any("another place of joint" in reason for reason in found.reasons)


def test_tiny_motion_tells_nothing(chain_log: tuple[LogRun, LinearModel, Array]) -> None:
    """Within 0.02 rad friction holds like a spring and creeps, so nothing is found, however well it is predicted."""
    record, model, _ = chain_log
    tiny = replace(record, angles=0.003 * record.angles)
    found = judge_records(estimate_records([tiny], model, Choices(span=0.1, delay=0.0, friction=("viscous",))))
    assert not found.is_found
    assert "no joint goes farther than 0.00" in found.reasons[0]


def test_window_spans_no_gap_of_the_log(chain_log: tuple[LogRun, LinearModel, Array]) -> None:
    """Nobody knows which torques were sent where rows are missing; a row here and there does no harm."""
    record, model, _ = chain_log
    kept = np.ones(len(record.times), dtype=np.bool_)
    kept[1000:1050] = kept[2000] = False
    gapped = replace(record, times=record.times[kept], angles=record.angles[kept], torques=record.torques[kept])
    choices = Choices(span=0.2, delay=0.0, friction=("viscous",), zeros=False)
    (windows,) = estimate_records([gapped], model, choices).equations.parts
    assert not windows.overlapping(record.times[1000], record.times[1049]).any()
    assert windows.overlapping(record.times[1999], record.times[2001]).any()


def test_log_of_a_free_swing_is_called_one(tmp_path: Path) -> None:
    """Its motors gave nothing but 2 mN m of noise where the nominal link needs 3 N m."""
    times, random = np.arange(0.0, 10.0, 0.005), np.random.default_rng(0)
    swung = solve_ivp(lambda _, x: [x[1], 27.0 * np.sin(x[0]) - 0.1 * x[1]], (0.0, 10.0), (2.0, 0.0), t_eval=times)
    angles = swung.y[0] + random.normal(scale=3e-4, size=len(times))
    torques = random.normal(scale=0.002, size=len(times))
    log = pd.DataFrame({"time": times, "angle_1": angles, "torque_1": torques})
    log.to_csv(tmp_path / "swing.csv", index=False)
    (tmp_path / "nominal.toml").write_text("[[links]]\nlength = 0.5\nmass = 0.8\ncom = 0.33\ninertia = 0.02\n")
    verdict = estimate([tmp_path / "swing.csv"], tmp_path / "nominal.toml", friction=["viscous"]).verdict
    assert not verdict.is_found
    assert "times as much: the motors hardly drove" in verdict.reasons[0]


@pytest.mark.parametrize("shift", [0.5 * np.pi, -0.5 * np.pi])
@pytest.mark.parametrize("dry", [0.3, 3.0])
def test_zero_that_is_off_by_a_quarter_turn_is_named_with_its_sign(shift: float, dry: float) -> None:
    """Though zeros of three runs take up half a radian of it, and though the other way bodies that hang upside down
    explain as much.
    """
    arm, slower = swinging_arm(), 10.0
    times, coordinates, speeds, accelerations = swinging(4.0, 2001, 3, 3)
    speeds, accelerations = speeds / slower, accelerations / slower**2
    torques = joint_torque(arm, coordinates, speeds, accelerations) + 0.5 * speeds + dry * np.tanh(100.0 * speeds)
    read = coordinates - shift * np.array([0.0, 1.0, 0.0])
    runs = [
        LogRun(f"run{first}.csv", slower * times[first:last], read[first:last], None, torques[first:last])
        for first, last in pairwise((0, 700, 1400, 2001))
    ]
    found = estimate_records(runs, arm_model(wrong_tree(arm, 0)), replace(BASE, delay=0.0))
    facts = facts_of(found)
    assert [fact.option for fact in facts] == [f"--zero shoulder={shift:.4f}"]
    said = [reason for reason in judge_records(found).reasons if "farther than chance puts it" in reason]
    assert len(said) == (dry < 1.0)


@pytest.mark.parametrize("times", [1.0, 10.0])
def test_bodies_that_are_a_guess_are_believed_less_where_that_predicts_better(times: float) -> None:
    """Those of each link are another's, some times as heavy: half a percent of what was left out is missed at most, and
    nothing else is named in their place.
    """
    tree = swinging_arm()
    guess = arm_model(tree.with_parameters(times * tree.parameters[::-1]))
    found = estimate_records((log_of(tree, noise=1e-4, seconds=2.0),), guess, replace(BASE, zeros=False, delay=0.0))
    assert found.held_out.relative < 0.005
    assert found.equations.doubt > 1.0
    assert facts_of(found) == ()


@pytest.mark.parametrize("names", [("b", "c", "a"), ("joint_1", "joint_2", "joint_3")])
def test_joints_that_a_log_has_in_another_order_are_named(names: tuple[str, ...]) -> None:
    """By the alphabet, as messages of ROS have them, or from the last on."""
    arm = replace(swinging_arm(), names=names)
    order = sorted(names) if sorted(names) != list(names) else names[::-1]
    record = log_of(arm, extra=lambda speeds: 0.5 * speeds)
    places = [names.index(joint) for joint in order]
    read = record.mapped(lambda each: each[:, places])
    asked = replace(VISCOUS, span=0.1, delay=0.0)
    facts = facts_of(estimate_records([read], arm_model(wrong_tree(arm, 0)), asked))
    assert [fact.option for fact in facts] == [f"--order {','.join(order)}"]


def test_order_that_is_said_is_that_of_the_log() -> None:
    """Whatever joints are: all that is said of one is of the one with that name; another order is refused."""
    record = log_of(swinging_arm(), extra=lambda speeds: 0.5 * speeds)
    told = {
        "friction": ["viscous"],
        "window": 0.1,
        "delay": 0.0,
        "zeros": False,
        "untrusted": ["elbow"],
        "scale": {"turret": 2.0},
    }
    for places in ([0, 1, 2], [1, 2, 0]):
        frame = pd.DataFrame({"time": record.times})
        for number, joint in enumerate(places, 1):
            frame[f"angle_{number}"], frame[f"torque_{number}"] = record.angles[:, joint], record.torques[:, joint]
        order = [("turret", "shoulder", "elbow")[joint] for joint in places]
        found = estimate(frame, "spatial-three-link", order=order, **told)
        if places == [0, 1, 2]:
            usual = found.estimate.values
    np.testing.assert_array_equal(found.estimate.values, usual)
    with pytest.raises(RecordError, match=r"order turret,elbow .*allowed: each once of turret,shoulder,elbow"):
        estimate(frame, "spatial-three-link", order=["turret", "elbow"])


@pytest.mark.parametrize("slower", [4.0, 1.0])
def test_log_that_goes_beyond_what_was_learned_is_named(slower: float) -> None:
    """It accelerates joints sixteen times as much as the log that bodies were learned from, and a delay of the torques
    that nothing was said of counts the more.
    """
    late = 0.016  # s

    def frame(times_slower: float) -> pd.DataFrame:
        times, coordinates, speeds, accelerations = swinging(6.0, 3001, 3, 3)
        times *= times_slower
        torques = joint_torque(swinging_arm(), coordinates, speeds / times_slower, accelerations / times_slower**2)
        torques = np.roll(torques, -round(late / times[1]), axis=0)
        columns = {f"angle_{i + 1}": coordinates[:, i] for i in range(3)}
        return pd.DataFrame({"time": times} | columns | {f"torque_{i + 1}": torques[:, i] for i in range(3)})

    result = estimate(frame(slower), "spatial-three-link", validate=frame(1.0), **SAID)
    said = [each for each in result.nominal_repairs if "accelerates joint" in each]
    assert len(said) == (slower > 1.0)
    assert all("16 times as much as what was learned, and is predicted to" in each for each in said)
