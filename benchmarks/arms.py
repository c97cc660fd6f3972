"""How many trials it takes to identify an arm, how exactly, and how long: seven arms, nominals that are far off.

    python -m benchmarks.arms                          # seven arms, ten seeds each
    python -m benchmarks.arms --noise 1e-4             # rad on the angles, and no sensor of speeds
    python -m benchmarks.arms --arms puma560 panda --seeds 0 1 2 --json
    python -m benchmarks.arms --results arms.jsonl     # goes on where it was stopped
    python -m benchmarks.arms --sampler newton --trials 4000 --seeds 0        # no twin: the value of each trial alone

Shipped arms are as they are. UR5, Panda, xArm7 and Kinova are the URDFs of `example-robot-data`, which `make robots`
installs. A URDF states no rotors, and most of these no friction: they get some, by their torque limits and the seed.
Masses and inertias of the nominal arm are wrong by up to 30 %, centres of mass by up to 15 %, rotors and friction are
believed to be nothing. A trial is 2 njoint coasts and njoint pushes on springs, 0.3 s each, from poses and speeds in
the joint ranges. The first has the law of the nominal arm, each other one that of the estimate from all before. Errors
are those of gravity torque, Coriolis torque and mass matrix (`metaid.models.tree.model_error`) after the last trial, of
those that were found. A `--sampler` that minimises is told the value of each trial and nothing else. `--smooth` takes
dry friction away.
Seconds are those of trials and fits, without compilation, of all threads together: two cores need half as long.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common import NEEDS_MORE, Row, table
from metaid.compiled.arms import ArmLoop, ArmObjective
from metaid.episode import window_ends
from metaid.episode.arms import ArmEpisode, resolution_hz
from metaid.estimation.arms import (
    ArmEstimate,
    ArmReadTrial,
    ArmUnknowns,
    WatchedArmTrial,
    estimate_arm,
    read_arm_trial,
    watched_arm_trial,
)
from metaid.models import Array
from metaid.models.tree import Belief, ModelError, Prior, Tree, model_error
from metaid.plant import load_plant
from metaid.plant.arms import ArmFaults, ArmPlant, ArmSettings, draw_starts
from metaid.search import SamplerOptions, arm_sensitivity, believed_metric, make_searcher
from metaid.study.arms import ArmSearchSettings, drawn_nominal

SHIPPED = ("pa10", "crs-a465", "puma560")
OTHERS = ("scara", "spatial-three-link")  # shipped, too
URDFS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
}
JOINTS = {"panda": tuple(f"panda_joint{i}" for i in range(1, 8))}  # of the others all move
HORIZON, WINDOWS, STIFFNESS = 0.3, 6, 30.0  # s, their number, 1/s²
# Of the torque limit: a rotor's inertia per rad/s², viscous friction per rad/s, dry friction.
ROTOR, DAMPING, COULOMB = 0.004, 0.01, 0.02
WITHIN = 0.01
EXACT = 1e-8  # an error below which what is left is rounding, which differs by processor
ERRORS = {"gravity": "gravity torque", "coriolis": "Coriolis torque", "mass_matrix": "mass matrix"}
MINIMISERS = ("newton", "cmaes", "tpe", "optuna-cmaes")
FARTHEST = 10.0  # standard deviations of the belief: no base parameter beyond is tried


@dataclass(frozen=True)
class Identified:
    """One arm and seed: errors of the nominal model and after each trial, the misfits and whether they are explained,
    how many of the base parameters were inside their 95 % intervals after the last trial, pushes that fell, seconds.
    """

    arm: str
    seed: int
    joints: int
    unknowns: int
    nominal: ModelError
    errors: list[ModelError]
    misfits: list[float]
    explained: list[bool]
    inside: int
    falls: int
    seconds: float

    @property
    def trials_needed(self) -> int | None:
        """After how many trials all errors were within 1 %; None where they were not."""
        within = [number for number, error in enumerate(self.errors, 1) if error.largest <= WITHIN]
        return within[0] if within else None


@dataclass(frozen=True)
class Minimised:
    """One arm and seed under a sampler that minimises: pushes of a trial, trials and how many of them fell, after how
    many the best had all errors within 1 %, None where none had; its value, what the measure can tell from none and the
    value of the true arm's law, in Hz; errors of the nominal arm and of the best trial, seconds.
    """

    arm: str
    seed: int
    sampler: str
    unknowns: int
    pushes: int
    trials: int
    falls: int
    trials_needed: int | None
    value: float
    resolution: float
    value_of_truth: float
    nominal: ModelError
    error: ModelError
    seconds: float


def plant_of(name: str, seed: int, noise: float, is_smooth: bool = False) -> ArmPlant:
    """The plant of that name; a smooth one has no dry friction."""
    if name in (*SHIPPED, *OTHERS):
        found = load_plant(name)
        assert isinstance(found, ArmPlant), name
        plant = found
    else:
        plant = ArmPlant(name, _settings(name, seed))
    changes: dict[str, object] = {"faults": ArmFaults(angle_noise=noise, speed_sensor=not noise)}
    if is_smooth:
        changes["frictionloss"] = dict.fromkeys(plant.tree.names, 0.0)
    return ArmPlant(plant.name, plant.settings.model_copy(update=changes))


def experiment_on(plant: ArmPlant, seed: int) -> tuple[Belief, ArmEpisode]:
    """What is believed of an arm, and what is done to it."""
    n, steps = plant.njoint, round(HORIZON / plant.timestep)
    starts = draw_starts(plant, 3 * n, HORIZON, seed)
    stiffness = np.where(np.arange(3 * n) < 2 * n, 0.0, STIFFNESS)
    episode = ArmEpisode(starts, stiffness, steps, window_ends(steps, WINDOWS), seed=seed)
    return Belief(drawn_nominal(plant.tree, seed, Prior())), episode


def _settings(name: str, seed: int) -> ArmSettings:
    path = _robots() / URDFS[name]
    plain = ArmSettings(urdf=str(path), joints=JOINTS.get(name))
    tree, random = ArmPlant(name, plain).tree, np.random.default_rng(1000 + seed)
    factors = random.uniform(0.5, 1.5, (3, tree.njoint)) * tree.torque_limit

    def said(share: float, row: int, present: Array) -> dict[str, float]:
        values = np.where(present > 0.0, present, share * factors[row])
        return dict(zip(tree.names, values.tolist(), strict=True))

    rotor, damping, coulomb = (
        said(share, row, present)
        for row, (share, present) in enumerate(((ROTOR, tree.rotor), (DAMPING, tree.damping), (COULOMB, tree.coulomb)))
    )
    return plain.model_copy(update={"rotor": rotor, "damping": damping, "frictionloss": coulomb})


def _robots() -> Path:
    for place in map(Path, sys.path):
        for found in place.glob("cmeel.prefix/share/example-robot-data/robots"):
            return found
    print("the URDFs are those of example-robot-data, which make robots installs", file=sys.stderr)
    sys.exit(NEEDS_MORE)


def identify(name: str, seed: int, noise: float, trials: int) -> Identified:
    """Identifies an arm from a nominal that is far off.

    Args:
        name: of the arm.
        seed: of what is wrong, of the starts and of the noise.
        noise: of the angles, in rad.
        trials: at most; without noise one that coasts as an explained estimate says is the last.
    """
    plant = plant_of(name, seed, noise)
    true, n = plant.tree, plant.njoint
    belief, episode = experiment_on(plant, seed)
    nominal = belief.nominal
    began = time.process_time()
    searched = ArmUnknowns(belief)
    loop, law = ArmLoop(plant, nominal, episode), nominal.parameters
    estimate: ArmEstimate | None = None
    watched: list[WatchedArmTrial | ArmReadTrial] = []
    errors: list[ModelError] = []
    misfits: list[float] = []
    explained: list[bool] = []
    falls = 0
    spent = time.process_time() - began
    for number in range(trials):
        began = time.process_time()
        record = loop.run(law, number)
        falls += int(record.fell.sum())
        if record.readings is not None:
            read = plant.timestep, record.readings, np.full(n, noise)
            watched.append(read_arm_trial(searched.frames, law, episode, *read))
        else:
            watched.append(watched_arm_trial(law, episode, plant.timestep, record.windows))
        before, estimate = estimate, estimate_arm(watched, searched, estimate)
        spent += time.process_time() - began
        if estimate is None:
            break
        law = estimate.parameters
        errors.append(model_error(true, law))
        misfits.append(estimate.misfit)
        explained.append(estimate.is_explained)
        if not noise and before is not None and before.is_explained and estimate.is_explained:
            break
    return Identified(
        arm=name,
        seed=seed,
        joints=n,
        unknowns=len(searched.names),
        nominal=model_error(true, nominal.parameters),
        errors=errors,
        misfits=misfits,
        explained=explained,
        inside=0 if estimate is None else _inside(estimate, true),
        falls=falls,
        seconds=spent,
    )


def minimise(name: str, seed: int, sampler: str, trials: int, noise: float, is_smooth: bool) -> Minimised:
    """Searches an arm by the value of each trial alone.

    Args:
        name: of the arm.
        seed: of what is wrong, of the starts, of the noise and of the sampler.
        sampler: by name.
        trials: at most; fewer where the sampler is finished.
        noise: of the angles, in rad.
        is_smooth: whether it has no dry friction.
    """
    plant = plant_of(name, seed, noise, is_smooth)
    belief, episode = experiment_on(plant, seed)
    reach = FARTHEST * np.sqrt(np.diag(belief.covariance))
    began = time.process_time()
    h = arm_sensitivity(belief, episode, plant.timestep)
    coordinates = believed_metric(h, belief, belief.values - reach, belief.values + reach, resolution_hz(HORIZON))
    searcher = make_searcher(sampler, coordinates, seed, SamplerOptions(sigma=ArmSearchSettings().sigma))
    objective = ArmObjective(plant, belief, episode)
    number = falls = 0
    needed, best, error = None, np.inf, model_error(plant.tree, belief.nominal.parameters)
    nominal = error
    while number < trials and not searcher.finished():
        outcomes = []
        for values in searcher.ask()[: trials - number]:
            outcomes.append(objective.evaluate(values, number))
            number += 1
            falls += outcomes[-1].fell
            if not outcomes[-1].fell and outcomes[-1].value < best:
                best, error = outcomes[-1].value, model_error(plant.tree, belief.parameters_at(values))
                needed = (needed or number) if error.largest <= WITHIN else None
        if number < trials:
            searcher.tell(outcomes)
    return Minimised(
        arm=name,
        seed=seed,
        sampler=sampler,
        unknowns=len(belief.values),
        pushes=episode.npush,
        trials=number,
        falls=falls,
        trials_needed=needed,
        value=float(best),
        resolution=resolution_hz(HORIZON),
        value_of_truth=objective.evaluate(belief.base.of(plant.tree.parameters), number).value,
        nominal=nominal,
        error=error,
        seconds=time.process_time() - began,
    )


def minimised_table(runs: Sequence[Minimised]) -> str:
    """A row for each arm and seed."""
    return table(
        [
            {
                "arm": run.arm,
                "seed": run.seed,
                "sampler": run.sampler,
                "base parameters": run.unknowns,
                "pushes a trial": run.pushes,
                "falls": run.falls,
                "pushes to 1 %": run.trials_needed * run.pushes if run.trials_needed else None,
                "pushes": run.trials * run.pushes,
                "error at the end": f"{run.error.largest:.2%}",
                "best, Hz": run.value,
                "under the true law, Hz": run.value_of_truth,
                "can be told, Hz": run.resolution,
                "seconds": round(run.seconds),
            }
            for run in runs
        ]
    )


def _inside(estimate: ArmEstimate, true: Tree) -> int:
    """How many base parameters are inside their intervals."""
    low, high = estimate.interval()
    values = estimate.searched.belief.base.of(true.parameters)
    return int(((low <= values) & (values <= high)).sum())


def resumed(arms: list[str], seeds: list[int], noise: float, trials: int, path: Path | None) -> Iterator[Identified]:
    """Every arm from every seed, one after the other.

    Args:
        arms: their names.
        seeds: see `identify`.
        noise: see `identify`.
        trials: see `identify`.
        path: of a file of finished ones, one JSON object a line: what is in it is not run again, what is run is added.
    """
    done = {}
    if path is not None and path.exists():
        for text in path.read_text(encoding="utf-8").splitlines():
            row = json.loads(text)
            nominal, errors = ModelError(**row.pop("nominal")), [ModelError(**error) for error in row.pop("errors")]
            done[row.pop("noise"), row.pop("trials"), row["arm"], row["seed"]] = row, nominal, errors
    for name in arms:
        for seed in seeds:
            if (noise, trials, name, seed) in done:
                row, nominal, errors = done[noise, trials, name, seed]
                yield Identified(**row, nominal=nominal, errors=errors)
                continue
            found = identify(name, seed, noise, trials)
            if path is not None:
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"noise": noise, "trials": trials, **asdict(found)}) + "\n")
            yield found


def line(found: Identified) -> str:
    """A run for the line of progress."""
    last = found.errors[-1] if found.errors else None
    shown = f"{last.gravity:.1e} {last.coriolis:.1e} {last.mass_matrix:.1e}" if last else "none"
    after = " ".join(f"{error.largest:.1e}" for error in found.errors)
    verdict = "found" if found.explained and found.explained[-1] else "not found"
    return (
        f"{found.arm:9} {found.seed:3} {found.unknowns:3} unknown  nominal {found.nominal.largest:.2f}  {shown}  "
        f"({after})  misfit {found.misfits[-1] if found.misfits else np.nan:.2g}  {verdict}  "
        f"falls {found.falls}  {found.seconds:.1f} s"
    )


def identified_table(runs: Sequence[Identified], is_noisy: bool) -> str:
    """A row for each arm, and one for all."""
    rows = []
    for name in (*dict.fromkeys(run.arm for run in runs), ""):
        own = [run for run in runs if name in (run.arm, "")]
        found = [run for run in own if run.explained and run.explained[-1]]
        sizes = sorted({run.unknowns for run in own})
        wrong = [100.0 * run.nominal.largest for run in own]
        needed = [run.trials_needed for run in own if run.trials_needed]
        row: Row = {
            "arm": name or "all",
            "nominal arms": len(own),
            "base parameters": f"{sizes[0]} to {sizes[-1]}" if len(sizes) > 1 else sizes[0],
            "error of the nominal arm": f"{min(wrong):.0f} to {max(wrong):.0f} %",
            "found": len(found),
            "most trials to 1 %": max(needed) if len(needed) == len(own) else None,
        }
        for kind, shown in ERRORS.items():
            row[f"{shown}, median"] = _share(median(getattr(run.errors[-1], kind) for run in found)) if found else None
        row["largest of all"] = _share(max(run.errors[-1].largest for run in found)) if found else None
        if is_noisy:
            inside = sum(run.inside for run in found) / max(sum(run.unknowns for run in found), 1)
            row["inside 95 %"] = f"{100.0 * inside:.1f} %"
        row["seconds, median"] = round(median(run.seconds for run in own), 1)
        row["seconds, most"] = round(max(run.seconds for run in own), 1)
        rows.append(row)
    return table(rows)


def _share(error: float) -> str:
    return f"below {EXACT:.0e}" if error < EXACT else f"{100.0 * error:.2g} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arms", nargs="+", default=[*SHIPPED, *URDFS], choices=[*SHIPPED, *OTHERS, *URDFS])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(10)))
    parser.add_argument("--noise", type=float, default=0.0, help="of the angles, in rad; then without speed sensors")
    parser.add_argument("--trials", type=int, default=4, help="at most")
    parser.add_argument("--sampler", default="output-error", choices=["output-error", *MINIMISERS])
    parser.add_argument("--smooth", action="store_true", help="of a sampler that minimises: arms without dry friction")
    parser.add_argument("--results", type=Path, help="a file of finished runs, which are not run again")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.sampler != "output-error":
        searched = []
        with threadpool_limits(1):
            for name in options.arms:
                for seed in options.seeds:
                    one = minimise(name, seed, options.sampler, options.trials, options.noise, options.smooth)
                    print(f"{name} {seed}: {one.trials} trials", file=sys.stderr, flush=True)
                    searched.append(one)
        print(json.dumps([asdict(run) for run in searched]) if options.json else minimised_table(searched))
        return
    runs = []
    with threadpool_limits(1):  # threads of the linear algebra would only be in the way of the twins'
        identify(options.arms[0], options.seeds[0], options.noise, 1)  # compiles
        for run in resumed(options.arms, options.seeds, options.noise, options.trials, options.results):
            runs.append(run)
            print(line(run), file=sys.stderr, flush=True)
    if options.json:
        print(json.dumps([asdict(run) | {"trials_needed": run.trials_needed} for run in runs], indent=1))
    else:
        print(identified_table(runs, options.noise > 0.0))


if __name__ == "__main__":
    main()
