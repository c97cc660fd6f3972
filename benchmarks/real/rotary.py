"""A Quanser QUBE, a rotary pendulum with one motor: from one swing-up to the other, angles after 0.3 s of simulation.

The log has the voltage of the motor, and nothing of the pendulum's joint, which has none. km/Rm times the voltage
stands for the torque; what the motor's speed takes off is friction. The makers' model is that of the repository. Its
arm turns the other way than the log's. In the third log the pendulum's encoder loses counts, and its zero moves between
0.7 and 1.3 rad: metaid names it beside the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import metaid
from benchmarks.real.double_pendulum import AHEAD, by_mujoco, simulations
from benchmarks.real.judging import ANGLES, Log, motion_of
from benchmarks.real.lines import Line, Table

REPOSITORY = "FurutaPendulumRL"  # of EmanuelSamir
RUNS, BROKEN = (1, 2), 3
SWUNG = 2.8  # s: then it is balanced
NEWTON_METRES = 0.042 / 8.4  # in a V: km / Rm
FRICTION = (0.0015 + 0.042**2 / 8.4, 0.0005)  # N m s, of the makers' model, the motor's included
MASS, LENGTH = (0.095, 0.024), (0.085, 0.129)  # of arm and pendulum, in kg and m
MOST_BESIDE = 0.5
MJCF = """<mujoco><option integrator="RK4" timestep="0.001"/><worldbody><body>
  <joint name="arm" axis="0 0 1" damping="{0}"/>
  <inertial pos="{1} 0 0" mass="{2}" diaginertia="1e-6 {3} {3}"/>
  <body pos="{4} 0 0"><joint name="pendulum" axis="1 0 0" damping="{5}"/>
    <inertial pos="0 0 {6}" mass="{7}" diaginertia="{8} {8} 1e-7"/></body>
</body></worldbody></mujoco>"""


def makers(place: Path, name: str, damping: tuple[float, float]) -> Path:
    """An MJCF of two rods with the makers' masses and lengths, and with some `damping`, in N m s."""
    arm, pendulum = (mass * length**2 / 12.0 for mass, length in zip(MASS, LENGTH, strict=True))
    numbers = (damping[0], LENGTH[0] / 2.0, MASS[0], arm, LENGTH[0], damping[1], LENGTH[1] / 2.0, MASS[1], pendulum)
    path = place / f"{name}.xml"
    path.write_text(MJCF.format(*numbers), encoding="utf-8")
    return path


def read_run(folder: Path, run: int) -> tuple[pd.DataFrame, Log]:
    """A log as its user has it, with the voltage alone, and its swing-up in N m."""
    kinds = {"angle_arm": "theta", "angle_pendulum": "alpha", "torque_arm": "Vin"}
    columns = {
        ours: pd.read_csv(folder / "PendulumData" / f"SwingUpData{run}" / own, header=None)
        for ours, own in kinds.items()
    }
    frame = pd.DataFrame({"time": columns["torque_arm"][0], **{name: each[1] for name, each in columns.items()}})
    times = frame["time"].to_numpy(dtype=float)
    angles = np.stack([frame["angle_arm"], np.unwrap(frame["angle_pendulum"])], axis=1)
    sent = np.stack([-NEWTON_METRES * frame["torque_arm"], np.zeros(len(frame))], axis=1)
    return frame, Log(f"run {run}", times, angles, sent).rows(times < SWUNG)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    nominal = makers(place, "nominal", (0.0, 0.0))
    lab = makers(place, "makers", FRICTION)
    runs = [read_run(folder, run) for run in RUNS]
    rows, words, shares = [], [], []
    for (learned, _), (_, other) in zip(runs, reversed(runs), strict=True):
        result = metaid.estimate(learned, nominal, scale={"arm": -NEWTON_METRES})
        words.append(result.verdict.word)
        own = place / "own.xml"
        result.model.write(own)
        motion, found = motion_of(other, ANGLES), {}
        for model, path in {"metaid, .xml": own, "the makers'": lab}.items():
            ends = [simulations(other, motion, by_mujoco(path), np.zeros(2), half) for half in (False, True)]
            found[model] = 1e3 * np.sqrt((np.concatenate(ends) ** 2).mean(axis=0))
            arm, pendulum = found[model]
            rows.append({"predicted": other.name, "model": model, "arm": f"{arm:.0f}", "pendulum": f"{pendulum:.0f}"})
        shares.append(float(np.linalg.norm(found["metaid, .xml"]) / np.linalg.norm(found["the makers'"])))
    yield Table(f"QUBE, one swing-up to the other, mrad after {AHEAD} s: {', '.join(words)}", rows)
    for (_, log), share in zip(reversed(runs), shares, strict=True):
        yield Line(f"QUBE, {log.name}: both joints beside the makers' model", share, MOST_BESIDE)
    every = [frame for frame, _ in (*runs, read_run(folder, BROKEN))]
    told = metaid.estimate(every, nominal, scale={"arm": -NEWTON_METRES})
    yield Table("QUBE, what is named of all three logs", [{"fact": fact.text} for fact in told.facts])
    named = told.facts[0].text.startswith(f"frame {BROKEN} contradicts the other logs")
    yield Line("QUBE: the log that is broken is named", float(named), 1.0, at_least=True)
