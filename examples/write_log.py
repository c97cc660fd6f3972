#!/usr/bin/env python3
"""Writes the log of a simulated rig: what `metaid estimate` reads (docs/log.md).

A controller moves the joints of a plant along sums of sinusoids, and what a rig would log is written as CSV: time,
angles and speeds as the sensors read them, and the torques that were sent. The controller knows nothing of the plant
but what its gains and its nominal model say.

    python examples/write_log.py damped-three-link -o log.csv --seconds 20 --angle-noise 1e-4

Where the output is no CSV it is the folder of a ROS 2 bag, as `ros2 bag record /joint_states` writes it; that needs
rosbags (docs/ur5e.md):

    python examples/write_log.py puma560 -o run1 --angle-noise 1e-4
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from metaid import load_plant
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant

HARMONICS = 4
SLOWEST = 0.25  # Hz
STIFF = 15.0  # rad/s, of the controller
FIELDS = ("position", "velocity", "effort")  # of a message


def simulated_log(
    plant: str | Path, seconds: float = 20.0, reach: float = 0.6, angle_noise: float = 0.0, seed: int = 1
) -> pd.DataFrame:
    """The log of a simulated plant: `time` in s, and of every joint `angle_1` in rad, `speed_1` in rad/s, `torque_1` in
    N m.

    Args:
        plant: a shipped name, or the path of a plant file.
        seconds: how long the log is.
        reach: how far the joints go from where they begin, in rad.
        angle_noise: of the angles that are written, a standard deviation in rad; speeds have ten times as much.
        seed: of the motion and the noise.
    """
    rig = load_plant(plant)
    random = np.random.default_rng(seed)
    steps, n = round(seconds / rig.timestep), rig.njoint
    is_arm = isinstance(rig, ArmPlant)
    tree = rig.tree
    wrong = tree.with_parameters(tree.parameters * 1.1)  # no rig's controller is exact
    home = rig.home if is_arm else np.zeros(n)
    pulse = 2.0 * np.pi * SLOWEST * np.arange(1, HARMONICS + 1)
    sizes = random.standard_normal((2, HARMONICS, n)) / np.arange(1, HARMONICS + 1)[:, None]
    sizes *= reach / np.abs(sizes).sum(axis=(0, 1))
    times = rig.timestep * np.arange(steps)
    angles, speeds, torques = np.empty((3, steps, n))
    if is_arm:
        from metaid.plant import ArmStart

        rig.push(ArmStart(home, np.zeros(n)))
    else:
        from metaid.plant import Start

        rig.push(Start(np.zeros(n), home))
    for step, time in enumerate(times):
        phase = pulse * time
        sine, cosine = np.sin(phase), np.cos(phase)
        begun = 1.0 - np.exp(-((time / 0.5) ** 2))  # so that nothing jerks
        wanted = home + begun * (sine @ sizes[0] + (1.0 - cosine) @ sizes[1])
        wanted_speed = begun * ((pulse * cosine) @ sizes[0] + (pulse * sine) @ sizes[1])
        angle, speed = rig.states()
        acceleration = STIFF**2 * (wanted - angle) + 2.0 * STIFF * (wanted_speed - speed)
        torque = joint_torque(wrong, angle, speed, acceleration)
        angles[step], speeds[step], torques[step] = angle, speed, torque
        rig.apply_torque(torque)
        rig.step()
    angles += angle_noise * random.standard_normal(angles.shape)
    speeds += 10.0 * angle_noise * random.standard_normal(speeds.shape)
    columns = {"time": times}
    for kind, values in (("angle", angles), ("speed", speeds), ("torque", torques)):
        columns |= {f"{kind}_{joint + 1}": values[:, joint] for joint in range(n)}
    return pd.DataFrame(columns)


def write_bag(log: pd.DataFrame, joints: Sequence[str], folder: Path) -> None:
    """A ROS 2 bag of joint states, with the `joints` in the order of the alphabet, as drivers have them."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState")
    header, stamp, states = (store.types[kind] for kind in kinds)
    order = sorted(range(len(joints)), key=lambda joint: joints[joint])
    names = [joints[joint] for joint in order]
    columns = [[f"{kind}_{joint + 1}" for joint in order] for kind in ("angle", "speed", "torque")]
    values = [np.ascontiguousarray(log[each], dtype=np.float64) for each in columns]  # row by row
    with Writer(folder, version=9) as bag:
        topic = bag.add_connection("/joint_states", kinds[2], typestore=store)
        for row, time in enumerate((1e9 * log["time"]).round().astype(int)):
            at = header(stamp=stamp(sec=time // 10**9, nanosec=time % 10**9), frame_id="base_link")
            message = states(header=at, name=names, **dict(zip(FIELDS, (kind[row] for kind in values), strict=True)))
            bag.write(topic, time, store.serialize_cdr(message, kinds[2]))


def main() -> None:
    """Writes the log that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plant", help="a shipped name, or the path of a plant file")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the log: FILE.csv, or the folder of a bag")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--reach", type=float, default=0.6, help="rad")
    parser.add_argument("--angle-noise", type=float, default=0.0, help="rad")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    log = simulated_log(given.plant, given.seconds, given.reach, given.angle_noise, given.seed)
    if given.output.suffix == ".csv":
        log.to_csv(given.output, index=False, float_format="%.9g")
        return
    rig = load_plant(given.plant)
    numbers = [str(joint + 1) for joint in range(rig.njoint)]
    write_bag(log, rig.tree.names if isinstance(rig, ArmPlant) else numbers, given.output)


if __name__ == "__main__":
    main()
