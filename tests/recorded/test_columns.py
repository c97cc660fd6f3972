"""Which column is what is understood, or said by the user; what was understood is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from metaid.errors import RecordError
from metaid.recorded import every_run
from tests.clean_logs import clean, intake, kinds, read

SPELLED: dict[str, tuple[dict[str, str], list[str]]] = {
    "DFKI": ({"time": "time", "angle_": "pos_meas", "speed_": "vel_meas", "torque_": "tau_meas"}, ["1", "2"]),
    "short": ({"time": "t", "angle_": "q", "speed_": "dq", "torque_": "tau"}, ["1", "2"]),
    "underscores": ({"time": "timestamp", "angle_": "pos_", "speed_": "vel_", "torque_": "tau_"}, ["1", "2"]),
    "plural": (
        {"time": "timestamps", "angle_": "positions_", "speed_": "velocities_", "torque_": "torques_"},
        ["1", "2"],
    ),
    "RTDE": ({"time": "timestamp", "angle_": "actual_q_", "speed_": "actual_qd_", "torque_": "effort_"}, ["0", "1"]),
    "brackets": ({"time": "Time [s]", "angle_": "Position", "speed_": "Velocity", "torque_": "Torque"}, ["[0]", "[1]"]),
    "PlotJuggler": (
        {"time": "__time", "angle_": "/joint_states/{}/position", "speed_": "/joint_states/{}/velocity"}
        | {"torque_": "/joint_states/{}/effort"},
        ["shoulder_joint", "elbow_joint"],
    ),
    "cart": ({"time": "t", "angle_": "pos_", "speed_": "vel_", "torque_": "force_"}, ["cart", "pole"]),
    "files": ({"time": "time", "angle_": "posa{}.txt", "speed_": "vela{}.txt", "torque_": "trq{}.txt"}, ["1", "2"]),
    "turns": ({"time": "t", "angle_": "theta{}_rad_wrapped", "speed_": "omega", "torque_": "tau"}, ["1", "2"]),
    "Greek": ({"time": "t", "angle_": "Alpha", "speed_": "dAlpha", "torque_": "tau"}, ["1", "2"]),
    "units": ({"time": "t_s", "angle_": "{}_rad", "speed_": "{} [rad/s]", "torque_": "{}_Nm"}, ["elbow", "hand"]),
    "units and numbers": ({"time": "t", "angle_": "J{}_rad", "speed_": "J{} (rad/s)", "torque_": "J{}_Nm"}, ["1", "2"]),
    "demonstrations": (
        {
            "time": "t",
            "angle_": "observations_qpos_",
            "speed_": "observations_qvel_",
            "torque_": "observations_effort_",
        },
        ["1", "2"],
    ),
    "ROS": ({"time": "stamp", "angle_": "position_", "speed_": "velocity_", "torque_": "effort_"}, ["elbow", "hand"]),
}


def respelled(log: pd.DataFrame, how: str) -> pd.DataFrame:
    words, joints = SPELLED[how]
    names = {}
    for column in log.columns:
        kind, _, joint = str(column).partition("_")
        own = words[f"{kind}_" if joint else kind]
        name = joints[int(joint) - 1] if joint else ""
        names[column] = own.format(name) if "{}" in own else own + name
    return log.rename(columns=names)


@pytest.mark.parametrize("how", SPELLED)
def test_columns_are_understood_as_people_spell_them(how: str) -> None:
    """By numbers from 0 or 1, or by names of joints; other columns are left alone, and it is said."""
    usual, joints = read(clean()), tuple(SPELLED[how][1])
    joints = joints if joints[0].isidentifier() else ("1", "2")
    log = respelled(clean(), how).assign(temperature_1=40.0, pos_des_1=0.0, gripper_position=0.1, note="a")
    record = read(log, joints=joints)
    for name in ("times", "angles", "speeds", "torques"):
        np.testing.assert_allclose(getattr(record, name), getattr(usual, name), atol=1e-12)
    assert kinds(record) == ["columns"]


CARTS = {
    "position": ["position", "angle", "positionD", "angleD", "force"],
    "letters": ["x", "theta", "x_dot", "theta_dot", "u"],
    "units": ["x [m]", "theta [rad]", "dx [m/s]", "dtheta [rad/s]", "voltage"],
}


@pytest.mark.parametrize("how", CARTS)
@pytest.mark.parametrize("slide", [0, 1])
def test_slide_and_hinge_of_a_cart_with_a_pole_need_no_numbers(how: str, slide: int) -> None:
    """The slide has the position and the torque, whichever of the two it is; what is beside them is left alone."""
    ours = ["angle_1", "angle_2", "speed_1", "speed_2", "torque_1"]
    log = clean()[["time", *ours]].set_axis(["time", *CARTS[how]], axis="columns")
    beside = log.assign(angle_cos=0.5, target_position=9.0, angle_raw=580.0)
    joints, slides = ("cart", "pole") if slide == 0 else ("pole", "cart"), np.arange(2) == slide
    (record,) = every_run(replace(intake(joints), slides=slides), [beside])
    usual = read(clean())
    order = [0, 1] if slide == 0 else [1, 0]
    np.testing.assert_array_equal(record.angles, usual.angles[:, order])
    np.testing.assert_array_equal(record.speeds, usual.speeds[:, order])
    np.testing.assert_array_equal(record.torques[:, slide], usual.torques[:, 0])
    where = [f"{CARTS[how][number]} is of {joint}" for number, joint in zip(order, joints, strict=True)]
    assert ", ".join(where) in [each.text for each in record.repairs]


def test_two_positions_or_speeds_of_a_cart_are_not_guessed_at() -> None:
    """Without one speed no speed is read."""
    cart = replace(intake(("cart", "pole")), slides=np.array([True, False]))
    ours = ["angle_1", "angle_2", "speed_1", "speed_2", "torque_1"]
    log = clean()[["time", *ours]].set_axis(["time", *CARTS["letters"]], axis="columns").assign(velocity=1.0)
    (record,) = every_run(cart, [log])
    assert record.speeds is None
    log = clean().rename(columns={"angle_1": "x", "angle_2": "theta"}).assign(position=1.0)
    with pytest.raises(RecordError, match="no column 'angle_1' among time, x"):
        every_run(cart, [log])


def test_alpha_is_an_acceleration_beside_other_angles() -> None:
    usual = read(clean())
    log = clean().rename(columns={"angle_1": "theta_1", "angle_2": "theta_2"})
    log.insert(0, "alpha_1", 9.0)
    log.insert(0, "alpha_2", 9.0)
    np.testing.assert_array_equal(read(log).angles, usual.angles)


@pytest.mark.parametrize(
    ("word", "what"), [("current", "motor currents"), ("voltage", "motor voltages"), ("u", "inputs"), ("pwm", "inputs")]
)
def test_what_a_motor_is_sent_stands_for_its_torque(word: str, what: str) -> None:
    """Where there is no torque, and that is said."""
    record = read(clean().rename(columns=lambda name: name.replace("torque", word)))
    np.testing.assert_array_equal(record.torques, clean()[["torque_1", "torque_2"]])
    assert any(repair.text.startswith(f"{what} stand for torques: ") for repair in record.repairs)


def test_one_column_for_what_a_motor_of_several_joints_is_sent_is_named() -> None:
    log = clean().drop(columns="torque_2").rename(columns={"torque_1": "duty"})
    (repair,) = read(log, may_swing=True, needs_torques=False).repairs
    assert repair.text == "no torques: taken to swing freely (--map duty=torque_JOINT where a motor moves it)"


def test_column_that_says_but_its_unit_goes_after_one_that_says_what_it_is() -> None:
    log = clean().assign(elbow_motor_rad=9.0, hand_rad=9.0)
    log = log.rename(columns={"angle_1": "angle_elbow", "angle_2": "angle_hand"})
    np.testing.assert_array_equal(read(log, joints=("elbow", "hand")).angles, read(clean()).angles)


def test_log_without_times_is_told_to_say_its_rate() -> None:
    """As of a benchmark of two columns, of which the names are known."""
    log = clean()[["angle_1", "torque_1"]].set_axis(["th", "u"], axis=1)
    with pytest.raises(RecordError, match=r"no column 'time' among th, u .* or --rate HZ where rows are regular; or"):
        read(log, joints=("shaft",))
    np.testing.assert_array_equal(read(log, joints=("shaft",), rate=200.0).angles[:, 0], log["th"])


def test_column_that_the_user_names_goes_before_one_that_is_understood() -> None:
    """As a command beside efforts that a driver leaves at 0; the other joint keeps its own."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_elbow").replace("_2", "_hand"))
    log = log.assign(command=log["torque_elbow"], torque_elbow=0.0)
    record = read(log, joints=("elbow", "hand"), columns={"command": "torque_1"})
    np.testing.assert_array_equal(record.torques, clean()[["torque_1", "torque_2"]])


def test_columns_of_other_joints_are_passed_by_where_the_user_names_all() -> None:
    """As of a gripper, whose number is one of them."""
    log = clean().rename(columns={"angle_1": "q1", "angle_2": "q3", "torque_1": "u1", "torque_2": "u3"})
    log = log.assign(q2=0.0, u2=0.0).drop(columns=["speed_1", "speed_2"])
    with pytest.raises(RecordError, match="column 'q3' is of no joint"):
        read(log)
    named = {"q1": "angle_1", "q3": "angle_2", "u1": "torque_1", "u3": "torque_2"}
    np.testing.assert_array_equal(read(log, columns=named).angles, read(clean()).angles)


def test_one_joint_alone_may_have_any_number() -> None:
    """As the second of a robot whose first is clamped; of two columns neither is known to be its."""
    log = clean()[["time", "angle_2", "speed_2", "torque_2"]]
    np.testing.assert_array_equal(read(log, joints=("1",)).angles, log[["angle_2"]])
    np.testing.assert_array_equal(read(log, joints=("1",), columns={"speed": "speed"}).speeds, log[["speed_2"]])
    with pytest.raises(RecordError, match=r"column 'angle_2' is of no joint \(allowed: angle_1; or --map of all\)"):
        read(clean(), joints=("1",))


def test_word_of_columns_of_other_joints_is_refused_in_one_line() -> None:
    log = clean().rename(columns={"speed_1": "w1", "speed_2": "w5"})
    with pytest.raises(
        RecordError, match=r"no column 'speed_hand' beside 'w1' \(allowed: of all 2 joints, or --joints elbow"
    ):
        read(log, joints=("elbow", "hand"), columns={"w": "speed"})


def test_words_of_a_log_stand_for_joints_that_have_but_numbers() -> None:
    """In the order of the columns; where these are not of all joints, no word stands for any."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_shoulder").replace("_2", "_elbow"))
    np.testing.assert_array_equal(read(log).torques, read(clean()).torques)
    assert [repair.kind for repair in read(log).repairs] == ["columns"]
    with pytest.raises(RecordError, match="no column 'angle_1'"):
        read(log.rename(columns={"torque_elbow": "torque_wrist"}))


def test_joint_without_a_column_for_its_torque_has_none() -> None:
    """And that is said; without an angle a joint is no joint of the log."""
    record = read(clean().drop(columns="torque_2"))
    assert record.torques[:, 0].any()
    assert not record.torques[:, 1].any()
    assert [repair.text for repair in record.repairs] == ["no torque of joint 2: it is 0, as without a motor"]
    with pytest.raises(RecordError, match="no column 'angle_2' beside 'angle_1'"):
        read(clean().drop(columns="angle_2"))


def test_columns_of_one_joint_need_no_number() -> None:
    """As a bench of one joint writes them; of two joints nobody knows whose they are."""
    log = clean()[["time", "angle_1", "speed_1", "torque_1"]]
    bare = log.set_axis(["time", "position", "velocity", "torque"], axis=1)
    (usual,), (record,) = (every_run(intake(("shoulder",)), [each]) for each in (log, bare))
    for kind in ("angles", "speeds", "torques"):
        np.testing.assert_array_equal(getattr(record, kind), getattr(usual, kind))
    assert [each.text for each in record.repairs] == ["position is the angle; velocity is the speed"]
    with pytest.raises(RecordError, match="no column 'angle_1' among time, position, velocity, torque"):
        read(bare)


def test_column_of_no_joint_is_refused_in_its_own_spelling() -> None:
    """As where some joints of a robot are estimated, and the log numbers all of them."""
    log = clean()
    log = log.set_axis([name.replace("angle", "position") for name in log], axis=1).assign(position_3=0.0)
    said = (
        r"'position_3' is of no joint \(allowed: position_1 to position_2, or named as position_j2; or --map of all\)"
    )
    with pytest.raises(RecordError, match=said):
        every_run(intake(("j2", "j4")), [log])
    odd = r"position_3' is of no joint \(allowed: position_1 to position_2, or named as position_\\1; or --map of all\)"
    with pytest.raises(RecordError, match=odd):
        every_run(intake(("\\1", "j4")), [log])


def test_map_says_what_a_column_is() -> None:
    """A name that means nothing by itself; a wrong one is refused with what is allowed."""
    log = clean().rename(columns={"torque_1": "pwm a", "torque_2": "pwm b"})
    record = read(log, columns={"pwm a": "torque_1", "pwm b": "torque_2"})
    np.testing.assert_array_equal(record.torques, read(clean()).torques)
    for mapping, says in (
        ({"pwm c": "torque_1"}, "did you mean 'pwm b'?"),
        ({"pwm a": "torque_3"}, "did you mean 'torque_2'?"),
    ):
        with pytest.raises(RecordError, match="map") as refused:
            read(log, columns=mapping)
        assert says in str(refused.value)


@pytest.mark.parametrize("called", ["tau_raw{}", "{} sensor [Nm]", "Tau-{}-filtered"])
@pytest.mark.parametrize("first", [0, 1])
def test_map_says_what_all_columns_of_a_word_are(called: str, first: int) -> None:
    """Whatever the case and what stands between; a wrong word is refused with those that there are."""
    words = {f"torque_{joint + 1}": called.format(joint + first) for joint in range(2)}
    log = clean().rename(columns=words).assign(torque_1=0.0, torque_2=0.0)
    word = called.replace("{}", "").strip(" -").lower()
    for mapping in ({word: "torque"}, {"torque": word}):
        np.testing.assert_array_equal(read(log, columns=mapping).torques, read(clean()).torques)
    with pytest.raises(RecordError, match=r"map: unknown word 'taus'.*angle, speed, .*torque"):
        read(log, columns={"taus": "torque"})


def test_map_goes_by_names_of_joints_as_well() -> None:
    """Which may stand anywhere in the columns' names."""
    log = clean().rename(columns={"torque_1": "arm/elbow/sensor", "torque_2": "arm/hand/sensor"})
    log = log.rename(columns=lambda name: name.replace("_1", "_elbow").replace("_2", "_hand"))
    record = read(log, joints=("hand", "elbow"), columns={"arm/sensor": "torque"})
    np.testing.assert_array_equal(record.torques, read(clean()).torques[:, ::-1])


def test_user_says_how_the_log_calls_the_joints() -> None:
    """By the robot's names or numbers, beside what else is said; what a log without them calls them is proposed."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_hnd").replace("_2", "_elb"))
    log = log.rename(columns=lambda name: name.replace("torque", "load"))
    for said in ({"elb": "elbow", "hnd": "hand"}, {"elb": "2", "hnd": "1"}):
        record = read(log, joints=("hand", "elbow"), columns={**said, "load": "torque"})
        np.testing.assert_array_equal(record.torques, read(clean()).torques)
    with pytest.raises(RecordError, match=r"map hip=1: no column has 'hip'"):
        read(log, joints=("hand", "elbow"), columns={"hip": "1"})
    with pytest.raises(RecordError, match=r"no column 'angle_1'.*or --map hnd=hand"):
        read(log, joints=("hand", "elbow"))


def test_joints_are_known_by_a_part_of_their_names() -> None:
    """As of a robot whose file puts a prefix before all of them; by a part that several have none is."""
    log = clean().rename(columns=lambda name: name.replace("_1", "_elbow_joint").replace("_2", "_wrist_joint"))
    record = read(log, joints=("left_wrist_pan_joint", "left_elbow_joint"))
    np.testing.assert_array_equal(record.angles, read(clean()).angles[:, ::-1])
    with pytest.raises(RecordError, match=r"no column 'angle_1'"):
        read(log, joints=("wrist_pan_joint", "wrist_tilt_joint"))


def test_other_columns_that_may_be_torques_are_named() -> None:
    """Where nobody has said which they are; what was only wished is no measurement."""
    others = {f"{word}{joint}": 0.0 for word in ("tau_motor", "tau_cmd", "tau_model") for joint in (1, 2)}
    (said,) = read(clean().assign(**others)).repairs
    assert said.text == "tau_motor may be torques, too: --map tau_motor=torque reads them instead"
    named = {"torque_1": "torque_1", "torque_2": "torque_2"}
    assert not read(clean().assign(**others).rename(columns={"tau_motor2": "x"}), columns=named).repairs


def test_torques_that_are_0_are_read_from_what_else_may_be_torques() -> None:
    """As of a robot whose log has one column for what is computed, and others for what is measured one way or another;
    where all are 0, that is refused.
    """
    log = clean().rename(columns={f"torque_{joint}": f"tau_motor{joint}" for joint in (1, 2)})
    unused = {f"{word}{joint}": 0.0 for word in ("tau", "tau_sensor") for joint in (1, 2)}
    record = read(log.assign(**unused)[[*unused, *log]])
    np.testing.assert_array_equal(record.torques, read(clean()).torques)
    assert record.repairs[-1].text == "torques are 0: tau_motor is read instead, as by --map tau_motor=torque"
    with pytest.raises(RecordError, match="every torque is 0"):
        read(log.assign(**unused, tau_motor1=0.0, tau_motor2=0.0)[[*unused, *log]])


@pytest.mark.parametrize("speed", ["theta_dot{}", "D_Theta_{}", "q{}_dot", "der_pos_{}", "dot_phi_{}"])
def test_speed_is_the_derivative_of_an_angle(speed: str) -> None:
    """Of which an acceleration is not one."""
    log = clean().rename(columns={f"speed_{joint}": speed.format(joint) for joint in (1, 2)})
    log = log.assign(**{f"theta_ddot{joint}": 0.0 for joint in (1, 2)}, d_d_theta_1=0.0, d_d_theta_2=0.0)
    np.testing.assert_array_equal(read(log).speeds, read(clean()).speeds)
