"""A KUKA KR300: two of three logs of 10 s to the third, by what its authors say of it and by others.

Torques are those of the motors times the ratios of the gears; angles are those of the motors. The hydraulic
counterbalance of joint 2 is a gas spring whose data the authors have read off the robot: its torque is taken off the
log, as a user does who knows of it. The nominal bodies are those of the authors, of the manufacturer's drawings, with
150 kg on the flange. Instruments are the motions that were asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from scipy.io import loadmat

from benchmarks.real.judging import Log, missed
from benchmarks.real.least_squares import instrumental, prepared
from benchmarks.real.lines import Line, Table
from benchmarks.real.torques import Turn, arm_and_terms, in_turn, read_test
from metaid.models import Array

REPOSITORY = "Robot_Identification"  # of JonasWeigand, MIT
LOGS = "data/recorded_trajectories/2020-10-21 10s FF {0} 08ms/data.mat"
MODEL = "robot_model/model_KUKA_Quantec_Ultra_KR300.m"
NAMES = ("A", "B", "C")
RATIOS = np.array([1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340])  # turns of the motors for one
STRAIGHT = np.array([0.0, -np.pi / 2, np.pi, 0.0, 0.0, 0.0])  # rad, of the joints where the log is at 0
PAYLOAD, PAYLOAD_AT, FLANGE, FLANGE_AT = 150.0, 0.1, 17.78, -0.05  # kg and m
CUTOFF = 7.5  # Hz, of instrumental variables
MOST, MOST_BESIDE = 0.15, 1.1
AUTHORS = "its authors' bodies, fitted friction"


def counterbalance(angle: Array) -> Array:
    """The torque (...) of joint 2's gas spring at its angles (...), in rad: nitrogen behind a piston."""
    anchor, crank, area = 0.8, 0.2, np.pi * (0.055**2 - 0.030**2) / 4.0  # m, m, m²
    gas, room = 1.01 * 296.8 * 328.0 * 2.0 * 0.0795, 2.0 * 0.00048  # J, m³
    turned = angle + np.deg2rad(95.0)
    length = np.sqrt(anchor**2 + crank**2 - 2.0 * anchor * crank * np.cos(turned))
    lever = np.sin(turned) * anchor * crank / length
    return np.asarray(lever * area * gas / (room - (length - anchor + crank) * area), dtype=np.float64)


def read_log(path: Path, name: str) -> tuple[Log, Log]:
    """A log of the repository, and the motion that was asked for with the same torques."""
    recorded = loadmat(path, squeeze_me=True, struct_as_record=False)["rec"]
    angles = np.deg2rad(recorded.act_pos_mot_deg.T) + STRAIGHT
    torques = recorded.act_torque_abs_nm.T * RATIOS
    torques[:, 1] -= counterbalance(angles[:, 1])
    asked = np.deg2rad(recorded.ref_pos_deg.T) + STRAIGHT
    return Log(f"kr300_{name}", recorded.time_cont, angles, torques), Log("asked", recorded.time_cont, asked, torques)


def _numbers(text: str, key: str) -> Array:
    """The numbers of a key in the text of a link, with a power of ten behind brackets."""
    found = re.search(rf"'{key}'\s*,\s*(\[[^\]]*\]|[^,\s]+)(?:\*10\^-(\d))?", text)
    assert found is not None
    values = [
        np.prod([_angle(part) for part in each.split("*")]) for each in re.split(r"[\s,]+", found[1].strip("[] "))
    ]
    return np.asarray(np.array(values) * 10.0 ** -float(found[2] or 0), dtype=np.float64)


def _angle(text: str) -> float:
    first, _, second = text.replace("pi", str(np.pi)).partition("/")
    return float(first) / float(second or 1.0)


def nominal(folder: Path, place: Path) -> Path:
    """An MJCF of the authors' model, in a `place`."""
    text = re.sub(r"\.\.\.[^\n]*", "", (folder / MODEL).read_text(encoding="utf-8", errors="replace"))
    mass = PAYLOAD + FLANGE
    centre = (PAYLOAD * PAYLOAD_AT + FLANGE * FLANGE_AT) / mass
    links = re.findall(r"Link\('revolute'(.*?)\);", text, re.DOTALL)
    before, bodies = np.diag([1.0, -1.0, -1.0, 1.0]), ""  # the base hangs, as its frame has it
    for number, link in enumerate(links, 1):
        offset, along, twist = (float(_numbers(link, key)[0]) for key in ("d", "a", "alpha"))
        after = np.eye(4)
        after[:3, 3] = along, 0.0, offset
        after[1:3, 1:3] = [[np.cos(twist), -np.sin(twist)], [np.sin(twist), np.cos(twist)]]
        last = number == len(links)
        weight = mass if last else float(_numbers(link, "m")[0])
        com = np.array([0.0, 0.0, centre]) if last else _numbers(link, "r")
        xx, yy, zz, xy, yz, xz = np.array([0.02 * mass] * 3 + [0.0] * 3) if last else _numbers(link, "I")
        turned = after[:3, :3]
        inertia = turned @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turned.T
        upper = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        rotor = float(_numbers(link, "Jm")[0]) * RATIOS[number - 1] ** 2
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(before[:3, :3]).ravel())
        bodies += (
            f'<body pos="{_text(before[:3, 3])}" quat="{_text(quaternion)}">'
            f'<joint name="joint_{number}" axis="0 0 1" armature="{rotor:.9g}"/><inertial mass="{weight:.9g}" '
            f'pos="{_text(turned @ com + after[:3, 3])}" fullinertia="{_text(upper)}"/>'
        )
        before = after
    path = place / "kr300.xml"
    whole = bodies + "</body>" * len(links)
    path.write_text(f'<mujoco><compiler angle="radian"/><worldbody>{whole}</worldbody></mujoco>', encoding="utf-8")
    return path


def _text(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; CSV and model files are written to a `place`."""
    logs = {name: read_log(folder / LOGS.format(name), name) for name in NAMES}
    xml = nominal(folder, place)
    plain, classic = arm_and_terms(xml)
    turns = []
    pairs = []
    for name, (left_out, _) in logs.items():
        learned, asked = zip(*(each for other, each in logs.items() if other != name), strict=True)
        turns.append(Turn(name, [log.write(place) for log in learned], learned, read_test(left_out)))
        values = instrumental(classic, learned, asked, CUTOFF)
        test = turns[-1].test
        pairs.append(test.pair(prepared(classic, test.motion).predicted(values)))
    own = in_turn(turns, xml, place, (AUTHORS, plain), classic)
    by_instruments = {f"instrumental variables, {CUTOFF:g} Hz": missed(pairs)}
    yield from replace(own, found={**own.found, **by_instruments}).told("KR300", "two logs to the third", MOST_BESIDE)
    ours = own.found["metaid, .py"].relative
    yield Line("KR300: torque by the .py", ours, MOST)
    yield Line("KR300: .py beside the authors' bodies", ours / own.found[AUTHORS].relative, 1.0)
