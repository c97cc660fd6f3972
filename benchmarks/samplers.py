"""Samplers at equal budgets: error of the worst lump against trials, on random chains of 1, 2, 3 and 5 links.

    python -m benchmarks.samplers -o samplers.png
    python -m benchmarks.samplers --links 2 --samplers tpe cmaes --seeds 0 1 --json

The measure is spectral and the pushes are rich, the nominal models as in benchmarks/chains.py. metaid's samplers
search in the nominal model's metric; `cmaes, plain` and `tpe, plain` in the factors themselves. `differential
evolution` is scipy's, in the factors, from the same start. Errors are those of the trial that was best so far by its
measure, which is all that a user could know.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median

import numpy as np
from scipy.optimize import differential_evolution
from threadpoolctl import threadpool_limits

from benchmarks.chains import random_chain
from metaid.plant import PlantSettings, chain_of
from metaid.study import Problem, StudySettings, StudySpec

BUDGETS = {1: 100, 2: 300, 3: 600, 5: 1200}
SAMPLERS = ("cmaes", "cmaes, plain", "tpe", "tpe, plain", "optuna-cmaes", "differential evolution", "random")


class _BudgetSpentError(Exception):
    """The budget is spent."""


class Tracker:
    """Evaluates candidates and notes after each trial the error of the one that is best by its measure."""

    def __init__(self, problem: Problem, truth: np.ndarray, budget: int) -> None:
        self._objective, self._truth, self._budget = problem.make_objective(), truth, budget
        self._best = np.inf
        self.errors: list[float] = []

    def evaluate(self, factors: np.ndarray) -> object:
        """The outcome of one candidate; raises when the budget is spent."""
        if len(self.errors) >= self._budget:
            raise _BudgetSpentError
        outcome = self._objective.evaluate(np.asarray(factors))
        error = float(np.abs(factors / self._truth - 1.0).max())
        better = outcome.value < self._best
        self._best = min(self._best, outcome.value)
        self.errors.append(error if better else self.errors[-1])
        return outcome


def compare(links: int, seed: int, sampler: str, budget: int) -> list[float]:
    """Errors after each trial, (budget) or fewer where the sampler was finished before."""
    true, nominal = random_chain(links, seed)
    name, _, where = sampler.partition(", ")
    metaid = name != "differential evolution"
    coordinates = "plain" if where == "plain" or not metaid else "nominal-metric"
    settings = {
        "plant": "chain",
        "nominal": "nominal",
        "trials": budget,
        "seed": seed,
        "search": {"coordinates": coordinates},
    }
    study = StudySettings.model_validate({**settings, "sampler": name if metaid else "cmaes"})
    plant = PlantSettings(links=true)
    problem = Problem(StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study))
    tracker = Tracker(problem, chain_of(true).lumps.vector / problem.nominal.lumps.vector, budget)
    run: Callable[[Problem, Tracker, int], None] = _run_searcher if metaid else _run_differential_evolution
    with contextlib.suppress(_BudgetSpentError):
        run(problem, tracker, seed)
    return tracker.errors


def _run_searcher(problem: Problem, tracker: Tracker, _seed: int) -> None:
    searcher = problem.make_searcher()
    while not searcher.finished():
        searcher.tell([tracker.evaluate(factors) for factors in searcher.ask()])  # type: ignore[misc]


def _run_differential_evolution(problem: Problem, tracker: Tracker, seed: int) -> None:
    bounds = list(zip(problem.low, problem.high, strict=True))
    value = lambda factors: tracker.evaluate(factors).value  # type: ignore[attr-defined]  # noqa: E731
    differential_evolution(value, bounds, x0=problem.robot.start, rng=seed, maxiter=10**6, tol=0, polish=False)


def trials_to(errors: list[float], within: float) -> int | None:
    """The first trial after which the error was at most `within`."""
    return next((i + 1 for i, error in enumerate(errors) if error <= within), None)


def table(results: dict[tuple[int, str], list[list[float]]]) -> str:
    """Medians over the seeds, as a Markdown table."""
    lines = ["| links | budget | sampler | within 1 % | trials to 1 % | error at the end |", "| --- " * 6 + "|"]
    for (links, sampler), runs in results.items():
        reached = [trials for errors in runs if (trials := trials_to(errors, 0.01)) is not None]
        middle = f"{median(reached):,.0f}" if len(reached) > len(runs) / 2 else "–"
        end = median(errors[-1] for errors in runs)
        lines.append(
            f"| {links} | {BUDGETS[links]:,} | {sampler} | {len(reached)} of {len(runs)} | {middle} | {end:.3%} |"
        )
    return "\n".join(lines)


def draw(results: dict[tuple[int, str], list[list[float]]], path: Path) -> None:
    """Median error against trials, one panel for each number of links."""
    from matplotlib.figure import Figure

    colours = ("#0072B2", "#D55E00", "#E69F00", "#009E73", "#56B4E9", "#CC79A7", "#000000", "#999999")
    sizes = sorted({links for links, _ in results})
    figure = Figure(figsize=(7.2, 2.9 * ((len(sizes) + 1) // 2)), layout="constrained")
    panels = np.atleast_1d(figure.subplots((len(sizes) + 1) // 2, min(len(sizes), 2))).ravel()
    for axes, links in zip(panels, sizes, strict=False):
        for (other, sampler), runs in results.items():
            if other == links:
                whole = np.array([errors + [errors[-1]] * (BUDGETS[links] - len(errors)) for errors in runs])
                colour = colours[SAMPLERS.index(sampler) % len(colours)]
                axes.loglog(
                    np.arange(1, whole.shape[1] + 1), 100 * np.median(whole, axis=0), color=colour, label=sampler
                )
        axes.axhline(1.0, color="#bbbbbb", linewidth=0.8, linestyle=":")
        axes.set_title(f"{links} link{'s' if links > 1 else ''}, {links * (links + 1) // 2} lumps", loc="left")
        axes.set_xlabel("trials")
        axes.set_ylabel("worst lump's error, %")
        axes.set_ylim(bottom=1e-3)
    panels[0].legend(fontsize=6.5, frameon=False)
    figure.savefig(path, dpi=110)


def options(description: str | None, links: Iterable[int], samplers: Iterable[str]) -> argparse.ArgumentParser:
    """The command line of a comparison of `samplers` on chains of so many `links`, by default all of them."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--links", type=int, nargs="+", choices=list(links), default=list(links))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--samplers", nargs="+", choices=list(samplers), default=list(samplers))
    parser.add_argument("--json", action="store_true")
    return parser


def main() -> None:
    """Runs the comparison and prints its table or JSON."""
    parser = options(__doc__, BUDGETS, SAMPLERS)
    parser.add_argument("-o", dest="output", type=Path, help="draw errors against trials (.png, .svg, .pdf)")
    given = parser.parse_args()
    results = {}
    with threadpool_limits(1):
        for links in given.links:
            for sampler in given.samplers:
                print(f"{links} links, {sampler}", file=sys.stderr)
                results[links, sampler] = [compare(links, seed, sampler, BUDGETS[links]) for seed in given.seeds]
    if given.output is not None:
        draw(results, given.output)
    if given.json:
        rows = [{"links": links, "sampler": sampler, "errors": runs} for (links, sampler), runs in results.items()]
        print(json.dumps(rows))
    else:
        print(table(results))


if __name__ == "__main__":
    main()
