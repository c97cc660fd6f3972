"""Times are those at which a robot was read, whatever a host wrote: order, gaps, jitter and repeated rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from metaid.recorded import every_run
from tests.clean_logs import clean, intake, kinds, read


def test_disorder_and_repeated_rows_are_mended() -> None:
    """Rows are sorted by time, and one that is there twice is left out."""
    log, usual = clean(), read(clean())
    order = np.arange(len(log))
    order[[10, 11, 500, 501]] = order[[11, 10, 501, 500]]
    record = read(pd.concat([log.iloc[order], log.iloc[700:720]]).reset_index(drop=True))
    np.testing.assert_array_equal(record.times, usual.times)
    np.testing.assert_array_equal(record.angles, usual.angles)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("order", 3), ("repeated times", 20)]


def test_log_is_cut_into_runs_at_gaps_and_where_its_clock_was_set_back() -> None:
    """Each begins at 0, and the first says it."""
    log = clean()
    gap = log.assign(time=np.where(log["time"] < 4.0, log["time"], log["time"] + 1e6))
    again = log.assign(time=np.where(log["time"] < 4.0, log["time"], log["time"] - 4.0))
    for broken, kind in ((gap, "gaps"), (again, "clock")):
        first, second = every_run(intake(), [broken])
        assert len(first.times) == len(second.times) == 800
        assert second.times[0] == 0.0
        assert (kinds(first), first.repairs[0].count) == ([kind], 1)


@pytest.mark.parametrize("has_speeds", [True, False])
@pytest.mark.parametrize(("jitter", "lost"), [(0.0005, 0.0), (0.0005, 0.1), (0.002, 0.01)])
def test_readings_tell_the_clock_that_a_host_jitters(has_speeds: bool, jitter: float, lost: float) -> None:
    """Times are several times closer to the truth than the stamps, whatever packets were lost; both are counted."""
    random, log = np.random.default_rng(5), clean(20.0)
    kept = random.random(len(log)) >= lost
    stamps = np.maximum.accumulate(log["time"] + jitter * np.abs(random.standard_normal(len(log))))
    true, log = log["time"][kept], log.assign(time=stamps)[kept].reset_index(drop=True)
    record = read(log if has_speeds else log.drop(columns=["speed_1", "speed_2"]))
    assert len(record.times) == len(true)
    assert np.std(record.times - true) < 0.5 * np.std(log["time"].to_numpy() - true.to_numpy())
    assert "jitter" in kinds(record)
    if lost:
        counts = {repair.kind: repair.count for repair in record.repairs}
        assert counts["lost rows"] == pytest.approx((~kept).sum(), rel=0.2)


def test_clock_of_stamps_that_jitter_by_more_than_a_period_is_even() -> None:
    """Where speeds tell what was lost; one that follows the stamps at each row is off by three times as much."""
    log, random = clean(20.0, 500.0), np.random.default_rng(3)
    stamps = np.maximum.accumulate(log["time"] + 0.0024 * np.abs(random.standard_normal(len(log))))
    kept = np.random.default_rng(10).random(len(log)) >= 0.01
    record = read(log.assign(time=stamps)[kept].reset_index(drop=True))
    assert np.std(record.times - log["time"][kept].to_numpy()) < 0.05 * 0.002


def test_true_stamps_of_an_irregular_log_are_kept() -> None:
    """Readings that were taken when the stamps say stay where they are."""
    times = clean(20.0)["time"].to_numpy()
    times = times + 5e-4 * np.random.default_rng(0).standard_normal(len(times))
    columns = {"time": times - times[0]}
    for joint, pulse in ((1, 3.1), (2, 5.3)):
        columns |= {f"angle_{joint}": np.sin(pulse * times), f"torque_{joint}": np.cos(pulse * times)}
    record = read(pd.DataFrame(columns))
    np.testing.assert_array_equal(record.times, columns["time"])


def test_rows_that_repeat_readings_of_a_moving_robot_are_left_out() -> None:
    """A packet that was written twice with other stamps; at rest readings may be the same."""
    log = clean().round(4)
    twice = np.sort(np.concatenate([np.arange(len(log)), np.arange(100, 1500, 50)]))
    doubled = log.iloc[twice].reset_index(drop=True)
    doubled["time"] = log["time"][0] + np.arange(len(doubled)) / 200.0
    record = read(doubled)
    assert (record.repairs[0].kind, record.repairs[0].count) == ("repeated rows", 28)
    np.testing.assert_allclose(record.angles, log[["angle_1", "angle_2"]])


def test_angles_that_are_read_more_seldom_than_the_log_has_rows_are_read_once() -> None:
    """Of a controller that logs three rows to each reading, with speeds that are 0 but in the first; torques are what
    they were on average.
    """
    log = clean().iloc[:1500]
    first = np.arange(len(log)) // 3 * 3
    held = log.iloc[first].reset_index(drop=True).assign(time=log["time"], torque_1=log["torque_1"])
    held[["speed_1", "speed_2"]] *= 3.0 * (first == log.index)[:, None]
    record = read(held)
    assert [(repair.kind, repair.count) for repair in record.repairs] == [("repeated rows", 1000)]
    assert record.speeds is not None
    np.testing.assert_array_equal(record.angles, log[["angle_1", "angle_2"]][::3])
    np.testing.assert_allclose(record.speeds, log[["speed_1", "speed_2"]][::3])
    np.testing.assert_allclose(record.torques[:, 0], log["torque_1"].to_numpy().reshape(-1, 3).mean(axis=1))


def polled(every: float, lasts: tuple[int, ...]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A log of 50 Hz, and how a host writes it that polls every so many s: each packet is in one of some numbers of
    rows, one after the other, and the torques of every tenth come a row later than its angles.
    """
    log = clean(20.0, 50.0).round(4)
    packets = np.repeat(np.arange(len(log)), np.resize(lasts, len(log)))
    rows = log.iloc[packets].reset_index(drop=True).assign(time=every * np.arange(len(packets)))
    begins = np.flatnonzero(np.diff(packets, prepend=-1))[10::10]
    rows.loc[begins, ["torque_1", "torque_2"]] = rows.loc[begins - 1, ["torque_1", "torque_2"]].to_numpy()
    return log, rows


@pytest.mark.parametrize("speeds", ["as they are", "coarse", "none"])
def test_packets_that_a_host_writes_in_more_rows_or_fewer_are_of_a_regular_clock(speeds: str) -> None:
    """Whatever their speeds tell, and where it writes part of a packet before the rest: none is lost or there twice."""
    log, rows = polled(0.004, (3, 6, 6))
    names = ["speed_1", "speed_2"]
    if speeds == "none":
        rows = rows.drop(columns=names)
    elif speeds == "coarse":
        rows[names] = 1.25 * np.floor(rows[names] / 1.25)
    record = read(rows)
    np.testing.assert_allclose(record.angles, log[["angle_1", "angle_2"]])
    np.testing.assert_allclose(record.times, log["time"], atol=0.003)
    assert kinds(record) == ["repeated rows", "jitter"]


def test_fastest_readings_tell_the_clock_of_a_log_in_which_joints_mostly_creep() -> None:
    """Where they creep, the steps of the encoders hide when they were read."""
    times = np.arange(0.0, 20.0, 0.02)
    angle = np.where(times < 17.0, 0.3 * np.sin(0.5 * times), 0.3 * np.sin(8.5) + 3.0 * np.sin(4.0 * (times - 17.0)))
    log = pd.DataFrame({"time": times + 0.004 * np.tile([0.0, 1.0], 500), "angle_1": np.round(angle / 0.005) * 0.005})
    record = read(log.assign(torque_1=np.cos(times)), joints=("1",))
    np.testing.assert_allclose(np.diff(record.times), 0.02, rtol=0.01)
