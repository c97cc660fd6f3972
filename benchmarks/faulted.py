"""A chain with a fault, and what metaid and least squares find of it: what `robustness.py` is made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.by_torque import least_squares
from benchmarks.chains import random_chain
from benchmarks.recording import PERIODS, SWING, TIGHTNESS, filtered
from metaid.episode import natural_time
from metaid.models import Array, ChainModel
from metaid.plant import FaultyPlant, MujocoPlant, PlantSettings, chain_of, draw
from metaid.results import identified_factors, smooth_sinusoids, track
from metaid.study import Problem, StudySettings, StudySpec

LINKS, SEEDS = (2, 3, 5), 5
TRIALS = {2: 250, 3: 500, 5: 1000}
RUNS = 3  # trajectories that least squares gets
SPANS = (0.2, 0.4, 0.8, 1.5)  # of its derivatives' filter, in natural times, of which it gets the best in hindsight
SWINGS = (1.0, 0.5, 0.25, 0.1)  # of its usual trajectories, of which it gets the widest on which control is kept
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
        found = _search(problem) * problem.chain.lumps.vector
        known = _regress(plant, nominal, truth, seed)

    def errors(lumps: Array) -> tuple[float, ...]:
        return tuple(np.abs(lumps / truth - 1.0).tolist())

    return Result(links, fault, size, seed, tuple(problem.names), errors(found), errors(known))


def _problem(plant: PlantSettings, nominal: Any, seed: int, lead: float) -> Problem:
    settings = {"plant": "chain", "nominal": "nominal", "trials": TRIALS[len(nominal)], "seed": seed}
    episode = {"measure": "smoothed", "lead": lead}
    study = StudySettings.model_validate({**settings, "sampler": "cmaes", "episode": episode})
    return Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))


def _search(problem: Problem) -> Array:
    """Factors (nlump) that a study of this `problem` would show as identified; infinite if all its trials fell."""
    searcher, objective = problem.make_searcher(), problem.make_objective()
    factors: list[Array] = []
    values: list[float] = []
    trials = 0
    while trials < problem.spec.study.trials and not searcher.finished():
        batch = searcher.ask()
        outcomes = [objective.evaluate(candidate, trials + i) for i, candidate in enumerate(batch)]
        searcher.tell(outcomes)
        factors += [candidate for candidate, outcome in zip(batch, outcomes, strict=True) if not outcome.fell]
        values += [outcome.value for outcome in outcomes if not outcome.fell]
        trials += len(batch)
    if not values:
        return np.full(len(problem.names), np.inf)
    return identified_factors(problem, np.array(factors), np.array(values))


def _regress(settings: PlantSettings, nominal: Any, truth: Array, seed: int) -> Array:
    """Lumps (nlump) by least squares, with the filter span that is best in hindsight; infinite if the nominal model
    could hold the plant on no trajectory, however short its swing.
    """
    believed, timestep = chain_of(nominal), settings.control_period
    scale = natural_time(believed, settings.gravity)
    for share in SWINGS:
        seen = _record(settings, nominal, share * SWING, seed)
        if seen is not None:
            recordings = [filtered(*seen, timestep, scale, span) for span in SPANS]
            found = [least_squares(recording, nominal, settings.gravity)[0] for recording in recordings]
            return min(found, key=lambda lumps: float(np.abs(lumps / truth - 1.0).max()))
    return np.full(len(truth), np.inf)


def _record(settings: PlantSettings, nominal: Any, swing: float, seed: int) -> tuple[Array, Array] | None:
    """Angle readings and the torques that the drives' limits let through, (nrun x nsteps x njoint), along exciting
    trajectories; None if control was lost.
    """
    faults = settings.faults.model_copy(update={"speed_sensor": True})
    plant = FaultyPlant(MujocoPlant("chain", settings.model_copy(update={"faults": faults})))
    believed, limits = chain_of(nominal), faults.torque_limits(plant.njoint)
    model, scale = ChainModel(believed.lumps, plant.gravity), natural_time(believed, plant.gravity)
    angles, torques = [], []
    for run in range(RUNS):
        motion = smooth_sinusoids(plant.njoint, scale, plant.timestep, 1000 * seed + run, 1, swing, PERIODS)
        random = np.random.default_rng([seed, run])
        # Held upright at first, not pushed, and then moved: pushes that do not repeat do not touch it.
        plant.begin(draw(faults, random, 1, len(motion.angles), plant.njoint))
        seen = track(plant, model, model, motion, TIGHTNESS / scale)
        if len(seen.angles) < len(motion.angles):
            return None
        angles.append(seen.angles)
        torques.append(np.clip(seen.torques, -limits, limits))
    shortest = min(map(len, angles))
    return np.array([run[:shortest] for run in angles]), np.array([run[:shortest] for run in torques])


def jobs(links: tuple[int, ...], seeds: int, most_sizes: int | None = None) -> Iterator[tuple[int, str, float, int]]:
    """Everything that is measured; the largest chains first, so that no core waits at the end."""
    for nlink in sorted(links, reverse=True):
        for fault, sizes in [(NO_FAULT, (0.0,)), *((name, fault.sizes) for name, fault in FAULTS.items())]:
            for size in sizes[:most_sizes]:
                yield from ((nlink, fault, size, seed) for seed in range(seeds))
