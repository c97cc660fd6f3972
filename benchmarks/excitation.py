"""What `metaid excite` finds and promises, and whether logs of robots that are 30 % off keep it.

    python -m benchmarks.excitation [ROBOT ...]

Of each robot: the seconds of one core that it takes, the determinant criterion less that of the best of 500 random
series with the same limits, whether any limit is passed or anything touched at 1 kHz, and, of logs of ten wrong robots
along the motion with the noise that was said, the root mean square of the errors as a share of the promised deviations
(median and largest of all parameters), the deviations that `metaid.estimate` reports, and how many of its 95 %
intervals hold the truth.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import table
from metaid.excitation import Excitation, LogNoise, best_of_random, excite, recorded
from metaid.models import Array
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import Choices, arm_model, chain_model, estimate_records

ROBOTS = ("double-pendulum", "two-link", "puma560", "pa10")
WRONG, TRUTHS, SEED = 0.3, 10, 4242
FRICTION = ("viscous", "coulomb")


def true_values(found: Excitation, robot: str | Path, seed: int) -> Array:
    """The unknowns (nparam) of a robot whose bodies and friction differ from the nominal ones by up to 30 %."""
    plant, random = load_plant(robot), np.random.default_rng(seed)
    model = found.problem.model

    def wrong(values: Array) -> Array:
        return np.asarray(values * random.uniform(1.0 - WRONG, 1.0 + WRONG, values.shape), dtype=np.float64)

    if isinstance(plant, ArmPlant):
        tree = plant.tree
        tree = replace(tree, mass=wrong(tree.mass), rotor=wrong(tree.rotor))
        tree = replace(tree, inertia=tree.inertia * random.uniform(1.0 - WRONG, 1.0 + WRONG, (tree.njoint, 1, 1)))
        bodies = arm_model(tree).with_friction(FRICTION)
        assert bodies.names == model.names
        values = bodies.nominal
    else:
        chain = plant.chain
        chain = replace(chain, mass=wrong(chain.mass), inertia=wrong(chain.inertia))
        values = chain_model(chain, plant.gravity).nominal
    return np.concatenate([values, wrong(found.problem.nominal[model.nbody :])])


def row(robot: str) -> dict[str, Any]:
    """What is said of one robot."""
    begun = time.process_time()
    found = excite(robot)
    took = time.process_time() - begun
    model, noise, errors, deviations = found.problem.model, LogNoise(), [], []
    with threadpool_limits(1):
        _, random = best_of_random(found.problem, found.criterion, SEED)
        for seed in range(TRUTHS):
            true = true_values(found, robot, seed)

            def torques(angles: Array, speeds: Array, accelerations: Array, values: Array = true) -> Array:
                return np.asarray(model.regressor(angles, speeds, accelerations) @ values, dtype=np.float64)

            logs = recorded(torques, found.series, found.seconds, noise, [100 + seed])
            told = estimate_records(logs, model, Choices(friction=FRICTION, zeros=False, delay=0.0))
            errors.append(told.values - true)
            deviations.append(told.deviations)
    share = np.sqrt(np.mean(np.square(errors), axis=0)) / found.forecast.deviations
    reported = np.median(deviations, axis=0) / found.forecast.deviations
    covered = np.mean(np.abs(errors) < 1.96 * np.array(deviations))
    return {
        "robot": Path(robot).stem,
        "CPU s": f"{took:.0f}",
        "above random": f"{found.criterion.value(found.series) - found.criterion.value(random):.1f}",
        "limits and contacts": "kept" if found.problem.is_allowed(found.series) else "PASSED",
        "errors": f"{np.median(share):.2f}, {share.max():.2f}",
        "reported": f"{np.median(reported):.2f}, {reported.max():.2f}",
        "intervals hold": f"{covered:.0%}",
    }


def main() -> None:
    """A row for each robot."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.excitation", description=__doc__.partition("\n")[0])
    parser.add_argument("robots", nargs="*", default=ROBOTS, metavar="ROBOT", help="names of plants, MJCF or URDF")
    print(table([row(robot) for robot in parser.parse_args().robots]))


if __name__ == "__main__":
    main()
