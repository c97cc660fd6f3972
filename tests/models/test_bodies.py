"""Individual parameters: what is found is a set of bodies, all possible ones, whose lumps agree."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from conftest import Finished, random_plant

import metaid as package
from metaid.episode.outcome import Outcome
from metaid.errors import StudyError
from metaid.models.lumps import Array
from metaid.models.same_motion import SameMotion
from metaid.search.body_space import BodySpace, body_space
from metaid.search.registry import SamplerOptions, make_searcher
from metaid.search.walk import Walking
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.kinds import load_chain_study
from metaid.study.problem import Problem
from metaid.study.run import run_study

Metaid = Callable[..., Finished]


def space_of(nlink: int, low: float = 0.5, high: float = 2.0) -> BodySpace:
    """The space about a random chain."""
    each = np.ones(2 * nlink)
    return body_space(random_plant(nlink).chain, each, low * each, high * each)


@pytest.mark.parametrize("nlink", [1, 2, 3, 5, 10])
def test_lumps_of_bodies_are_those_of_a_chain_with_these_masses(nlink: int) -> None:
    """Eqs. 1 and 2 for many bodies at once, as for one chain; the nominal body has the nominal lumps."""
    chain, space = random_plant(nlink).chain, space_of(nlink)
    factors = np.random.default_rng(1).uniform(0.5, 2.0, (3, 2 * nlink))
    many = space.bodies.scaled(factors)
    for i, own in enumerate(factors):
        mass, com = np.split(own, 2)
        lumps = replace(chain, mass=chain.mass * mass, com=chain.com * com).lumps
        assert many.gravity[i] == pytest.approx(lumps.gravity, rel=1e-12)
        assert many.coriolis[i] == pytest.approx(lumps.coriolis, rel=1e-12)
        assert space.parameters(own) == pytest.approx(lumps.vector, rel=1e-12)


def test_every_candidate_is_a_possible_body() -> None:
    """However far the searcher goes, without bounds to speak of: masses are positive, centres of mass on their link."""
    space = space_of(3, low=1e-12, high=1e12)
    random = np.random.default_rng(2)
    for size in (0.1, 3.0, 20.0):
        for z in size * random.normal(size=(50, 6)):
            mass, com = np.split(space.coordinates.factors(z) * space.bodies.vector, 2)
            assert (mass > 0.0).all()
            assert ((com > 0.0) & (com < space.bodies.length)).all()


def test_coordinates_lead_back_and_know_their_bounds() -> None:
    """z of factors of z is z; the corners of the box are inside, beyond them is not."""
    coordinates = space_of(3).coordinates
    z = 0.1 * np.random.default_rng(3).normal(size=6)
    assert coordinates.z(coordinates.factors(z)) == pytest.approx(z, abs=1e-12)
    assert coordinates.factors(np.zeros(6)) == pytest.approx(np.ones(6))
    for corner in coordinates.box():
        assert coordinates.inside(0.999 * corner)
        assert not coordinates.inside(1.001 * corner)


@pytest.mark.parametrize("nlink", [1, 2, 3, 10])
def test_walk_stays_among_possible_bodies_of_the_same_lumps(nlink: int) -> None:
    """Ends and points between them are within the bounds, and none of them moves otherwise."""
    space, random = space_of(nlink), np.random.default_rng(4)
    best = np.full(2 * nlink, 1.1)
    same = SameMotion(space.bodies, best, space.low, space.high)
    walked, mass = same.ends(), same.start
    for _ in range(20):
        mass = same.random_point(mass, random)
        walked.append(mass)
    factors = np.array([same.factors(mass) for mass in walked])
    assert (factors >= space.low * (1 - 1e-6)).all()
    assert (factors <= space.high * (1 + 1e-6)).all()
    assert space.parameters(factors) == pytest.approx(np.tile(space.parameters(best), (len(walked), 1)), rel=1e-9)
    assert np.ptp(factors[-20:], axis=0).min() > 0.01


def corners(space: BodySpace, best: Array) -> Array:
    """Factors of every corner of the set: where nlink of its bounds meet, within the others."""
    n, bodies = space.bodies.nlink, space.bodies
    gravity = bodies.scaled(best).gravity
    outboard = np.triu(np.ones((n, n)), 1) * bodies.length[:, None]
    rows, limits = [], []
    for bound in (space.low, space.high):
        mass, com = np.split(bound * bodies.vector, 2)
        rows += [np.eye(n), outboard + np.diag(com)]  # m = bound, and μ − outboard m = s = bound m
        limits += [mass, gravity]
    found = []
    for chosen in map(list, itertools.combinations(range(4 * n), n)):
        matrix = np.concatenate(rows)[chosen]
        if np.linalg.matrix_rank(matrix) == n:
            mass = np.linalg.solve(matrix, np.concatenate(limits)[chosen])
            if (mass > 0.0).all():
                found.append(np.concatenate([mass, (gravity - outboard @ mass) / mass]) / bodies.vector)
    every = np.array(found)
    return every[((every >= space.low * (1 - 1e-9)) & (every <= space.high * (1 + 1e-9))).all(axis=1)]


@pytest.mark.parametrize(("nlink", "seed"), [(1, 1), (2, 1), (2, 2), (3, 1), (3, 2), (4, 1)])
def test_ends_of_the_set_are_those_among_all_its_corners(nlink: int, seed: int) -> None:
    """Each parameter's least and largest value are those of brute force, and the bodies that have them are possible."""
    each = np.ones(2 * nlink)
    space = body_space(random_plant(nlink, seed).chain, each, 0.5 * each, 2.0 * each)
    best = np.random.default_rng(seed).uniform(0.8, 1.25, 2 * nlink)
    same = SameMotion(space.bodies, best, space.low, space.high)
    ends = np.array([same.factors(mass) for mass in same.ends()])
    all_corners = corners(space, best)
    for parameter in range(2 * nlink):
        assert ends[2 * parameter, parameter] == pytest.approx(all_corners[:, parameter].min(), rel=1e-9)
        assert ends[2 * parameter + 1, parameter] == pytest.approx(all_corners[:, parameter].max(), rel=1e-9)
    assert (ends >= space.low * (1 - 1e-9)).all()
    assert (ends <= space.high * (1 + 1e-9)).all()


def test_set_of_one_body_has_its_ends_there() -> None:
    """Where the best body has the largest mass and the farthest centre of mass of every link, no other moves as it."""
    space = space_of(3)
    same = SameMotion(space.bodies, space.high, space.low, space.high)
    for mass in same.ends():
        assert same.factors(mass) == pytest.approx(space.high, rel=1e-6)


@pytest.mark.parametrize("nlink", [2, 3, 5])
def test_ends_are_bodies_where_there_are_no_bounds_to_speak_of(nlink: int) -> None:
    """With bounds of 1e-9 and 1e9, too: what cannot be found exactly is within the bounds and moves the same."""
    space = space_of(nlink, low=1e-9, high=1e9)
    same = SameMotion(space.bodies, np.ones(2 * nlink), space.low, space.high)
    ends = np.clip([same.factors(mass) for mass in same.ends()], space.low, space.high)
    nominal = space.parameters(np.ones(2 * nlink))
    assert np.abs(space.parameters(ends) / nominal - 1.0).max() < 1e-5


def test_walk_waits_for_a_survivor() -> None:
    """While everything falls there is no best body to walk from, so the search goes on beyond its share."""
    coordinates = space_of(2).coordinates
    walking = Walking(make_searcher("cmaes", coordinates, 0, SamplerOptions()), coordinates, 0, search_trials=8)
    fall = Outcome(2.0, True, 5, (0, 0))
    for _ in range(3):
        batch = walking.ask()
        assert walking.spread is not None
        walking.tell([fall] * len(batch))
    batch = walking.ask()
    walking.tell([Outcome(0.5, False, 100, (0, 0))] + [fall] * (len(batch) - 1))
    assert len(walking.ask()) == 8
    assert walking.spread is None


def test_search_that_ends_without_a_survivor_ends_the_study(tmp_path: Path) -> None:
    """DINOIP ends where its start falls, and then there is no body to walk from."""
    changes = {"sampler": "dinoip", "search.start": 0.55, "episode.fall_limit": 1.0}
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_chain_study("two-link-parameters", changes), "study")
    for _ in range(2):  # resumed, too
        progress = run_study(store, "study")
        assert (progress.trials, progress.falls, progress.best) == (1, 1, None)
    store.close()


def test_search_that_is_finished_hands_over_to_the_walk() -> None:
    """DINOIP comes to an end before its share of the trials, and the walk, which has none, takes the rest."""
    coordinates = space_of(1).coordinates
    walking = Walking(make_searcher("dinoip", coordinates, 0, SamplerOptions(increment=0.2)), coordinates, 0, 1000)
    sizes = []
    for _ in range(30):
        candidates = walking.ask()
        sizes.append(len(candidates))
        outcomes = [Outcome(float(factors.sum()), False, 100, (0, 0)) for factors in candidates]
        walking.tell(outcomes)
        assert not walking.finished()
    first = sizes.index(4)
    assert sizes == [1] * first + [4] + [8] * (29 - first)
    gravity = coordinates.bodies.scaled(candidates).gravity
    assert gravity == pytest.approx(np.full((8, 1), gravity[0, 0]))


def test_walk_goes_on_to_another_body_with_every_candidate_within_the_bounds() -> None:
    """No body comes twice after the ends, the search is told of none, and none is beyond a bound by rounding."""
    coordinates = space_of(3).coordinates
    walking = Walking(make_searcher("cmaes", coordinates, 0, SamplerOptions()), coordinates, 0, search_trials=1)
    generations = []
    for _ in range(5):
        generations.append(walking.ask())
        walking.tell([Outcome(0.5, False, 100, (0, 0, 0))] * len(generations[-1]))
    _, ends, *walked = generations
    assert len(ends) == 12
    assert len(np.unique(np.concatenate(walked), axis=0)) == 3 * 8
    for candidates in generations:
        assert ((candidates >= coordinates.low) & (candidates <= coordinates.high)).all()


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped study of the individual parameters of two links, run."""
    path = tmp_path_factory.mktemp("bodies") / "metaid.db"
    package.run("two-link-parameters", storage=str(path))
    return path


def test_lumps_are_found_and_bodies_are_not_and_the_report_says_so(
    database: Path, metaid: Metaid, tmp_path: Path
) -> None:
    """Over all bodies as good as the best one, every lump stays within 1 % of the truth, and no parameter does."""
    where = ("--storage", str(database))
    shown = json.loads(metaid("study", "show", "two-link-parameters", "--json", *where).out)
    for lump in shown["lumps"]:
        assert lump["low"] == pytest.approx(lump["true"], rel=0.01)
        assert lump["high"] == pytest.approx(lump["true"], rel=0.01)
    for row in shown["parameters"]:
        assert row["high"] / row["low"] > 2.0
        assert row["low"] < 0.99 * row["true"] < 1.01 * row["true"] < row["high"]
    mass_1 = shown["parameters"][0]
    assert (mass_1["low"], mass_1["high"]) == pytest.approx((0.5 * 0.9, 2.0 * 0.9), rel=1e-9)
    said = metaid("study", "show", "two-link-parameters", *where).out
    assert metaid("study", "report", "two-link-parameters", "-o", "report.html", *where).status == 0
    page = Path("report.html").read_text()
    for text in (said, page):
        assert "bodies are as good as the best one, and their lumps agree within 0." in text
        assert "the lumps are identified, these parameters are not" in text
    assert 'id="parameters-table"' in page


def test_walked_bodies_are_real_episodes_as_good_as_the_best(database: Path) -> None:
    """The last 64 trials have the measure of the best of those before, to rounding, at quite other factors."""
    trials = package.trials("two-link-parameters", str(database))
    searched, walked = trials.iloc[:-64], trials.iloc[-64:]
    assert walked["value"].to_numpy() == pytest.approx(searched["value"].min(), rel=1e-6)
    assert walked["mass_1"].max() / walked["mass_1"].min() > 2.0


def test_db_holds_factors_of_parameters_within_bounds(database: Path) -> None:
    """Optuna sees mass_i and com_i, each with its own bounds; a centre of mass stays on its link."""
    study = optuna.load_study(study_name="two-link-parameters", storage=f"sqlite:///{database}")
    assert list(study.trials[0].params) == ["mass_1", "mass_2", "com_1", "com_2"]
    assert study.trials[0].distributions["mass_1"].high == 2.0  # type: ignore[attr-defined]
    assert study.trials[0].distributions["com_1"].high == pytest.approx(2.0, rel=1e-5)  # type: ignore[attr-defined]
    assert max(trial.params["com_2"] for trial in study.trials) * 0.175 < 0.35


def test_resumed_in_the_midst_of_the_walk_gives_the_same_trials(database: Path, tmp_path: Path) -> None:
    """Stopped during the search and again during the walk, with other workers."""
    other = str(tmp_path / "metaid.db")
    for trials, workers in ((50, 1), (230, 2), (None, 1)):
        package.run("two-link-parameters", storage=other, trials=trials, workers=workers)
    one, two = (package.trials("two-link-parameters", storage) for storage in (str(database), other))
    assert one.equals(two)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"search.walk": 264}, "walk is 264 of 264 trials"),
        ({"search.target": 0.001}, "search.target"),
        ({"search.coordinates": "plain"}, "search.coordinates"),
        ({"episode.measure": "count"}, "measure = 'spectral'"),
        ({"search.high": {"gravity_1": 1.5}}, "unknown parameter 'gravity_1'"),
        ({"search.start": {"com_1": 2.5}}, "start 2.5 of com_1 is not within its bounds"),
        ({"search.low": {"com_1": 2.1}, "search.start": {"com_1": 2.2}, "search.high": 3.0}, "start 2.2 of com_1"),
    ],
)
def test_setting_that_parameters_have_no_use_for_is_refused(changes: dict[str, Any], message: str) -> None:
    """In one line that names it; a centre of mass beyond the tip is out of bounds whatever the bounds are."""
    with pytest.raises(StudyError, match=message):
        load_chain_study("two-link-parameters", changes)


def test_bounds_of_the_lumps_hold_those_of_all_bodies() -> None:
    """What figures and the dashboard draw between."""
    problem = Problem(load_chain_study("two-link-parameters"))
    low, high = problem.space.low, problem.space.high
    lumps = problem.lump_factors(np.random.default_rng(6).uniform(low, high, (200, 4)))
    assert (lumps >= problem.low).all()
    assert (lumps <= problem.high).all()
