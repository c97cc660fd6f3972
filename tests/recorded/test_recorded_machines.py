"""What logs of machines need: zeros of their own, bodies that can be, and facts named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from conftest import wrong_chain
from random_arm import wrong_tree
from swinging import DRY, arm_log, estimated, log_of, swinging, swinging_arm

from metaid.models import Array
from metaid.models.tree import PARAMETERS, Tree, joint_mass_matrix, joint_torque, planar_tree
from metaid.plant import ArmPlant, load_chain, load_plant
from metaid.recorded import (
    Choices,
    LogRun,
    RecordedEstimate,
    arm_model,
    chain_model,
    estimate_records,
    facts_of,
    judge_records,
)

pytestmark = pytest.mark.slow

ROTOR = PARAMETERS.index("rotor")


@pytest.fixture(scope="module")
def rubbed() -> tuple[LogRun, RecordedEstimate]:
    """The log of an arm with dry friction, and what it says."""
    record = arm_log(lambda speeds: DRY * np.sign(speeds))
    return record, estimated(record)


def test_each_log_has_zeros_of_its_own() -> None:
    """Encoders that are zeroed anew for each run are found to 3 mrad, and whole logs are held out."""
    chain = load_chain("two-link").chain
    zeros = np.array([[0.03, -0.02], [-0.05, 0.04], [0.01, 0.0]])
    whole = log_of(planar_tree(chain, 9.81), noise=1e-4, seconds=6.0)
    thirds = np.array_split(np.arange(len(whole.times)), 3)
    records = [
        LogRun(f"{i}", whole.times[rows], whole.angles[rows] - zero, None, whole.torques[rows])
        for i, (rows, zero) in enumerate(zip(thirds, zeros, strict=True))
    ]
    found = estimate_records(records, chain_model(wrong_chain(chain, 1), 9.81), Choices(friction=("viscous",)))
    assert found.held_out.by == "logs"
    np.testing.assert_allclose(found.zeros, zeros, atol=3e-3)
    true = chain.lumps_of(("gravity", "coriolis", "inertia")).vector
    np.testing.assert_allclose(found.values[: len(true)], true, rtol=0.01)


@pytest.mark.parametrize("shown", [1e-3, 0.0])
def test_joint_that_is_held_spoils_no_other(shown: float) -> None:
    """Stiction bears the torque there that motion of the others asks for, so its motor shows next to none, or none."""
    times, *moving = swinging(4.0, 2001, 3, 3)
    for each in moving:
        each[:, 0] *= 1e-4
    torques = joint_torque(swinging_arm(), *moving)
    torques[:, 0] = shown * np.sin(3.0 * times)
    record = LogRun("held.csv", times, moving[0], None, torques)
    found = estimated(record)
    assert found.held_out.by_joint[1:].max() < 0.006
    verdict = judge_records(found, [fact.text for fact in facts_of(found)])
    assert verdict.word == "approximate"
    held = f"{found.model.joints[0]} is held, and its torque counts little: stiction bears what a motor does not show"
    assert held in verdict.reasons
    assert not any("is off by" in reason or "opposite sign" in reason for reason in verdict.reasons)
    (left,) = [reason for reason in verdict.reasons if reason.startswith("what is left is above the noise")]
    assert (found.held_out.by_joint.argmax() == 0) == (shown > 0.0)
    assert f"most in joint {found.model.joints[0]} " not in left


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_gravity_that_points_the_other_way_is_named_though_all_is_predicted(way: float) -> None:
    """Where an arm moves slowly, bodies that hang upside down predict nearly as well; nothing is said where all is
    right.
    """
    arm, slower = swinging_arm(), 10.0
    times, coordinates, speeds, accelerations = swinging(4.0, 2001, 3, 3)
    speeds, accelerations = speeds / slower, accelerations / slower**2
    torques = joint_torque(replace(arm, gravity=way * arm.gravity), coordinates, speeds, accelerations)
    torques += 0.5 * speeds + 0.3 * np.tanh(100.0 * speeds)
    record = LogRun("slow.csv", slower * times, coordinates, None, torques)
    found = estimated(record, span=0.5)
    said = [fact.text for fact in facts_of(found)]
    assert found.held_out.relative < 0.03
    assert bool(said) == (way < 0.0)
    assert all(said[0].startswith("the nominal bodies need the opposite of what every joint carries") for _ in said)
    assert all("--gravity 0,0,9.81, or" in said[0] for _ in said)


def test_log_of_what_cannot_be_tells_bodies_that_can_be() -> None:
    """The free fit has a rotor below 0; what is handed over has none, and moves with a positive mass matrix."""
    record = arm_log()
    rates = np.gradient(np.gradient(record.angles, record.period, axis=0), record.period, axis=0)
    found = estimated(record.with_torques(record.torques - np.array([0.0, 0.0, 0.03]) * rates))
    free = found.equations.solution.values
    rotors = [i for i, name in enumerate(found.model.names) if name.startswith("rotor")]
    assert free[rotors].min() < 0.0
    tree = found.possible.tree
    assert (tree.rotor >= 0.0).all()
    assert np.linalg.eigvalsh(joint_mass_matrix(tree, record.angles[::50])).min() > 0.0
    assert np.linalg.eigvalsh(tree.inertia).min() > 0.0


def test_another_unit_of_all_torques_is_named_and_does_not_bend_the_answer() -> None:
    """In mN m every number is a thousand times what it is in N m."""
    record = arm_log(lambda speeds: 0.2 * speeds)
    ours, milli = estimated(record), estimated(record.with_torques(1e3 * record.torques))
    np.testing.assert_allclose(1e-3 * milli.values, ours.values, atol=0.02 * np.abs(ours.values).max())
    assert any("mN m? --scale all=0.001" in reason for reason in judge_records(milli).reasons)


def test_joint_that_nothing_predicts_is_named(rubbed: tuple[LogRun, RecordedEstimate]) -> None:
    """Beside two that are predicted well, so that the whole is."""
    record, _ = rubbed
    random = np.random.default_rng(0).standard_normal((len(record.times) // 100 + 2, 1)) * (0.0, 0.0, 2.0)
    slowly = np.stack([np.interp(record.times, 0.2 * np.arange(len(random)), each) for each in random.T], axis=1)
    other = record.with_torques(record.torques * (1.0, 1.0, 0.0) + slowly)
    said = [judge_records(found).reasons for _, found in (rubbed, (other, estimated(other)))]
    last = swinging_arm().names[2]
    sentence = f"more than half of the torque of {last} is not predicted"
    assert [sentence in reasons for reasons in said] == [False, True]


def test_bodies_known_together_alone_are_handed_over_where_they_predict() -> None:
    """And are not where the nominal ones predict as well: then a log shows nothing of them."""
    record = arm_log(lambda speeds: 0.2 * speeds)
    found = estimated(record, friction=("viscous",))
    vague = replace(found, covariance=1e14 * found.covariance)
    idle = replace(vague, nominal_held_out=found.held_out)
    said = [judge_records(each) for each in (found, vague, idle)]
    assert [each.word for each in said] == ["found", "approximate", "not found"]
    assert "no parameter of the bodies is known to 10% by itself, only what they need together" in said[1].reasons
    assert said[2].reasons[-1].startswith("the log shows nothing of the bodies to better than 10%")


def test_joint_with_another_motor_constant_is_named_with_what_it_carries() -> None:
    """Three fifths of its torque are no other unit; the option makes the nominal bodies true."""
    arm = swinging_arm()
    record = log_of(arm, noise=1e-5, seconds=4.0)
    factors, asked = np.array([1.0, 0.6, 1.0]), Choices(friction=("viscous",), zeros=False, delay=0.0)
    other = record.with_torques(record.torques * factors)
    found = [estimate_records([each], arm_model(arm), asked) for each in (record, other)]
    said = [[reason for reason in judge_records(each).reasons if "weigh" in reason] for each in found]
    assert said[0] == []
    joint = found[1].model.joints[1]
    assert f"so many times that: {joint} 0.6; " in said[1][0]
    assert said[1][0].endswith(f"--scale {joint}=1.7")


def test_joint_whose_nominal_bodies_are_far_too_light_is_told_from_another_unit() -> None:
    """Joints before it move these bodies, too: they contradict its torques in another unit, and confirm its own."""
    plant, asked = load_plant("puma560"), Choices(friction=("viscous",), zeros=False, delay=0.0)
    assert isinstance(plant, ArmPlant)
    arm = plant.tree.with_parameters(plant.tree.parameters * np.array([1.0] * 11 + [0.0, 0.0]))
    lighter = arm.parameters.copy()
    lighter[3] *= 0.05
    record = log_of(arm, noise=1e-5, seconds=3.0)
    amperes = record.with_torques(record.torques * np.array([1.0, 1.0, 1.0, 1.0, 10.0, 1.0]))
    named = []
    for each, nominal in ((record, arm.with_parameters(lighter)), (amperes, arm)):
        found = estimate_records([each], arm_model(nominal), asked)
        named.append([(fact.option, "as other joints confirm" in fact.text) for fact in facts_of(found)])
    assert named == [[("", True)], [("--scale wrist_bend=0.1", False)]]


def test_runs_that_begin_at_other_times_are_simulated_alike() -> None:
    """At 125 Hz 0.3 s are 37.5 periods, and the periods of two runs differ by rounding."""
    whole = arm_log()
    rows = np.arange(0, len(whole.times), 4)
    first, second = (
        LogRun(f"{start}", start + whole.times[rows], whole.angles[rows], None, whole.torques[rows])
        for start in (0.0, 18.352)
    )
    held = estimated(first, second).held_out
    assert np.isfinite(held.angle).all()
    assert (held.angle < 0.2 * held.constant_speed).all()


def runs(extra: Callable[[Array], Array] | None = None) -> list[LogRun]:
    """Three logs of other motions."""
    logs = [log_of(swinging_arm(), noise=1e-5, extra=extra, seconds=2.0, seed=seed) for seed in range(3)]
    return [replace(log, name=f"run{number}") for number, log in enumerate(logs)]


def turned(record: LogRun) -> LogRun:
    return record.with_torques(record.torques * np.array([1.0, -1.0, 1.0]))


def in_milli(record: LogRun) -> LogRun:
    return record.with_torques(record.torques * np.array([1.0, 1000.0, 1.0]))


def quarter(record: LogRun) -> LogRun:
    return replace(record, angles=record.angles - np.array([0.0, 0.5 * np.pi, 0.0]))


def other_way(record: LogRun) -> LogRun:
    return replace(turned(record), angles=record.angles * np.array([1.0, -1.0, 1.0]))


@pytest.mark.parametrize(
    ("spoil", "option"),
    [
        (turned, "--scale {}=-1"),
        (in_milli, "--scale {}=0.001"),
        (quarter, "--zero {}=1.5708"),
        (other_way, "--reversed {}"),
    ],
)
def test_fact_that_is_wrong_is_named_with_what_mends_it(spoil: Callable[[LogRun], LogRun], option: str) -> None:
    """Of the second joint, first of all that is named."""
    record = spoil(arm_log(lambda speeds: DRY * np.sign(speeds)))
    found = estimated(record)
    facts = facts_of(found)
    assert facts[0].option == option.format(found.model.joints[1])


@pytest.mark.parametrize(("cancelled", "named"), [((0.0, 3.0, 1.5), True), ((0.0, 0.2, 0.1), False)])
def test_torque_that_falls_with_speed_as_no_friction_does_is_named(cancelled: tuple[float, ...], named: bool) -> None:
    """As of a real arm whose drives cancel friction beside what they log, and no log is blamed; not where friction
    falls and still holds.
    """
    records = runs(lambda speeds: DRY * np.sign(speeds) - np.array(cancelled) * speeds)
    found = estimated(*records)
    joints = found.model.joints
    said = [fact.option for fact in facts_of(found)]
    assert said == ([f"--untrusted {joints[1]},{joints[2]}"] if named else [])


@pytest.mark.parametrize("lost", [0.0, 0.8])
def test_log_that_contradicts_the_others_is_named_first(lost: float) -> None:
    """Of three runs one whose second encoder loses counts half way, as a real rotary pendulum's does."""
    records = runs()
    slipped = lost * (records[1].times > 1.0)[:, None] * np.array([0.0, 1.0, 0.0])
    records[1] = replace(records[1], angles=records[1].angles + slipped)
    facts = facts_of(estimated(*records))
    assert [fact.text.partition(" contradicts the other logs")[0] for fact in facts] == (["run1"] if lost else [])


def heavy_rotor(arm: Tree) -> tuple[LogRun, Tree]:
    """That turns with the first joint, whose axis is vertical; nobody knows of any rotor."""
    with_rotor = arm.parameters.copy()
    with_rotor[0, ROTOR] = 5.0
    unknown = arm.parameters.copy()
    unknown[:, ROTOR] = 0.0
    return log_of(arm.with_parameters(with_rotor), noise=1e-5, seconds=2.0), arm.with_parameters(unknown)


def on_the_axis(arm: Tree) -> tuple[LogRun, Tree]:
    """The last nominal body, but for rounding, as a URDF without centres of mass has it."""
    rounded = arm.parameters.copy()
    rounded[2, 1:4] = 1e-19
    return log_of(arm, noise=1e-5, seconds=4.0), arm.with_parameters(rounded)


def stiff_gears(arm: Tree) -> tuple[LogRun, Tree]:
    """A light arm, whose friction is far beyond what any of its bodies needs."""
    light = arm.with_parameters(0.05 * arm.parameters)
    friction = np.array([20.0, 40.0, 40.0])
    return log_of(light, noise=1e-5, extra=lambda speeds: friction * np.cbrt(speeds), seconds=2.0), light


@pytest.mark.parametrize("machine", [heavy_rotor, on_the_axis, stiff_gears])
def test_what_a_rough_model_lacks_is_no_fact_that_is_wrong(machine: Callable[[Tree], tuple[LogRun, Tree]]) -> None:
    """Rotors, centres of mass and friction are not in it; the torques are in N m."""
    record, nominal = machine(swinging_arm())
    model = arm_model(nominal)
    found = estimate_records([record], model, Choices(friction=("viscous",), zeros=False, delay=0.0))
    assert found.scale == 1.0
    assert not facts_of(found)


def test_gravity_that_points_elsewhere_is_named_and_no_unit_in_its_place() -> None:
    """Told of an arm on a floor that it hangs on a wall: hardly any torque is then as the nominal bodies need it."""
    record, tree = arm_log(), wrong_tree(swinging_arm(), 0)
    leaning = arm_model(replace(tree, gravity=np.array([0.0, -9.81, 0.0])))
    found = estimate_records([record], leaning, Choices(friction=("viscous", "coulomb"), zeros=False, delay=0.0))
    assert [fact.option for fact in facts_of(found)] == ["--gravity 0,0,-9.81"]


def test_motor_that_turns_with_two_joints_is_named(rubbed: tuple[LogRun, RecordedEstimate]) -> None:
    """Where nobody said so; of an arm that has none nothing is."""

    def coupled(speeds: Array) -> Array:
        return 4.0 * np.sign(speeds[:, 1:2] + speeds[:, 2:3]) * np.array([0.0, 1.0, 1.0])

    record, (_, found) = arm_log(coupled), rubbed
    assert [fact.option for fact in facts_of(estimated(record))][:1] == ["--couple 2,3"]
    assert facts_of(found) == ()
