"""What a log has that no robot does is mended and told, or refused."""

from __future__ import annotations

import numpy as np
import pytest

from metaid.errors import RecordError
from tests.clean_logs import clean, kinds, read


def test_rows_without_a_number_are_left_out_and_counted() -> None:
    """Empty cells, words and infinity, in any column, and times that no clock says."""
    log = clean().astype({"torque_2": object})
    log.loc[17, "angle_1"], log.loc[40, "torque_2"], log.loc[41, "speed_1"] = np.nan, "lost", np.inf
    log.loc[60, "time"] = -1e30
    record = read(log)
    assert len(record.times) == len(log) - 4
    assert record.repairs[0].text == "4 rows without a number left out, the first row 18: angle_1"


def test_rows_that_a_recorder_wrote_before_it_had_readings_are_left_out() -> None:
    """As real recorders do: parts of other packets, and numbers that no unit has, between rows that look like some."""
    log = clean()
    for row, column, read_as in ((1, "angle_1", 253.0), (2, "angle_2", -1.6e189), (5, "torque_1", 3e307)):
        log.loc[row, column] = read_as
    record = read(log)
    assert (
        record.repairs[0].text == "the first 6 rows left out: angle_1 is 253 in row 2, where no joint of the log goes"
    )
    assert kinds(record) == ["head"]
    np.testing.assert_array_equal(record.torques, log[["torque_1", "torque_2"]].iloc[6:])


@pytest.mark.parametrize("size", [0.1, 3.0, 1e6])
def test_lone_wild_readings_are_replaced_by_what_their_neighbours_say(size: float) -> None:
    """Of angles, speeds and torques, each counted; no other reading is touched."""
    log, usual = clean(), read(clean())
    spoiled, rows = log.copy(), [50, 700, 1400]
    for column in ("angle_1", "speed_2", "torque_1"):
        spoiled.loc[rows, column] += size if column == "angle_1" else 8.0 * size
    record = read(spoiled)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("wild", 3)] * 3
    assert np.abs(record.angles - usual.angles).max() < 1e-3
    others = np.delete(np.arange(len(log)), rows)
    np.testing.assert_array_equal(record.torques[others], usual.torques[others])


def test_reading_of_a_robot_that_stops_at_once_is_no_wild_one() -> None:
    """As of an arm whose brakes close: torques and speeds are others after it than before."""
    log = clean()
    stopped = log["time"] >= 5.0
    for column, jerk in (("speed_1", 3.0), ("torque_1", -2.0)):
        log.loc[stopped, column] = 0.01 * log.loc[stopped, column]
        log.loc[stopped.idxmax(), column] = jerk
    log.loc[stopped, "angle_1"] = log["angle_1"][stopped.idxmax()]
    record = read(log)
    assert "wild" not in kinds(record)
    np.testing.assert_array_equal(record.torques, log[["torque_1", "torque_2"]])


def test_broken_sensor_is_refused() -> None:
    """One that is wild too often, and an angle that jumps farther than any joint turns."""
    for change, says in (
        (lambda log: log.assign(angle_1=log["angle_1"] + 0.5 * (np.arange(len(log)) % 20 == 0)), "wild readings"),
        (lambda log: log.assign(angle_1=log["angle_1"] + 2.0 * (np.arange(len(log)) > 800)), "angle_1 jumps by 2"),
    ):
        with pytest.raises(RecordError, match=says):
            read(change(clean()))


def test_torques_that_a_controller_sends_in_steps_are_kept() -> None:
    """Every tenth as large as the motor can, where what it follows jumps: that is no broken sensor."""
    log = clean()
    log.loc[log.index % 10 == 0, "torque_1"] += 30.0
    record = read(log)
    assert [(repair.kind, repair.text.partition(" ")[0]) for repair in record.repairs] == [("steps", "torque_1")]
    np.testing.assert_array_equal(record.torques, log[["torque_1", "torque_2"]])


def test_angles_that_were_cut_at_a_full_turn_go_on() -> None:
    """As of an encoder that says −π to π."""
    log = clean()
    whole = 3.0 * log["angle_1"] + 1.0
    usual = read(log.assign(angle_1=whole, speed_1=3.0 * log["speed_1"]))
    wrapped = (whole + np.pi) % (2.0 * np.pi) - np.pi
    record = read(log.assign(angle_1=wrapped, speed_1=3.0 * log["speed_1"]))
    np.testing.assert_allclose(np.diff(record.angles, axis=0), np.diff(usual.angles, axis=0), atol=1e-9)
    assert kinds(record) == ["turns"]


def test_rest_that_rounding_hides_is_known_and_its_readings_are_kept() -> None:
    """Of a robot that waits after its motion: changed readings would make the printed error another than a user's."""
    log = clean(12.0)
    rests = (log["time"] > 4.0) & (log["time"] < 8.0)
    for column in log.columns[1:]:
        still = log[column][rests].iloc[0] if "speed" not in column else 0.0
        log.loc[rests, column] = still + 4e-5 * np.random.default_rng(1).standard_normal(int(rests.sum()))
    log["angle_1"], log["angle_2"] = log["angle_1"].round(4), log["angle_2"].round(4)
    log = log[(log["time"] <= 4.0) | rests].drop(columns=["speed_1", "speed_2"])
    record = read(log)
    assert record.rests is not None
    assert record.rests[(record.times > 4.5) & (record.times < 7.5)].all()
    assert not record.rests[record.times < 4.0].any()
    np.testing.assert_array_equal(record.angles, log[["angle_1", "angle_2"]])
    assert kinds(record) == ["rest"]


def test_speeds_without_a_sign_have_that_of_how_angles_change() -> None:
    """Of a joint whose angle falls. One that only rises has speeds above 0 by right."""
    log = clean()
    rising = log["time"] + 0.1 * np.sin(log["time"])
    log = log.assign(angle_2=rising, speed_2=1.0 + 0.1 * np.cos(log["time"]))
    record = read(log.assign(speed_1=log["speed_1"].abs()))
    assert record.speeds is not None
    fast = np.abs(log["speed_1"].to_numpy()) > 0.2
    np.testing.assert_allclose(record.speeds[fast, 0], log["speed_1"][fast])
    np.testing.assert_allclose(record.speeds[:, 1], log["speed_2"])
    assert [each.text for each in record.repairs] == ["speed_1 has no sign: taken from how angles change"]
