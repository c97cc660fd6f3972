"""Whatever shows a study's result shows the same one: where trials are equal, and while a run goes on."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from conftest import law_of

import metaid as package
from metaid import results
from metaid.episode import Outcome
from metaid.errors import StudyError
from metaid.models import Array
from metaid.results import Findings, read_findings, validate_law
from metaid.show import companions, dashboard
from metaid.show.figures import Gallery, plot_boundary
from metaid.show.report import page
from metaid.store import Store, Trial
from metaid.store.reading import StoredTrials
from metaid.study import Problem, create_study, load_study

FIRST, LAST = 1.02, 1.01  # factors of the first and the last of two equal trials


def append(store: Store, name: str, problem: Problem, factors: Sequence[Array], values: Sequence[float]) -> None:
    """Adds survivors with these factors and values to a study."""
    before = store.count(name)
    outcomes = [Outcome(value, False, problem.episode.total_steps, (0,) * problem.nominal.nlink) for value in values]
    trials = [
        Trial(before + i, before + i, each, outcome)
        for i, (each, outcome) in enumerate(zip(factors, outcomes, strict=True))
    ]
    store.append(name, problem.names, problem.low, problem.high, trials)


def new_study(folder: Path, name: str, **changes: object) -> tuple[Store, Problem]:
    """A DB with a study that has no trials yet."""
    store, spec = Store(str(folder / "metaid.db"), create=True), load_study(name, changes)
    create_study(store, spec, name)
    return store, Problem(spec)


@pytest.fixture
def equal(tmp_path: Path) -> tuple[Store, Problem]:
    """A study of two links whose second and fourth trial have the same least value."""
    store, problem = new_study(tmp_path, "two-link-tpe", sampler="random", trials=7)
    factors = [np.full(len(problem.names), factor) for factor in (1.2, FIRST, 1.1, LAST, 1.3)]
    values = np.array([5.0, 0.5, 4.0, 0.5, 6.0]) * problem.resolution
    append(store, "two-link-tpe", problem, factors, values.tolist())
    return store, problem


def shown_by_everyone(store: Store, name: str) -> dict[str, Array]:
    """The identified factors of a study, by who shows them."""
    found, nominal = read_findings(store, name), read_findings(store, name).problem.robot.lumps.vector
    summary = results.summary(store, name)
    return {
        "study show --json": np.array([lump["identified"] for lump in summary["lumps"]]) / nominal,
        "frame": results.lumps_frame(store, name)["factor"].to_numpy(),
        "findings": found.identified_factors,
        "film": results.candidates_of(store, name, found.problem.open_plant())[1]["identified"].vector / nominal,
    }


@pytest.mark.slow
def test_everything_shows_the_last_of_equal_trials(equal: tuple[Store, Problem]) -> None:
    """Table, JSON, frame, film, figures, report, note and companion take the same of two trials with one value."""
    store, problem = equal
    for who, factors in shown_by_everyone(store, "two-link-tpe").items():
        assert factors == pytest.approx(np.full(3, LAST)), who
    found = read_findings(store, "two-link-tpe")
    assert found.summary["best"]["number"] == 3
    assert Gallery(found).centre.tolist() == [LAST] * 3
    (best,) = [each for each in plot_boundary(found, *problem.names[:2]).get_lines() if each.get_label() == "best"]
    assert (*best.get_xdata(), *best.get_ydata()) == (LAST, LAST)
    assert found.errors(found.bests)[-1] == pytest.approx(found.summary["max_error"])
    assert found.closest["number"].tolist()[:2] == [3, 1]
    for lump in found.summary["lumps"]:
        assert f"| {lump['identified']:.5g} |" in dashboard.note(found)
    text = re.sub("<[^>]*>", " ", page(found, Gallery(found), []))
    assert f"{found.summary['lumps'][0]['identified']:.5g}" in text


def test_companion_keeps_the_last_of_equal_trials(
    equal: tuple[Store, Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thinned study has the trial that its result is taken from."""
    store, problem = equal
    append(store, "two-link-tpe", problem, [np.full(3, 1.4)] * 3, [7.0 * problem.resolution] * 3)
    monkeypatch.setattr(companions, "KEPT", 4)  # the best one, and of the others every third
    kept = companions.thinned(results.trials_frame(store, "two-link-tpe"))
    assert 3 in kept["number"].tolist()


def test_validation_is_of_the_last_of_equal_trials(equal: tuple[Store, Problem]) -> None:
    """What is validated is what `study show` prints."""
    store, problem = equal
    ours = package.validate("two-link-tpe", store.url, pushes=1).summary()
    assert ours == validate_law(problem, law_of(problem, np.full(3, LAST)), pushes=1).summary()
    assert ours != validate_law(problem, law_of(problem, np.full(3, FIRST)), pushes=1).summary()


def test_dinoip_stands_by_the_last_step_before_the_fall(studied: Path) -> None:
    """Counts of zero are equal; the last of them is the nearest to the boundary of falling."""
    found = package.load_findings("counted", str(studied))
    zeros = found.survivors[found.survivors["value"] == found.survivors["value"].min()]
    assert zeros["gravity_1"].nunique() > 1
    assert found.best_factors[0] == zeros["gravity_1"].iloc[-1] != zeros["gravity_1"].iloc[0]


@pytest.mark.slow
def test_noisy_study_shows_the_mean_of_equal_trials(tmp_path: Path) -> None:
    """Everywhere: the best trial of a noisy plant is only the luckiest."""
    store, problem = new_study(tmp_path, "noisy-three-link", sampler="cmaes")
    factors = [np.full(6, factor) for factor in (1.0, 1.2, 1.1, 1.5)]
    append(store, "noisy-three-link", problem, factors, (np.array([-3.0, 0.5, 0.0, 5.0]) * problem.resolution).tolist())
    for who, shown in shown_by_everyone(store, "noisy-three-link").items():
        assert shown == pytest.approx(np.full(6, 1.1)), who
    ours = package.validate("noisy-three-link", store.url, pushes=1).summary()
    assert ours == validate_law(problem, law_of(problem, np.full(6, 1.1)), pushes=1).summary()


class Overtaken(Store):
    """A study DB to which somebody else appends a better trial right after each reading of the trials."""

    problem: Problem

    def read(self, name: str, *names: Sequence[str]) -> StoredTrials:
        """All trials as they are before the other one writes."""
        read = super().read(name, *names)
        other = Store(self.shown)
        value = min(trial.outcome.value for trial in read.own) / 2
        append(other, name, self.problem, [np.full(len(names[0]), 1.0 + value)], [value])
        other.close()
        return read


def agree(found: Findings) -> bool:
    """Whether trials, lumps and summary are of the same trials."""
    summary, survivors = found.summary, found.survivors
    return (
        summary["trials"]["total"] == len(found.trials)
        and summary["best"]["value"] == survivors["value"].min()
        and [lump["identified"] for lump in summary["lumps"]] == found.lumps["identified"].tolist()
        and found.lumps["factor"].to_numpy() == pytest.approx(found.best_factors)
    )


def test_findings_agree_with_themselves_while_trials_are_written(equal: tuple[Store, Problem]) -> None:
    """All parts are of one reading of the DB, whatever is appended before the next."""
    store, problem = equal
    overtaken = Overtaken(store.shown)
    overtaken.problem = problem
    for count in (5, 6, 7):
        found = read_findings(overtaken, "two-link-tpe")
        assert len(found.trials) == count
        assert agree(found)


def test_validation_without_a_survivor_is_refused(tmp_path: Path) -> None:
    """There is nothing to validate."""
    store, _ = new_study(tmp_path, "two-link-tpe")
    with pytest.raises(StudyError, match="0 of 400 trials are done"):
        package.validate("two-link-tpe", store.url)
