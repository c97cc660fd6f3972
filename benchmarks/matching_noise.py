"""What matching gives on noisy plants: errors after each trial, what 95 % intervals cover, and what the misfit says.

    python -m benchmarks.matching_noise                                  # 1 mrad on the angles, no speed sensor
    python -m benchmarks.matching_noise --pushes-differ 0.02
    python -m benchmarks.matching_noise --horizons 1                     # of a rich push, to watch each for
    python -m benchmarks.matching_noise --hidden friction spring limit lengths --links 3 --most 2

Each chain of benchmarks/chains.py is a study with `sampler = "output-error"` in a DB of its own. The plant is MuJoCo,
and no length is assumed. `--hidden` gives the plant what the model has not: viscous friction, springs, a torque limit
that bites; or lengths that are 2 % wrong are taken as exact.
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

from benchmarks.chain_study import chain_study
from benchmarks.chains import random_chain
from benchmarks.common import Row, made
from benchmarks.common import table as markdown
from metaid.episode import REACH, natural_time
from metaid.estimation import Estimate, Experiment, ReadTrial
from metaid.models import Array, kind_of
from metaid.plant import chain_of
from metaid.study import HORIZON, Problem, StudySpec, run_study

LINKS, KINDS = (2, 3, 5), ("gravity", "coriolis", "inertia")
FRICTION, SPRING = 0.02, 0.2  # N m s and N m/rad in every joint
BITES = 0.5  # of the largest torque that the first trial asks of any joint
WRONG_LENGTHS = 0.02
HIDDEN = {
    "friction": f"viscous friction of {FRICTION:g} N m s in every joint",
    "spring": f"a spring of {SPRING:g} N m/rad in every joint",
    "limit": "a torque limit at half of what is asked",
    "lengths": f"lengths wrong by {WRONG_LENGTHS:.0%}, taken as exact".replace("%", " %"),
}


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
    """What a plant has: noise of its angle readings in rad, what its pushes differ by, and what the model has not; and
    for how many `horizons` of a rich push it is watched after each, where that is not left to the study.
    """

    noise: float = 1e-3
    pushes_differ: float = 0.0
    hidden: str | None = None
    horizons: float | None = None

    def spec(self, links: int, seed: int, trials: int, torque_limit: float | None = None) -> StudySpec:
        """A study of a chain of so many `links`; `torque_limit` in N m."""
        changed = {"friction": {"damping": FRICTION}, "spring": {"stiffness": SPRING}}.get(self.hidden or "", {})
        faults: dict[str, Any] = {"angle_noise": self.noise, "speed_sensor": False, "push_noise": self.pushes_differ}
        true, nominal = random_chain(links, seed)
        lengths: Any = "free"
        if self.hidden == "lengths":
            wrong = 1.0 + WRONG_LENGTHS * np.random.default_rng(seed).choice([-1.0, 1.0], links)
            longer = zip(nominal, wrong.tolist(), strict=True)
            nominal = tuple(link.model_copy(update={"length": link.length * factor}) for link, factor in longer)
            lengths = "exact"
        faults["torque_limit"] = torque_limit
        spec = chain_study((true, nominal), trials, seed, faults, changed, {"lengths": lengths})
        if self.horizons is None:
            return spec
        study, plant = spec.study, spec.plant
        horizon = HORIZON * natural_time(chain_of(nominal), spec.gravity)
        watched = {"steps": round(self.horizons * horizon / plant.timestep), "peak_speed": REACH / horizon}
        episode = study.episode.model_copy(update=watched)
        return spec.model_copy(update={"study": study.model_copy(update={"episode": episode})})


def match(links: int, seed: int, noisy: Noisy, most: int) -> list[Matched]:
    """Identifies one chain by a study of `most` trials, and says what it knew after each."""
    spec = noisy.spec(links, seed, most)
    if noisy.hidden == "limit":
        problem, experiment = _experiment(spec)
        first = problem.make_searcher().ask()[0]
        trial = experiment.trial(first, problem.make_objective().evaluate(first))
        assert trial is not None
        spec = noisy.spec(links, seed, most, BITES * float(np.abs(trial.torques).max()))
    problem, experiment = _experiment(spec)
    true = problem.open_plant().true_lumps()
    assert true is not None
    trials: list[ReadTrial] = []
    rows: list[Matched] = []
    estimate: Estimate | None = None
    for tried in _tried(spec):
        trial = experiment.trial(tried.factors, tried.outcome)
        assert trial is not None
        trials.append(trial)
        began = time.perf_counter()
        estimate = experiment.estimate(trials, estimate)
        if estimate is None:  # no chain shows what was seen: that is no misfit, but a refusal
            break
        seconds = time.perf_counter() - began
        rows.append(_judge(links, seed, len(trials), estimate, experiment.unknowns.log_factors(true), seconds))
    return rows


def _experiment(spec: StudySpec) -> tuple[Problem, Experiment]:
    problem = Problem(spec)
    experiment = problem.experiment()
    assert experiment is not None
    return problem, experiment


def _tried(spec: StudySpec) -> list[Any]:
    """The trials of a study that is run in a DB of its own."""
    with made(spec) as (store, name):
        run_study(store, name, workers=1)
        return list(store.trials(name, spec.names))


def _judge(links: int, seed: int, trials: int, estimate: Estimate, truth: Array, seconds: float) -> Matched:
    error = estimate.searched.design @ (estimate.unknowns - truth)
    inside = np.abs(error) <= 1.96 * estimate.value_deviations / estimate.values
    kinds = np.array([kind_of(name) for name in estimate.searched.lump_names])
    named = [kind for kind in KINDS if (kinds == kind).any()]
    errors = {kind: float(np.abs(np.expm1(error[kinds == kind])).max()) for kind in named}
    covered = {kind: float(inside[kinds == kind].mean()) for kind in named}
    return Matched(links, seed, trials, errors, covered, estimate.misfit, seconds)


def rows_of(rows: list[Matched], noisy: Noisy) -> list[Row]:
    """The rows of the table: medians of the worst lump of each kind, means of what intervals cover."""
    horizon = "the study's" if noisy.horizons is None else f"{HORIZON * noisy.horizons:g} √(l/g)"
    pushes = f"{100.0 * noisy.pushes_differ:g} %" if noisy.pushes_differ else "0"
    shown: list[Row] = []
    for links, trials in sorted({(row.links, row.trials) for row in rows}):
        runs = [row for row in rows if (row.links, row.trials) == (links, trials)]
        named = [kind for kind in KINDS if kind in runs[0].errors]
        errors = {kind: f"{float(np.median([row.errors[kind] for row in runs])):.3%}" for kind in named}
        covered = {kind: f"{float(np.mean([row.covered[kind] for row in runs])):.1%}" for kind in named}
        shown.append(
            {
                "noise on angles": f"{1e3 * noisy.noise:g} mrad",
                "pushes differ by": pushes,
                "horizon": horizon,
                "hidden in the plant": HIDDEN[noisy.hidden] if noisy.hidden else None,
                "links": links,
                "chains": len(runs),
                "trials": trials,
                **{kind.replace("coriolis", "Coriolis"): errors.get(kind) for kind in KINDS},
                **{f"{kind} covered": covered.get(kind) for kind in KINDS},
                "misfit": " to ".join(_misfit(each(row.misfit for row in runs)) for each in (min, max)),
                "ms of the fit": round(1e3 * float(np.median([row.fit_seconds for row in runs]))),
            }
        )
    return shown


def _misfit(misfit: float) -> str:
    return f"{misfit:.2f}" if misfit < 10.0 else f"{float(f'{misfit:.3g}'):,g}"


def main() -> None:
    """Runs what is asked for, with a line on stderr for every chain, and prints the table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", default=list(LINKS), help="numbers of links")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(20)), help="of the chains")
    parser.add_argument("--noise", type=float, default=1e-3, help="of an angle reading, in rad")
    parser.add_argument("--pushes-differ", type=float, default=0.0, help="noise of an impulse, as a share of it")
    parser.add_argument("--hidden", nargs="+", choices=list(HIDDEN), default=[None], help="what the model has not")
    parser.add_argument("--horizons", type=float, help="of a rich push, to watch each for (default: the study's)")
    parser.add_argument("--most", type=int, default=4, help="trials")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows: list[Matched] = []
    shown: list[Row] = []
    with threadpool_limits(1):
        for hidden in given.hidden:
            noisy, own = Noisy(given.noise, given.pushes_differ, hidden, given.horizons), list[Matched]()
            for links in given.links:
                for seed in given.seeds:
                    own += (runs := match(links, seed, noisy, given.most))
                    misfits = ", ".join(f"{row.misfit:.2f}" for row in runs)
                    print(f"N={links} seed {seed}: misfit {misfits}", file=sys.stderr)
            rows, shown = rows + own, shown + rows_of(own, noisy)
    print(json.dumps([asdict(row) for row in rows], indent=2) if given.json else markdown(shown))


if __name__ == "__main__":
    main()
