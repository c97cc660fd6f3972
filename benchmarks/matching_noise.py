"""What matching gives on noisy plants: errors after each trial, what 95 % intervals cover, and what the misfit says.

    python -m benchmarks.matching_noise                                  # 1 mrad on the angles, no speed sensor
    python -m benchmarks.matching_noise --pushes-differ 0.02
    python -m benchmarks.matching_noise --hidden friction --links 3 --seeds 0 1 2 3 4 5 6 7 8 9

Chains are those of benchmarks/chains.py, the plant is MuJoCo, and no length is assumed. 2N pushes a trial, of a
study's horizon; the first trial sends the nominal law with its gravity lumps raised by `--first`, every other one the
estimate from all trials before. `--hidden` gives the plant what the model has not: viscous friction, springs, a torque
limit that bites; or lengths that are 2 % wrong are taken as exact.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.chains import random_chain
from metaid.compiled import FaultyLoop, fastest_step
from metaid.episode import REACH, RICH_FALL_LIMIT, Episode, FallRule, natural_time, rich_pushes
from metaid.estimation import Estimate, Readings, ReadTrial, Unknowns, commanded_torques, filtered_speeds, fit
from metaid.models import Array, Lumps, kind_of
from metaid.plant import FaultSettings, LinkSettings, MujocoPlant, PlantSettings, Start, chain_of, slope_weights
from metaid.study import HORIZON

LINKS, KINDS = (2, 3, 5), ("gravity", "coriolis", "inertia")
FRICTION, SPRING = 0.02, 0.2  # N m s and N m/rad in every joint
BITES = 0.5  # of the largest torque that the first trial asks of any joint
WRONG_LENGTHS = 0.02
EXPLAINED = 3.0


@dataclass(frozen=True)
class Matched:
    """One chain after one trial more: the worst relative error by kind of lump, what share of each kind its 95 %
    interval covers, the misfit, and seconds of the fit.
    """

    links: int
    seed: int
    trials: int
    errors: dict[str, float]
    covered: dict[str, float]
    misfit: float
    fit_seconds: float


@dataclass(frozen=True)
class Noisy:
    """What a plant has: noise of its angle readings in rad, what its pushes differ by, and what the model has not."""

    noise: float = 1e-3
    pushes_differ: float = 0.0
    hidden: str | None = None

    def plant(self, links: tuple[LinkSettings, ...], torque_limit: float | None = None) -> MujocoPlant:
        """The plant of these `links`; `torque_limit` in N m."""
        changed = {"friction": {"damping": FRICTION}, "spring": {"stiffness": SPRING}}.get(self.hidden or "", {})
        faults: dict[str, Any] = {"angle_noise": self.noise, "speed_sensor": False, "push_noise": self.pushes_differ}
        settings = PlantSettings(
            links=tuple(link.model_copy(update=changed) for link in links),
            faults=FaultSettings(**faults, torque_limit=torque_limit),
        )
        return MujocoPlant("chain", settings)


def match(links: int, seed: int, noisy: Noisy, first: float, most: int, restarts: int) -> list[Matched]:
    """Identifies one chain, in `most` trials."""
    true, believed = random_chain(links, seed)
    nominal = chain_of(believed)
    plant = noisy.plant(true)
    steps = round(HORIZON * natural_time(nominal, plant.gravity) / plant.timestep)
    pushes = rich_pushes(plant, 2 * links, REACH / (steps * plant.timestep), seed)
    episode = Episode(pushes, steps, FallRule(RICH_FALL_LIMIT), keep_angles=True, seed=seed)
    wrong = 1.0 + WRONG_LENGTHS * np.random.default_rng(seed).choice([-1.0, 1.0], links)
    unknowns = Unknowns(nominal.lumps, lengths=nominal.length * wrong if noisy.hidden == "lengths" else None)
    truth = unknowns.log_factors(plant.chain.lumps)
    law = nominal.lumps.scaled(np.append(np.full(links, first), np.ones(len(nominal.lumps.vector) - links)))
    if noisy.hidden == "limit":
        largest = float(np.abs(read_trial(plant, episode, law, noisy).torques).max())
        plant = noisy.plant(true, BITES * largest)
    trials: list[ReadTrial] = []
    rows: list[Matched] = []
    estimate: Estimate | None = None
    for _ in range(most):
        trials.append(read_trial(plant, episode, law, noisy))
        start = estimate.log_factors if estimate is not None and estimate.misfit < EXPLAINED else None
        began = time.perf_counter()
        estimate = fit(Readings(trials, unknowns, plant.gravity), start, restarts)
        seconds = time.perf_counter() - began
        rows.append(_judge(links, seed, len(trials), estimate, truth, seconds))
        law = estimate.lumps
    return rows


def read_trial(plant: MujocoPlant, episode: Episode, law: Lumps, noisy: Noisy) -> ReadTrial:
    """What the plant's sensors read under this `law`, and what it was sent."""
    npush, njoint = episode.pushes.shape
    starts = np.array([plant.start_speeds(start) for start in episode.starts])
    readings, steps = np.zeros((npush, episode.steps + 1, njoint)), np.zeros(npush, dtype=np.int64)
    for push, angles in enumerate(FaultyLoop(plant, episode, fastest_step(plant)).run(law).angles):
        readings[push, : len(angles)], steps[push] = angles, len(angles) - 1 - (len(angles) <= episode.steps)
    speeds = filtered_speeds(readings, starts, slope_weights(plant.timestep))
    torques = commanded_torques(law, readings, speeds, plant.gravity)
    response = np.array([plant.start_speeds(Start.upright(impulse)) for impulse in np.eye(njoint)]).T
    spread = response * (noisy.pushes_differ * episode.pushes[:, None]) if noisy.pushes_differ else None
    return ReadTrial(plant.timestep, readings, torques, steps, starts, spread, np.full(njoint, noisy.noise))


def _judge(links: int, seed: int, trials: int, estimate: Estimate, truth: Array, seconds: float) -> Matched:
    error = estimate.log_factors - truth
    inside = np.abs(error) <= 1.96 * estimate.deviations
    kinds = np.array([kind_of(name) for name in estimate.names])
    named = [kind for kind in KINDS if (kinds == kind).any()]
    errors = {kind: float(np.abs(np.expm1(error[kinds == kind])).max()) for kind in named}
    covered = {kind: float(inside[kinds == kind].mean()) for kind in named}
    return Matched(links, seed, trials, errors, covered, estimate.misfit, seconds)


def table(rows: list[Matched]) -> str:
    """The results as a Markdown table: medians of the worst lump, means of what intervals cover."""
    heading = [
        "links",
        "trials",
        "chains",
        *(f"worst {kind}" for kind in KINDS),
        *(f"{kind} covered" for kind in KINDS),
    ]
    heading += ["misfit", "ms of the fit"]
    lines = [f"| {' | '.join(heading)} |", "| --- " * len(heading) + "|"]
    for links, trials in sorted({(row.links, row.trials) for row in rows}):
        runs = [row for row in rows if (row.links, row.trials) == (links, trials)]
        named = [kind for kind in KINDS if kind in runs[0].errors]
        errors = {kind: f"{float(np.median([row.errors[kind] for row in runs])):.3%}" for kind in named}
        covered = {kind: f"{float(np.mean([row.covered[kind] for row in runs])):.1%}" for kind in named}
        cells = [str(links), str(trials), str(len(runs))]
        cells += [part.get(kind, "–") for part in (errors, covered) for kind in KINDS]
        cells.append(f"{min(row.misfit for row in runs):.2f} to {max(row.misfit for row in runs):.2f}")
        cells.append(f"{1e3 * float(np.median([row.fit_seconds for row in runs])):.0f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Runs what is asked for, with a line on stderr for every chain, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(20)), help="of the chains")
    parser.add_argument("--noise", type=float, default=1e-3, help="of an angle reading, in rad")
    parser.add_argument("--pushes-differ", type=float, default=0.0, help="noise of an impulse, as a share of it")
    parser.add_argument("--hidden", choices=["friction", "spring", "limit", "lengths"])
    parser.add_argument("--first", type=float, default=1.5, help="gravity factors of the first trial: 1 is the nominal")
    parser.add_argument("--most", type=int, default=4, help="trials")
    parser.add_argument("--restarts", type=int, default=5, help="of a fit that explains too little")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    noisy = Noisy(given.noise, given.pushes_differ, given.hidden)
    rows: list[Matched] = []
    with threadpool_limits(1):
        for links in given.links:
            for seed in given.seeds:
                rows += (runs := match(links, seed, noisy, given.first, given.most, given.restarts))
                misfits = ", ".join(f"{row.misfit:.2f}" for row in runs)
                print(f"N={links} seed {seed}: misfit {misfits}", file=sys.stderr)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else table(rows))


if __name__ == "__main__":
    main()
