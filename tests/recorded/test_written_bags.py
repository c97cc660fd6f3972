"""The bags that `examples/write_log.py` writes, for those who have no robot."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from places import ROOT

pytest.importorskip("rosbags")


def test_bag_has_joint_states_as_a_driver_writes_them(tmp_path: Path) -> None:
    """Joints in the order of the alphabet, each with its own angle, speed and torque, and times to the ns."""
    from rosbags.highlevel import AnyReader

    log = pd.DataFrame({"time": [0.0, 1.002], "angle_1": [0.1, 0.2], "angle_2": [0.3, 0.4]})
    log = log.assign(speed_1=1.0, speed_2=2.0, torque_1=10.0, torque_2=20.0)
    write_bag = runpy.run_path(str(ROOT / "examples" / "write_log.py"))["write_bag"]
    write_bag(log, ["shoulder", "elbow"], tmp_path / "run")
    with AnyReader([tmp_path / "run"]) as bag:
        (topic,) = bag.connections
        *_, (_, stamp, raw) = bag.messages()
        last = bag.deserialize(raw, topic.msgtype)
    assert topic.topic == "/joint_states"
    assert stamp == 1_002_000_000
    assert (last.header.stamp.sec, last.header.stamp.nanosec) == (1, 2_000_000)
    assert last.name == ["elbow", "shoulder"]
    np.testing.assert_array_equal([last.position, last.velocity, last.effort], [[0.4, 0.2], [2, 1], [20, 10]])
