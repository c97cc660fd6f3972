"""How well lumps are found on plants with faults: the error of each against each fault's size, beside least squares.

    python -m benchmarks.robustness             # 2, 3 and 5 links, five chains each; under ten minutes on two cores
    python -m benchmarks.robustness --quick     # two links, two chains, two sizes
    python -m benchmarks.robustness -o docs/images    # writes robustness.png and robustness-lumps.png as well

Chains and their wrong nominal models are those of benchmarks/chains.py. metaid runs studies with measure = "smoothed"
and sees what the sensors read after pushes. Least squares knows the torques as well: it gets what the same sensors
read along exciting trajectories (benchmarks/recording.py) under the same faults, torques as the drives' limits let
them through, derivatives by Savitzky-Golay with the best span that was found; its feedback always has speeds to see,
its regression takes them from the angles. One fault at a time; those of angles come without a speed sensor for metaid.
"led": the study is told by how much torques come late (`lead`); least squares is not.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.by_torque import least_squares
from benchmarks.chains import random_chain
from benchmarks.common import table
from benchmarks.recording import PERIODS, SWING, TIGHTNESS, filtered
from metaid.chain import Array
from metaid.control import Model, smooth_sinusoids, track
from metaid.episode import natural_time
from metaid.faults import draw
from metaid.faulty import FaultyPlant
from metaid.plant import MujocoPlant, PlantSettings, chain_of
from metaid.problem import Problem
from metaid.spec import StudySettings, StudySpec
from metaid.tables import identified_factors

Row = dict[str, Any]

LINKS, SEEDS = (2, 3, 5), 5
TRIALS = {2: 250, 3: 500, 5: 1000}
RUNS = 3  # trajectories that least squares gets
WANTED = 0.01  # worst error of a lump
TIMESTEP = 0.002  # s, of the physics


@dataclass(frozen=True)
class Fault:
    """A fault by the `key` of the plant file, its `unit` in tables, the `sizes` tried, in that unit, and how many of
    the unit the key's own is."""

    key: str
    unit: str
    sizes: tuple[float, ...]
    scale: float = 1.0
    speed_sensor: bool = True
    is_led: bool = False

    def settings(self, size: float) -> dict[str, Any]:
        """The `[faults]` of a plant that has this one in that `size`."""
        value = size / self.scale
        whole = round(value) if self.key in ("delay", "control_every") else value
        return {self.key: whole, "speed_sensor": self.speed_sensor}

    def lead(self, size: float) -> float:
        """By how much torques come late, in s, where the law is told of it: a held torque, by half the time it is."""
        return 1e-3 * (size if self.key == "delay" else 0.5 * (size - 1e3 * TIMESTEP)) if self.is_led else 0.0


FAULTS = {
    "angle noise": Fault("angle_noise", "mrad", (0.3, 1.0, 3.0, 10.0), 1e3, speed_sensor=False),
    "encoder step": Fault("encoder_step", "mrad", (1.0, 3.0, 10.0, 30.0), 1e3, speed_sensor=False),
    "speed noise": Fault("speed_noise", "rad/s", (0.03, 0.1, 0.3, 1.0)),
    "control period": Fault("control_every", "ms", (4.0, 8.0, 16.0), 1e3 * TIMESTEP),
    "delay": Fault("delay", "ms", (2.0, 4.0, 8.0), 1e3 * TIMESTEP),
    "control period, led": Fault("control_every", "ms", (4.0, 8.0, 16.0), 1e3 * TIMESTEP, is_led=True),
    "delay, led": Fault("delay", "ms", (2.0, 4.0, 8.0), 1e3 * TIMESTEP, is_led=True),
    "torque noise": Fault("torque_noise", "N m", (0.01, 0.03, 0.1, 0.3)),
    "torque limit": Fault("torque_limit", "N m", (16.0, 8.0, 4.0)),
    "push noise": Fault("push_noise", "%", (1.0, 3.0, 10.0), 1e2),
    "tilt": Fault("tilt", "mrad", (1.0, 3.0, 10.0, 30.0), 1e3),
}
NO_FAULT = "none"


@dataclass(frozen=True)
class Result:
    """One chain with one fault: relative errors of every lump (nlump), in the order of `names`, by metaid and by least
    squares; infinite where nothing was found at all."""

    links: int
    fault: str
    size: float
    seed: int
    names: tuple[str, ...]
    errors: tuple[float, ...]
    least_squares: tuple[float, ...]


def identify(job: tuple[int, str, float, int]) -> Result:
    """Both methods on one chain."""
    links, fault, size, seed = job
    true, nominal = random_chain(links, seed)
    faults, lead = ({}, 0.0) if fault == NO_FAULT else (FAULTS[fault].settings(size), FAULTS[fault].lead(size))
    plant = PlantSettings.model_validate({"links": true, "timestep": TIMESTEP, "faults": faults})
    truth = chain_of(true).lumps.vector
    with threadpool_limits(1):
        problem = _problem(plant, nominal, seed, lead)
        found = _search(problem) * problem.lumps.vector
        known = _regress(plant, nominal, seed)

    def errors(lumps: Array) -> tuple[float, ...]:
        return tuple(np.abs(lumps / truth - 1.0).tolist())

    return Result(links, fault, size, seed, tuple(problem.names), errors(found), errors(known))


def _problem(plant: PlantSettings, nominal: Any, seed: int, lead: float) -> Problem:
    settings = {"plant": "chain", "nominal": "nominal", "trials": TRIALS[len(nominal)], "seed": seed}
    episode = {"measure": "smoothed", "physics": "analytic", "lead": lead}
    study = StudySettings.model_validate({**settings, "episode": episode})
    return Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))


def _search(problem: Problem) -> Array:
    """Factors (nlump) that a study of this `problem` would show as identified; infinite if all its trials fell."""
    searcher, objective = problem.make_searcher(), problem.make_objective()
    factors: list[Array] = []
    values: list[float] = []
    trials = 0
    while trials < problem.spec.study.trials and not searcher.finished():
        batch = searcher.ask()
        outcomes = [objective.evaluate(candidate) for candidate in batch]
        searcher.tell(outcomes)
        factors += [candidate for candidate, outcome in zip(batch, outcomes, strict=True) if not outcome.fell]
        values += [outcome.value for outcome in outcomes if not outcome.fell]
        trials += len(batch)
    if not values:
        return np.full(len(problem.names), np.inf)
    return identified_factors(problem, np.array(factors), np.array(values))[0]


def _regress(settings: PlantSettings, nominal: Any, seed: int) -> Array:
    """Lumps (nlump) by least squares; infinite if the nominal model could not hold the plant on a trajectory."""
    faults = settings.faults.model_copy(update={"speed_sensor": True})
    plant = FaultyPlant(MujocoPlant("chain", settings.model_copy(update={"faults": faults})))
    believed = chain_of(nominal)
    model, scale = Model(believed.lumps, believed.inertia_lumps), natural_time(believed, plant.gravity)
    limits = faults.torque_limits(plant.njoint)
    angles, torques = [], []
    for run in range(RUNS):
        motion = smooth_sinusoids(plant.njoint, scale, plant.timestep, 1000 * seed + run, 1, SWING, PERIODS)
        random = np.random.default_rng([seed, run])
        # Held upright at first, not pushed, and then moved: pushes that do not repeat do not touch it.
        plant.begin(draw(faults, random, 1, len(motion.angles), plant.njoint))
        seen = track(plant, model, model, motion, TIGHTNESS / scale)
        if len(seen.angles) < len(motion.angles):
            return np.full(len(believed.lumps.vector), np.inf)
        angles.append(seen.angles)
        torques.append(np.clip(seen.torques, -limits, limits))
    shortest = min(map(len, angles))
    cut = [np.array([run[:shortest] for run in runs]) for runs in (angles, torques)]
    return least_squares(filtered(cut[0], cut[1], plant.timestep, scale), nominal, plant.gravity).lumps


def jobs(links: tuple[int, ...], seeds: int, most_sizes: int | None = None) -> Iterator[tuple[int, str, float, int]]:
    """Everything that is measured; the largest chains first, so that no core waits at the end."""
    for nlink in sorted(links, reverse=True):
        for fault, sizes in [(NO_FAULT, (0.0,)), *((name, fault.sizes) for name, fault in FAULTS.items())]:
            for size in sizes[:most_sizes]:
                yield from ((nlink, fault, size, seed) for seed in range(seeds))


def worst(results: list[Result], kind: str, method: str = "errors") -> float:
    """The median over chains of the worst lump of a `kind`, "gravity", "coriolis" or "" for both."""
    return float(
        median(
            max(
                error
                for name, error in zip(result.names, getattr(result, method), strict=True)
                if name.startswith(kind)
            )
            for result in results
        )
    )


def curve(
    results: list[Result], links: int, fault: str, kind: str, method: str = "errors"
) -> list[tuple[float, float]]:
    """Sizes of a fault and the median worst error at each."""
    own = [result for result in results if (result.links, result.fault) == (links, fault)]
    sizes = sorted({result.size for result in own}, reverse=fault == "torque limit")
    return [(size, worst([result for result in own if result.size == size], kind, method)) for size in sizes]


def largest_size(points: list[tuple[float, float]], wanted: float = WANTED) -> float | None:
    """The size up to which the error is at most `wanted`, on straight lines between the logarithms; None if it is more
    at the smallest that was tried, infinite if it never is."""
    if points[0][1] > wanted:
        return None
    for (size, error), (larger, more) in itertools.pairwise(points):
        if more > wanted:
            share = np.log(wanted / error) / np.log(more / error)
            return float(size * (larger / size) ** share)
    return np.inf


def error_rows(results: list[Result]) -> list[Row]:
    """Median worst errors, in percent, for every fault and size."""
    links = sorted({result.links for result in results})
    rows: list[Row] = []
    for fault, size in dict.fromkeys((result.fault, result.size) for result in results):
        row: Row = {"fault": fault if fault == NO_FAULT else f"{fault}, {FAULTS[fault].unit}", "size": size or None}
        for nlink in links:
            own = [r for r in results if (r.links, r.fault, r.size) == (nlink, fault, size)]
            for kind in ("gravity", "coriolis"):
                row[f"N = {nlink}, {kind}, %"] = 100.0 * worst(own, kind)
            row[f"N = {nlink}, least squares, %"] = 100.0 * worst(own, "", "least_squares")
        rows.append(row)
    return rows


def first_rows(results: list[Result]) -> list[Row]:
    """For each fault, the size up to which 1 % is kept, and the lump that is lost first."""
    rows = []
    for fault in FAULTS:
        for nlink in sorted({result.links for result in results}):
            own = [result for result in results if (result.links, result.fault) == (nlink, fault)]
            row: Row = {"fault": f"{fault}, {FAULTS[fault].unit}", "links": nlink}
            for kind in ("gravity", "coriolis"):
                row[f"{kind} within 1 % up to"] = _shown(curve(results, nlink, fault, kind), fault)
            row["least squares, up to"] = _shown(curve(results, nlink, fault, "", "least_squares"), fault)
            row["first lump beyond"] = _first(own, fault)
            rows.append(row)
    return rows


def _shown(points: list[tuple[float, float]], fault: str) -> str:
    size, least = largest_size(points), fault == "torque limit"
    if size is None:
        return f"{'over' if least else 'under'} {points[0][0]:g}"
    return f"{points[-1][0]:g} and {'less' if least else 'more'}" if np.isinf(size) else f"{size:.2g}"


def _first(own: list[Result], fault: str) -> str:
    """The lump whose median error passes 1 % at the smallest size; of several, the one whose is largest."""
    for size in sorted({result.size for result in own}, reverse=fault == "torque limit"):
        middle = np.median([result.errors for result in own if result.size == size], axis=0)
        if middle.max() > WANTED:
            return f"{own[0].names[int(middle.argmax())]}, {middle.max():.1%} at {size:g}"
    return "none"


def draw_pictures(results: list[Result], folder: Path) -> None:
    """`robustness.png`, all faults and numbers of links; `robustness-lumps.png`, each lump of three links."""
    from matplotlib.figure import Figure

    from metaid.figures.style import COLOURS, INK, PAGE, save, style

    def panels(height: float) -> tuple[Figure, list[Any]]:
        figure = Figure(figsize=(PAGE, height), layout="constrained")
        axes = figure.subplots(4, 3, sharey=True).ravel().tolist()
        axes.pop().set_axis_off()
        for (name, fault), each in zip(FAULTS.items(), axes, strict=True):
            each.set(xscale="log", yscale="log", ylim=(1e-4, 1.0), xlabel=f"{name}, {fault.unit}")
            each.axhline(WANTED, color=INK, linewidth=0.6, linestyle=":")
            each.grid(True)
            if name == "torque limit":
                each.invert_xaxis()
        for each in axes[::3]:
            each.set_ylabel("error")
        return figure, axes

    links = sorted({result.links for result in results})
    with style():
        figure, axes = panels(7.0)
        for fault, each in zip(FAULTS, axes, strict=True):
            for colour, nlink in zip(COLOURS, links, strict=False):
                for kind, line in (("gravity", "-"), ("coriolis", "--")):
                    each.plot(*zip(*curve(results, nlink, fault, kind), strict=True), line, color=colour)
                known = curve(results, nlink, fault, "", "least_squares")
                each.plot(*zip(*known, strict=True), ":", color=colour, marker=".", markersize=3)
        for colour, nlink in zip(COLOURS, links, strict=False):
            axes[0].plot([], [], color=colour, label=f"{nlink} links")
        for line, label in (("-", "gravity"), ("--", "Coriolis"), (":", "least squares")):
            axes[0].plot([], [], line, color=INK, label=label)
        axes[0].legend(ncols=2, loc="upper left", fontsize=5.5, handlelength=1.5, columnspacing=0.8)
        save(figure, folder / "robustness.png")
        nlink = 3 if 3 in links else links[-1]
        figure, axes = panels(6.0)
        for fault, each in zip(FAULTS, axes, strict=True):
            own = [result for result in results if (result.links, result.fault) == (nlink, fault)]
            sizes = sorted({result.size for result in own})
            middle = np.array([np.median([r.errors for r in own if r.size == size], axis=0) for size in sizes])
            for colour, name, errors in zip(COLOURS, own[0].names, middle.T, strict=False):
                each.plot(sizes, errors, color=colour, label=name)
        axes[0].legend(ncols=2, loc="upper left", fontsize=5, handlelength=1.5, columnspacing=0.8)
        save(figure, folder / "robustness-lumps.png")


def main() -> None:
    """Measures on all cores, prints two tables or JSON, and draws if it is told where."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="two links, two chains, two sizes: to see that it works")
    options.add_argument("--json", action="store_true", help="every single result, as JSON")
    options.add_argument("--workers", type=int, default=2, help="processes")
    options.add_argument("-o", dest="output", type=Path, help="a folder for the pictures")
    given = options.parse_args()
    wanted = list(jobs((2,), 2, 2) if given.quick else jobs(LINKS, SEEDS))
    begun, results = time.perf_counter(), []
    with ProcessPoolExecutor(given.workers) as pool:
        for result in pool.map(identify, wanted, chunksize=5):
            results.append(result)
            print(f"\r{len(results)}/{len(wanted)}", end="", file=sys.stderr, flush=True)
    print(f"\r{len(results)} studies in {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    if given.output is not None:
        draw_pictures(results, given.output)
    if given.json:
        print(json.dumps([asdict(result) for result in results]))
        return
    note = (
        "Medians over the chains; gravity and coriolis: metaid's worst lump of the kind; least squares: its worst lump."
    )
    print(f"{note}\n\n{table(error_rows(results))}\n\n{table(first_rows(results))}")


if __name__ == "__main__":
    main()
