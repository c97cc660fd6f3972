"""DFKI's torque-limited simple pendulum: from one swing-up to another, angles after 0.3 s of simulation.

Both follow a trajectory that was computed beforehand, with a motor behind a gear of 6. The lab's models are what it
identified and what its controllers take. Instruments are the trajectories. Of other logs a hand pushes the pendulum in
two; what metaid names there is left out. In one the motor is at its limit and a hand moves it: nothing is to be found.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import metaid
from benchmarks.real.double_pendulum import AHEAD, CUTOFFS, by_mujoco, errors
from benchmarks.real.judging import Log
from benchmarks.real.least_squares import instrumental, recipe, tuned
from benchmarks.real.lines import Line, Table
from benchmarks.real.printed import printed_and_measured, printed_line
from metaid.models import Array
from metaid.plant import load_chain
from metaid.recorded import LinearModel, chain_model

REPOSITORY = "torque_limited_simple_pendulum"  # of dfki-ric-underactuated-lab, BSD-3
RUNS = {"differential dynamic programming": "ddp", "direct collocation": "direct_collocation"}
PUSHED = {"energy shaping": "energy_shaping", "iLQR": "ilqr"}
AT_LIMIT = "results/control_method_pd/1nm_torque_limited_swingup_failure/data_measured.csv"
IDENTIFIED = "results/control_method_pd/system_identification/system_identification.txt"
BELIEVED = "data/parameters/sp_parameters_trajectory.yaml"
NOMINAL = "[[links]]\nlength = 0.5\nmass = 0.5\ncom = 0.45\n"  # a weight at the end of a rod, a fifth too light
HEAVY = 100.0  # kg: a body of this mass has any moments
CUTOFF = 10.0  # Hz, of instrumental variables
MOST_BESIDE, MOST = 1.0, 80.0  # mrad


def read_log(path: Path, name: str) -> Log:
    """A log of the lab; its angle is 0 where the pendulum hangs."""
    frame = pd.read_csv(path)
    frame = frame[np.r_[True, np.diff(frame["time"]) > 0.0]]
    angle, speed, torque = (frame[[key]].to_numpy(dtype=float) for key in ("position", "velocity", "torque"))
    return Log(name, frame["time"].to_numpy(dtype=float), angle + np.pi, torque, speed)


def bar(place: Path, name: str, values: dict[str, float]) -> Path:
    """An MJCF of a pendulum with these `gravity` and `inertia` lumps, `damping` and `coulomb` friction."""
    centre = values["gravity"] / HEAVY
    inertia = values["inertia"] - HEAVY * centre**2
    path = place / f"{name}.xml"
    path.write_text(
        f'''<mujoco><option integrator="RK4" timestep="0.001"/><worldbody><body>
  <joint axis="0 1 0" damping="{max(values["damping"], 0.0)}" frictionloss="{max(values["coulomb"], 0.0)}"/>
  <inertial pos="0 0 {centre}" mass="{HEAVY}" diaginertia="{inertia} {inertia} {inertia}"/>
</body></worldbody></mujoco>''',
        encoding="utf-8",
    )
    return path


def lab_values(folder: Path) -> dict[str, dict[str, float]]:
    """What the lab says of its pendulum."""
    text = (folder / IDENTIFIED).read_text(encoding="utf-8")
    found = {name: float(number) for name, number in re.findall(r"^(\S+)\s*=\s*([+-][\d.e+-]+)$", text, re.MULTILINE)}
    said = dict(re.findall(r"^(\w+): ([\d.]+)", (folder / BELIEVED).read_text(encoding="utf-8"), re.MULTILINE))
    mass, length = float(said["mass"]), float(said["length"])
    return {
        "the lab's, identified": {
            "gravity": found["m*cx"],
            "inertia": found["J"],
            "damping": found["Fv"],
            "coulomb": 0.5 * np.pi * found["Fc"],  # of an arc tangent
        },
        "the lab's, as its controllers have it": {
            "gravity": mass * length,
            "inertia": mass * length**2,
            "damping": float(said["damping"]),
            "coulomb": 0.0,
        },
    }


def least_squares(model: LinearModel, learned: Log, asked: Log) -> Iterator[tuple[str, Array]]:
    """Name and unknowns of the rivals."""
    for name, values in tuned(model, [learned], CUTOFFS):
        yield f"least squares, {name}", values
    yield "figaroh's recipe", recipe(model, [learned], "")
    yield f"instrumental variables, {CUTOFF:g} Hz", instrumental(model, [learned], [asked], CUTOFF)


def simulated(files: dict[str, Path], logs: list[Log]) -> dict[str, float]:
    """The error of angles after AHEAD s in some `logs`, in mrad, by each of the `files`."""
    return {name: float(1e3 * np.sqrt(np.mean(errors(logs, by_mujoco(path))[0] ** 2))) for name, path in files.items()}


def pushed_by_hand(folder: Path, place: Path, nominal: Path, others: list[Log]) -> Iterator[Table | Line]:
    """What logs say in which a hand pushes, as they are and without what is named, simulated beside `others`."""
    rows, files = [], dict[str, Path]()
    for name, run in PUSHED.items():
        log = read_log(folder / f"results/control_method_{run}/data_measured.csv", run).write(place)
        whole = metaid.estimate(log, nominal)
        named = re.findall(r"=([\d.]+),([\d.]+)", " ".join(fact.option for fact in whole.facts))
        mended = metaid.estimate(log, nominal, leave_out={log.name: [(float(one), float(two)) for one, two in named]})
        files[name] = place / f"pushed_{run}.xml"
        mended.model.write(files[name])
        words = {"as it is": whole.verdict.word, "named, s": ", ".join(map("-".join, named))}
        rows.append({"log": name} | words | {"without": mended.verdict.word})
    found = simulated(files, others)
    unit = f"mrad after {AHEAD} s"
    yield Table("simple pendulum, pushed by a hand", [row | {unit: f"{found[row['log']]:.0f}"} for row in rows])
    yield Line("simple pendulum, pushed by a hand: mrad in swing-ups that were not", max(found.values()), MOST)
    limit = metaid.estimate(read_log(folder / AT_LIMIT, "limit").write(place), nominal)
    yield Line("simple pendulum, motor at its limit: is found", float(limit.verdict.is_found), 0.0)


def measure(folder: Path, place: Path) -> Iterator[Table | Line]:
    """Tables and lines; CSV and model files are written to a `place`."""
    nominal = place / "nominal_simple.toml"
    nominal.write_text(NOMINAL, encoding="utf-8")
    plant = load_chain(nominal)
    model = chain_model(plant.chain, plant.gravity).with_still(np.full(1, 0.02))
    lab = {name: bar(place, name, values) for name, values in lab_values(folder).items()}
    runs = {
        name: [
            read_log(folder / f"results/control_method_{run}/data_{kind}.csv", run) for kind in ("measured", "desired")
        ]
        for name, run in RUNS.items()
    }
    rows, printed, every = [], [], []
    for name, (learned, asked) in runs.items():
        left_out = [log for other, (log, _) in runs.items() if other != name]
        result = metaid.estimate(learned.write(place), nominal)
        own = place / f"simple_{learned.name}.xml"
        result.model.write(own)
        printed.append({"learned": name} | printed_and_measured(result, own, [learned]))
        files = {"metaid, .xml": own} | lab
        for number, (rival, values) in enumerate(least_squares(model, learned, asked)):
            keys = ("gravity", "inertia", "damping", "coulomb")
            numbers = {key: float(values[model.names.index(f"{key}_1")]) for key in keys}
            if numbers["inertia"] > numbers["gravity"] ** 2 / HEAVY:
                files[rival] = bar(place, f"rival_{number}", numbers)
        found = simulated(files, left_out)
        best = min((each for each in found if each.startswith("least squares")), key=found.__getitem__)
        kept = {each: number for each, number in found.items() if each == best or not each.startswith("least squares")}
        every.append(kept | {"best": found[best], "word": result.verdict.word})
        rows += [
            {"learned": name, "model": each, f"mrad after {AHEAD} s": f"{number:.0f}"} for each, number in kept.items()
        ]
    yield Table(f"simple pendulum, one swing-up to the other: {', '.join(str(each['word']) for each in every)}", rows)
    yield Table("simple pendulum, errors that are printed", printed)
    yield printed_line("simple pendulum", printed)
    for name, each in zip(runs, every, strict=True):
        ours = float(each["metaid, .xml"])
        yield Line(f"simple pendulum from {name}: mrad after {AHEAD} s", ours, MOST)
        labs = min(float(each[one]) for one in lab)
        yield Line(f"simple pendulum from {name}: beside the better of the lab's", ours / labs, MOST_BESIDE)
    yield from pushed_by_hand(folder, place, nominal, [log for log, _ in runs.values()])
