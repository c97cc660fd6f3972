"""Bags of ROS 1 and ROS 2, and bare MCAP, as tables: the joint states in them."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from metaid.errors import RecordError, optional_packages, unknown
from metaid.recorded.reading.readings import Repair, counted

BAGS = (".bag", ".db3", ".mcap")
MESSAGE = "sensor_msgs/msg/JointState"
KINDS = ("position", "velocity", "effort")
Topic = tuple[str, pd.DataFrame, tuple[Repair, ...]]


def is_bag(path: Path) -> bool:
    """Whether it is a bag: a file by its ending, or the folder of one of ROS 2."""
    return path.suffix in BAGS or (path / "metadata.yaml").exists()


def bag_tables(path: Path, topic: str | None) -> list[Topic]:
    """The joint states of a bag by topic and set of joints: the topic, a frame with `time_ns` and
    `position_NAME`, `velocity_NAME`, `effort_NAME` of each joint, and what was found.

    Args:
        path: of the bag.
        topic: of it; None: all of them.

    Raises:
        RecordError: it is no bag, or has no joint states there.
        MissingExtraError: rosbags is not installed.
    """
    with optional_packages("ros"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    if not path.exists():
        raise FileNotFoundError(2, "No such file or directory")
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            every = [each for each in reader.connections if each.msgtype == MESSAGE]
            topics = list(dict.fromkeys(each.topic for each in every))
            if topic is not None and topic not in topics:
                raise RecordError(f"{path}: {unknown('topic of joint states', topic, topics)}")
            if not topics:
                others = ", ".join(sorted({each.msgtype for each in reader.connections})[:6]) or "nothing"
                raise RecordError(f"{path}: {others} (allowed: a bag with {MESSAGE})")
            chosen = [each for each in every if topic in (None, each.topic)]
            read = _read(
                (connection.topic, stamp, reader.deserialize(raw, connection.msgtype))
                for connection, stamp, raw in reader.messages(chosen)
            )
    except (RecordError, OSError):
        raise
    except Exception as problem:  # its readers raise whatever a broken file makes them raise
        raise RecordError(f"{path}: not a bag: {problem or type(problem).__name__}") from None
    return [states.table() for states in read]


@dataclass
class _States:
    """The joint states of a topic whose messages have the same joints, as they are read.

    Attributes:
        topic: of them.
        joints: their names (njoint).
        stamps: of the headers, in ns.
        received: when they were recorded, in ns.
        kinds: positions, velocities and efforts, message by message.
    """

    topic: str
    joints: tuple[str, ...]
    stamps: array[int] = field(default_factory=lambda: array("q"))
    received: array[int] = field(default_factory=lambda: array("q"))
    kinds: tuple[array[float], ...] = field(default_factory=lambda: tuple(array("d") for _ in KINDS))

    def append(self, received: int, message: Any) -> None:
        """Takes up one message, of which a kind may be empty."""
        stamp = message.header.stamp
        self.stamps.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
        self.received.append(received)
        for kind, each in zip(self.kinds, (message.position, message.velocity, message.effort), strict=True):
            is_whole = len(each) == len(self.joints)
            kind.frombytes(np.asarray(each if is_whole else np.full(len(self.joints), np.nan), dtype=float).tobytes())

    def table(self) -> Topic:
        """The topic, a frame, and what was found."""
        stamps, received = (np.frombuffer(each, dtype=np.int64) for each in (self.stamps, self.received))
        has_stamps = len(np.unique(stamps[:100])) > 1
        columns: dict[str, Any] = {"time_ns": stamps if has_stamps else received}
        for kind, numbers in zip(KINDS, self.kinds, strict=True):
            each = np.frombuffer(numbers).reshape(-1, len(self.joints))
            if not np.isnan(each).all():
                columns |= {f"{kind}_{name}": column for name, column in zip(self.joints, each.T, strict=True)}
        clock = "their headers" if has_stamps else "when they were recorded, for their headers have none"
        text = f"{counted(len(stamps), 'message')} of {self.topic}, times of {clock}"
        return self.topic, pd.DataFrame(columns), (Repair("topic", len(stamps), text),)


def _read(messages: Iterable[tuple[str, int, Any]]) -> list[_States]:
    """The joint states of each topic and each set of joints."""
    found: dict[tuple[str, tuple[str, ...]], _States] = {}
    for topic, received, message in messages:
        key = topic, tuple(message.name)
        if key not in found:
            found[key] = _States(*key)
        found[key].append(received, message)
    return list(found.values())
