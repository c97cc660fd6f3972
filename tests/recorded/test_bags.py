"""Bags of ROS 1 and ROS 2 and bare MCAP say the same as a CSV of the same motion."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import Finished
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from swinging import log_of, swinging_arm

from metaid.errors import RecordError
from metaid.recorded import Intake, every_run

JOINTS = ("turret", "shoulder", "elbow")
START = 1_700_000_000_000_000_000  # ns
KINDS = ("position", "velocity", "effort")


def moved() -> pd.DataFrame:
    """A log of a simulated arm, times in ns since 1970."""
    record = log_of(swinging_arm(), noise=1e-4, seconds=3.0)
    speeds = np.gradient(record.angles, record.times, axis=0)
    kinds = zip(KINDS, (record.angles, speeds, record.torques), strict=True)
    columns = {f"{kind}_{name}": read[:, i] for kind, read in kinds for i, name in enumerate(JOINTS)}
    return pd.DataFrame({"time": START + np.round(1e9 * record.times).astype(np.int64), **columns})


def messages(log: pd.DataFrame, store: Any, kinds: Sequence[str] = KINDS, **header: int) -> list[tuple[int, Any]]:
    """Joint states of a log with some `kinds` of readings, and others before them in another order of joints."""
    types = store.types
    time, head = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    state = types["sensor_msgs/msg/JointState"]
    order = JOINTS[::-1]
    found = []
    for row in log.to_dict("records"):
        stamp = int(row["time"])
        own = head(stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="", **header)
        read = {
            kind: np.array([row[f"{kind}_{name}"] for name in order]) if kind in kinds else np.zeros(0)
            for kind in KINDS
        }
        found.append((stamp + 300_000, state(header=own, name=list(order), **read)))
    return found


def write(path: Path, topics: dict[str, Sequence[str]], log: pd.DataFrame, how: str) -> Path:
    """A bag with joint states of some kinds under each topic."""
    name = "sensor_msgs/msg/JointState"
    if how == "ROS 1":
        store = get_typestore(Stores.ROS1_NOETIC)
        with Writer1(path.with_suffix(".bag")) as one:
            for topic, kinds in topics.items():
                connection = one.add_connection(topic, name, typestore=store)
                for stamp, message in messages(log, store, kinds, seq=0):
                    one.write(connection, stamp, store.serialize_ros1(message, name))
        return path.with_suffix(".bag")
    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.SQLITE3 if how == "ROS 2, sqlite3" else StoragePlugin.MCAP
    with Writer2(path, version=9, storage_plugin=plugin) as two:
        for topic, kinds in topics.items():
            connection = two.add_connection(topic, name, typestore=store)
            for stamp, message in messages(log, store, kinds):
                two.write(connection, stamp, store.serialize_cdr(message, name))
    return next(path.glob("*.mcap")) if how == "bare MCAP" else path


def intake(topic: str | None = None) -> Intake:
    return Intake(JOINTS, np.zeros(3, dtype=bool), topic=topic)


FORMATS = ("ROS 1", "ROS 2, sqlite3", "ROS 2, MCAP", "bare MCAP")


@pytest.mark.parametrize("how", FORMATS)
def test_bag_is_read_as_the_table_of_the_same_motion(how: str, tmp_path: Path) -> None:
    """To the last bit, by the stamps of its headers and by the names of its joints."""
    log = moved()
    log.to_csv(tmp_path / "log.csv", index=False)
    (theirs,) = every_run(intake(), [tmp_path / "log.csv"])
    (ours,) = every_run(intake(), [write(tmp_path / "bag", {"/joint_states": KINDS}, log, how)])
    for name in ("times", "angles", "speeds", "torques"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert any("1,501 messages of /joint_states" in repair.text for repair in ours.repairs)


def test_topic_is_asked_for_where_several_would_do(tmp_path: Path) -> None:
    """One that has what is needed is taken by itself; of two the user says which."""
    log = moved()
    path = write(tmp_path / "bag", {"/left": KINDS, "/right": KINDS, "/wished": ("position",)}, log, "ROS 2, MCAP")
    with pytest.raises(RecordError, match="--topic, of /left, /right"):
        every_run(intake(), [path])
    with pytest.raises(RecordError, match=r"did you mean '/right'\?"):
        every_run(intake("/rihgt"), [path])
    (record,) = every_run(intake("/right"), [path])
    assert len(record.times) == len(log)


def test_topics_with_some_kinds_of_readings_each_are_one_log(tmp_path: Path) -> None:
    """As of a driver that publishes efforts by themselves."""
    log = moved()
    path = write(tmp_path / "bag", {"/moves": KINDS[:2], "/efforts": KINDS[2:]}, log, "ROS 2, sqlite3")
    (record,) = every_run(intake(), [path])
    np.testing.assert_array_equal(record.torques, log[[f"effort_{name}" for name in JOINTS]])


def test_what_is_no_bag_is_refused_in_one_line(tmp_path: Path) -> None:
    """Each with its reason."""
    for name in ("log.bag", "log.db3", "log.mcap"):
        (tmp_path / name).write_bytes(b"not a bag at all" * 100)
        with pytest.raises(RecordError, match="not a bag"):
            every_run(intake(), [tmp_path / name])
    with pytest.raises(RecordError, match="No such file"):
        every_run(intake(), [tmp_path / "none.mcap"])


@pytest.mark.slow
def test_estimate_of_a_bag_is_that_of_the_table(metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """The same numbers, and the topic is said."""
    log = moved()
    log.to_csv("log.csv", index=False)
    write(Path("bag"), {"/joint_states": KINDS}, log, "ROS 2, MCAP")
    given = ("estimate", "--nominal", "spatial-three-link", "--friction", "viscous", "--window", "0.1", "--json")
    shown = [json.loads(metaid(*given, path).out) for path in ("bag", "log.csv")]
    assert shown[0]["parameters"] == shown[1]["parameters"]
