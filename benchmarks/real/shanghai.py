"""An arm of six joints of Shanghai Electric: from two logs of 22 s to the third, torques of the first three joints.

The logs are text of a controller, three rows of 2 ms to each reading. Its authors give a constant to the torques and
turn those of joint 3. What the drives of joints 4 to 6 log falls as they move faster, by more than friction holds:
metaid names these joints, and nothing is fitted to their torques. The nominal bodies are the authors' own, from a
drawing, in modified Denavit-Hartenberg frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd

import metaid
from benchmarks.real.judging import Log, Missed
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import (
    CLASSIC,
    STILL,
    YARDSTICK,
    file_error,
    nominal_error,
    read_test,
    recipes,
    rivals,
    row_of,
    summed,
)
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import arm_model

REPOSITORY = "robot_identification"  # of Naruton94
LOGS, NJOINT, JUDGED = (1, 2, 3), 6, 3
PERIOD, HELD = 0.002, 3  # s between rows, of which so many are of one reading
GEAR, COUNT = 101.0, np.repeat([3.442383e-4, 1.342773e-4], 3)  # N m in a count, at the motor
SIGNS = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
A, D = (0.0, 0.0, -0.416, -0.4208, 0.0, 0.0), (0.1181, 0.0, 0.0, 0.1301, 0.1021, 0.0568)  # m
ALPHA = (0.0, 0.5 * np.pi, 0.0, 0.0, 0.5 * np.pi, -0.5 * np.pi)
# Of each link mass in kg, first moment in kg m, and xx, xy, xz, yy, yz, zz in kg m² about the origin of its frame.
BODIES = np.array(
    [
        [2.0, -0.0165, -0.0256, -0.0456, 0.00389, 7.64e-5, 3.4e-4, 0.00333, 2.15e-4, 0.00263],
        [3.42, 0.4264, -0.0124, 0.3868, 0.0475, 3.0e-6, -0.05282, 0.13118, 0.00173, 0.08643],
        [1.26, 0.1391, 0.0, 0.0412, 0.00223, 0.0, -0.00375, 0.02647, 0.0, 0.02488],
        [0.8, 0.0, 0.0, -0.0048, 7.73e-4, 0.0, 0.0, 5.37e-4, -6.0e-6, 6.5e-4],
        [0.8, 0.0, -3.0e-4, -0.0046, 7.71e-4, 0.0, 0.0, 5.31e-4, 6.0e-6, 6.53e-4],
        [0.35, 0.0, 0.0, -0.0068, 2.61e-4, 0.0, 0.0, 2.62e-4, 0.0, 1.75e-4],
    ]
)
MOST_BESIDE = 1.0


def nominal(place: Path) -> Path:
    """A URDF of the authors' bodies."""
    parts, before = (
        ['<robot name="shanghai"><mujoco><compiler balanceinertia="true"/></mujoco><link name="base"/>'],
        "base",
    )
    for joint, (mass, *rest) in enumerate(BODIES.tolist()):
        com = np.array(rest[:3]) / mass
        xx, xy, xz, yy, yz, zz = rest[3:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * (
            com @ com * np.eye(3) - np.outer(com, com)
        )
        moments = " ".join(f'i{"xyz"[i]}{"xyz"[j]}="{about[i, j]:.9g}"' for i in range(3) for j in range(i, 3))
        sine, cosine = np.sin(ALPHA[joint]), np.cos(ALPHA[joint])
        parts.append(
            f'<link name="link{joint + 1}"><inertial><origin xyz="{com[0]:.9g} {com[1]:.9g} {com[2]:.9g}"/>'
            f'<mass value="{mass}"/><inertia {moments}/></inertial></link>'
            f'<joint name="joint{joint + 1}" type="continuous"><parent link="{before}"/><child link="link{joint + 1}"/>'
            f'<origin xyz="{A[joint]} {-sine * D[joint]:.9g} {cosine * D[joint]:.9g}" rpy="{ALPHA[joint]:.12g} 0 0"/>'
            '<axis xyz="0 0 1"/></joint>'
        )
        before = f"link{joint + 1}"
    path = place / "shanghai.urdf"
    path.write_text("".join(parts) + "</robot>", encoding="utf-8")
    return path


def read_log(folder: Path, number: int) -> tuple[pd.DataFrame, Log]:
    """A log as its user has it, with the authors' constants, and the readings of it."""

    own = folder / "matlab_identification" / "data" / f"DataOutput_Traj{number}"

    def columns_of(kind: str) -> Array:
        paths = [own / f"DataOutput_{kind}{joint}.txt" for joint in range(1, NJOINT + 1)]
        cells = [pd.read_csv(path, sep=":=|F", engine="python", header=None, usecols=[1])[1] for path in paths]
        return np.column_stack(cells).astype(np.float64)

    kinds = ("theta", "velocity", "torque")
    angles, speeds, torques = columns_of("theta"), columns_of("velocity"), GEAR * COUNT * SIGNS * columns_of("torque")
    times = PERIOD * np.arange(len(angles), dtype=np.float64)
    columns = {
        f"{kind}{joint + 1}": each[:, joint]
        for kind, each in zip(kinds, (angles, speeds, torques), strict=True)
        for joint in range(NJOINT)
    }
    fresh = np.flatnonzero(np.append(True, (np.diff(angles, axis=0) != 0.0).any(axis=1)))
    return pd.DataFrame({"time": times, **columns}), Log(f"log {number}", times[fresh], angles[fresh], torques[fresh])


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    urdf = nominal(place)
    arm, plain = load_plant(urdf), mujoco.MjModel.from_xml_path(str(urdf))
    assert isinstance(arm, ArmPlant)
    classic = arm_model(arm.tree, CLASSIC).with_still(np.full(NJOINT, STILL))
    logs = [read_log(folder, number) for number in LOGS]
    first = metaid.estimate([frame for frame, _ in logs], urdf, friction=CLASSIC)
    falls = [name for fact in first.facts for name in fact.option.removeprefix("--untrusted ").split(",")]
    yield Table("Shanghai Electric, what is named first", [{"fact": fact.text} for fact in first.facts])
    found: dict[str, list[Missed]] = {}
    words = []
    for number, (_, other) in enumerate(logs):
        rest = [each for i, each in enumerate(logs) if i != number]
        learned, test = [log for _, log in rest], read_test(other)
        result = metaid.estimate([frame for frame, _ in rest], urdf, untrusted=falls)
        words.append(result.verdict.word)
        path = place / f"shanghai_{number}.py"
        result.model.write(path)
        found.setdefault("metaid, .py", []).append(file_error(path, [test]))
        nominal_own = nominal_error(plain, [read_test(log) for log in learned], [test])
        found.setdefault("the authors' bodies as they are, and fitted friction", []).append(nominal_own)
        least = rivals({"": classic}, learned, [test])[""][1]
        found.setdefault("least squares, the best filter and weights", []).append(least)
        for rival, each in recipes(classic, learned, [test]).items():
            found.setdefault(rival, []).append(each)
    every = {name: _judged(summed(each)) for name, each in found.items()}
    title = f"Shanghai Electric, torque at {YARDSTICK} Hz, from two logs to the third: {', '.join(words)}"
    yield Table(title, [row_of(name, each) for name, each in every.items()])
    beside = every["metaid, .py"].relative / every["least squares, the best filter and weights"].relative
    yield Line("Shanghai Electric: .py beside tuned least squares", beside, MOST_BESIDE)


def _judged(missed: Missed) -> Missed:
    """That of the joints whose torques are what their motors send."""
    return Missed(missed.squares[:JUDGED], missed.whole[:JUDGED])
