"""A double and a triple pendulum that swing freely, without a motor or a torque: angles of what follows, simulated.

The builders' parameters were fitted to simulations of the very pieces of the log that metaid learns from. What is
predicted are their pieces for validation, from states that differences of angles tell. Angles are those of the links
against the base, 0 where these stand upright; the nominal links are those of the builders' simulation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import scipy.io
from scipy import signal

import metaid
from benchmarks.real.judging import Log, simulated
from benchmarks.real.lines import Line, Table
from metaid.models import Array

REPOSITORY = "MultiArm-Pendulum"  # of dynamicslab, MIT
DATA = "ParameterEstimation/{0}Pendulum/{0}PendulumDataForParameterEstimation.mat"
FITTED = "ParameterEstimation/{0}Pendulum/EstimatedParameters_{0}Pendulum.mat"
NAMES = {"Double": 2, "Triple": 3}
LINKS = {
    "length": (0.1727, 0.2286, 0.2413),
    "mass": (0.11, 0.12, 0.1),
    "com": (0.08755, 0.127, 0.12),
    "inertia": (0.001578, 0.0029, 0.002157),
}
AHEAD = (0.3, 1.0, 2.0)  # s
EVERY, EDGE = 0.1, 0.05  # s: between two starts, and at both ends of the log
SAVGOL = {"window_length": 21, "polyorder": 5}  # readings, of the speeds at starts
MOST_BESIDE, MOST = 1.0, 5.0  # of the builders' error after AHEAD[0], and mrad


def read_log(folder: Path, name: str, which: str) -> Log:
    """The pieces `id` or `vad` of a log one after the other, as joint angles."""
    data = scipy.io.loadmat(folder / DATA.format(name))
    times = np.concatenate([each.ravel() for each in data[f"Time_{which}"].ravel()])
    links = np.concatenate([each.T for each in data[f"Y_{which}"].ravel()])[:, : NAMES[name]]
    angles = np.diff(links, axis=1, prepend=0.0)
    return Log(f"{name.lower()}_{which}", times, angles, np.zeros_like(angles))


def fitted(folder: Path, name: str) -> Any:
    """The pendulum that the builders identified, as MuJoCo has it."""
    n = NAMES[name]
    values = scipy.io.loadmat(folder / FITTED.format(name))["EstimatedParameters"].ravel().tolist()
    lengths = [*values[2 * n : 3 * n - 1], 0.0]
    inertias, damping = values[3 * n - 1 : 4 * n - 1], values[4 * n - 1 : 5 * n - 1]
    links = zip(values[:n], values[n : 2 * n], [0.0, *lengths], inertias, damping, strict=False)
    bodies = "".join(
        f'<body pos="0 0 {height}"><joint axis="0 1 0" damping="{rubs}"/>'
        f'<inertial pos="0 0 {centre}" mass="{mass}" diaginertia="{own} {own} {own}"/>'
        for mass, centre, height, own, rubs in links
    )
    option = f'<option integrator="RK4" timestep="0.001" gravity="0 0 {-values[-1]}"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{bodies}{'</body>' * n}</worldbody></mujoco>")


def nominal_file(place: Path, name: str) -> Path:
    """A list of links, as a plant's file."""
    path = place / f"{name.lower()}_swing.toml"
    links = ("\n".join(f"{key} = {values[i]}" for key, values in LINKS.items()) for i in range(NAMES[name]))
    path.write_text("".join(f"[[links]]\n{link}\n" for link in links), encoding="utf-8")
    return path


def errors(model: Any, log: Log, seconds: Sequence[float]) -> list[Array]:
    """Root mean squares of link angles (nlink) so many `seconds` after starts all along a log, in mrad."""
    period = float(log.times[1] - log.times[0])
    speeds = signal.savgol_filter(log.angles, **SAVGOL, deriv=1, delta=period, axis=0)
    margin, every = round(EDGE / period), round(EVERY / period)
    rows = np.arange(margin, len(log.times) - margin - round(seconds[-1] / period), every)
    found = []
    for ahead in seconds:
        ended, _ = simulated(model, log.angles[rows], speeds[rows], log, log.times[rows], ahead)
        missed = np.cumsum(ended - log.angles[rows + round(ahead / period)], axis=1)
        found.append(1e3 * np.sqrt((missed**2).mean(axis=0)))
    return found


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; model files are written to a `place`."""
    lines = []
    for name in NAMES:
        learned, asked = (read_log(folder, name, which) for which in ("id", "vad"))
        frame = learned.frame.filter(regex="time|angle")
        result = metaid.estimate(frame, nominal_file(place, name))
        path = place / f"{name.lower()}_swing.xml"
        result.model.write(path)
        own = mujoco.MjModel.from_xml_path(str(path))
        models = {"metaid, .xml": own, "the builders', fitted to simulations": fitted(folder, name)}
        found = {each: errors(model, asked, AHEAD) for each, model in models.items()}
        rows = [
            {"model": each, "s": ahead} | {f"link {link}": f"{error:.2g}" for link, error in enumerate(of_links, 1)}
            for each, missed in found.items()
            for ahead, of_links in zip(AHEAD, missed, strict=True)
        ]
        said = result.summary["held_out"]["torque"]["relative"]
        machine = f"{name.lower()} pendulum, swinging freely"
        yield Table(f"{machine}: {result.verdict.word}, said {said:.2%}; mrad of link angles after so many s", rows)
        ours, theirs = (float(np.linalg.norm(missed[0])) for missed in found.values())
        lines.append(Line(f"{machine}: mrad after {AHEAD[0]} s", ours, MOST))
        lines.append(Line(f"{machine}: beside the builders'", ours / theirs, MOST_BESIDE))
    yield from lines
