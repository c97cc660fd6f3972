"""A study's trials depend on its settings and seed alone, and it finds the truth without having seen it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import best_error
from forked import Command
from listeners import listening
from pandas.testing import assert_frame_equal

from metaid import results
from metaid.errors import StorageError, StudyError
from metaid.plant import MujocoPlant
from metaid.results.lump_tables import best_table
from metaid.store import Store
from metaid.study import Progress, StudySpec, create_study, load_study, run_study


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty study DB."""
    return Store(str(tmp_path / "metaid.db"), create=True)


def run(
    store: Store, name: str, changes: dict[str, Any] | None = None, study: str = "three-link-coast", **how: Any
) -> pd.DataFrame:
    """Creates and runs a study under `name`; its trial table."""
    create_study(store, load_study(study, changes), name)
    run_study(store, name, **how)
    return results.trials_frame(store, name)


def test_three_link_study_identifies_every_lump_within_one_percent(store: Store) -> None:
    """By strong short pushes, from a nominal model that is wrong by up to 30 %."""
    run(store, "three-link-coast")
    lumps = results.lumps_frame(store, "three-link-coast")
    nominal_error = (lumps["nominal"] / lumps["true"] - 1).abs()
    assert nominal_error.max() > 0.3
    assert lumps["error"].abs().max() < 0.01
    assert best_error(store, "three-link-coast") < 0.01
    assert ((lumps["low"] <= lumps["identified"]) & (lumps["identified"] <= lumps["high"])).all()


def test_trials_are_the_same_for_any_number_of_workers(store: Store) -> None:
    """1, 2 and 3 workers, bit for bit."""
    one, two, three = (run(store, f"workers-{n}", {"trials": 150}, workers=n) for n in (1, 2, 3))
    assert_frame_equal(one, two, check_exact=True)
    assert_frame_equal(one, three, check_exact=True)


@pytest.mark.slow
def test_trials_are_the_same_on_two_ray_actors(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray and threads, bit for bit, survivors and falls alike; a Ray cluster that was not asked for is left alone. The
    driver, the raylet, the object store and the workers listen on loopback alone.
    """
    changes = {"trials": 100, "search.start": 0.8, "episode.fall_limit": 1.0}
    local = run(store, "local", changes)
    assert set(local["state"]) == {"COMPLETE", "PRUNED"}
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    before, opened = listening(os.getpid()), set[tuple[str, int]]()

    def look(_progress: Progress) -> None:
        opened.update(opened or listening(os.getpid()) - before)

    assert_frame_equal(local, run(store, "ray", changes, engine="ray", workers=2, watch=look), check_exact=True)
    assert opened
    assert {address for address, _ in opened} <= {"127.0.0.1", "::1", "::ffff:127.0.0.1"}


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["cmaes", "tpe", "random", "optuna-cmaes"])
def test_stopped_and_resumed_run_has_the_trials_of_an_uninterrupted_one(store: Store, sampler: str) -> None:
    """Stopped within a generation, at its end, and resumed with another number of workers."""
    changes = {"sampler": sampler, "trials": 70, "estimate.enabled": False}
    whole = run(store, "whole", changes)
    create_study(store, load_study("three-link-coast", changes), "parts")
    for trials, workers in ((13, 2), (14, 1), (40, 3), (70, 2)):
        run_study(store, "parts", trials=trials, workers=workers)
        assert len(results.trials_frame(store, "parts")) == trials
    assert_frame_equal(whole, results.trials_frame(store, "parts"), check_exact=True)


def test_trials_are_a_total_and_not_a_number_more(store: Store) -> None:
    """Running a finished study again adds nothing."""
    first = run(store, "study", {"trials": 30})
    run_study(store, "study")
    run_study(store, "study", trials=20)
    assert_frame_equal(first, results.trials_frame(store, "study"), check_exact=True)


def test_seed_changes_the_trials(store: Store) -> None:
    """Another seed, another search."""
    one, other = run(store, "one", {"trials": 20}), run(store, "other", {"trials": 20, "seed": 2})
    assert (one["gravity_1"] != other["gravity_1"]).all()


def test_search_never_asks_for_the_truth(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing between the study's settings and its trials reads the true lumps."""

    def refuse(_plant: MujocoPlant) -> None:
        raise AssertionError("the search looked at the truth")

    create_study(store, load_study("three-link-coast", {"trials": 40}), "blind")
    with monkeypatch.context() as patch:
        patch.setattr(MujocoPlant, "true_lumps", refuse)
        run_study(store, "blind")
    assert_frame_equal(results.trials_frame(store, "blind"), run(store, "seeing", {"trials": 40}), check_exact=True)


def test_plant_that_knows_no_truth_identifies_equally(store: Store) -> None:
    """Same trials, same identified lumps; truth and error are not known."""
    spec = load_study("three-link-coast", {"trials": 60})
    unknown = spec.model_copy(update={"plant": spec.plant.model_copy(update={"truth_known": False})})
    for name, made_from in (("known", spec), ("unknown", unknown)):
        create_study(store, made_from, name)
        run_study(store, name)
    known, blind = results.summary(store, "known"), results.summary(store, "unknown")
    assert [lump["identified"] for lump in known["lumps"]] == [lump["identified"] for lump in blind["lumps"]]
    assert known["max_error"] is not None
    assert blind["max_error"] is None
    assert {(lump["true"], lump["error"]) for lump in blind["lumps"]} == {(None, None)}


@pytest.mark.slow
def test_nominal_metric_needs_fewer_trials_than_plain_coordinates(store: Store) -> None:
    """In the nominal model's metric the worst lump is nearer after the same trials, for most seeds."""
    errors = {}
    for coordinates in ("nominal-metric", "plain"):
        changes = {"trials": 250, "search.coordinates": coordinates, "estimate.enabled": False}
        for seed in range(3):
            run(store, f"{coordinates}-{seed}", {**changes, "seed": seed})
            errors[coordinates, seed] = best_error(store, f"{coordinates}-{seed}")
    assert sum(errors["nominal-metric", seed] < errors["plain", seed] for seed in range(3)) >= 2


@pytest.mark.slow
def test_random_nominal_models_are_all_identified(store: Store) -> None:
    """Recovery from three other wrong starts, masses and inertias by 30 % and centres of mass by 15 %."""
    spec = load_study("three-link-coast", {"trials": 700, "estimate.enabled": False})
    for seed in range(3):
        random = np.random.default_rng(seed)
        nominal = tuple(
            link.model_copy(
                update={
                    "mass": link.mass * random.uniform(0.7, 1.3),
                    "com": link.com * random.uniform(0.85, 1.15),
                    "inertia": link.inertia * random.uniform(0.7, 1.3),
                }
            )
            for link in spec.plant.links
        )
        create_study(store, spec.model_copy(update={"nominal": nominal}), f"nominal-{seed}")
        run_study(store, f"nominal-{seed}")
        assert best_error(store, f"nominal-{seed}") < 0.01


def test_two_link_tpe_reports_its_errors_as_they_are(store: Store) -> None:
    """The shipped TPE study runs on two workers and comes much nearer than its nominal model."""
    run(store, "two-link-tpe", {"trials": 150}, study="two-link-tpe", workers=2)
    lumps = results.lumps_frame(store, "two-link-tpe")[:3]
    assert best_error(store, "two-link-tpe") < 0.5 * (lumps["nominal"] / lumps["true"] - 1).abs().max()


def test_gravity_lump_is_found_from_counted_periods(store: Store) -> None:
    """The paper's own measure, one link: within 1 %, and the plateau is shown as a range."""
    run(store, "count", study="one-link-count")
    lump = best_table(results.read_snapshot(store, "count")).iloc[0]
    assert abs(lump["error"]) < 0.01
    assert lump["low"] < lump["high"]


def test_search_stops_at_the_target(store: Store) -> None:
    """With a target, no trial is spent after the generation that reached it, nor when run again."""
    trials = run(store, "target", {"search.target": 0.05})
    assert trials["value"].min() <= 0.05
    assert trials.loc[trials["generation"] < trials["generation"].max(), "value"].min() > 0.05
    run_study(store, "target")
    assert len(results.trials_frame(store, "target")) == len(trials) < 600


def test_trials_that_do_not_follow_from_the_settings_are_refused(store: Store, tmp_path: Path) -> None:
    """A DB whose factors were changed cannot be resumed as if nothing had happened."""
    import sqlite3

    run(store, "study", {"trials": 30})
    with sqlite3.connect(tmp_path / "metaid.db") as connection:
        connection.execute("UPDATE trial_params SET param_value = 1.5 WHERE param_id = 7")
    with pytest.raises(StorageError, match="do not follow from its settings and seed"):
        run_study(store, "study", trials=60)


@pytest.mark.slow
def test_interrupted_run_says_how_to_go_on(store: Store, tmp_path: Path) -> None:
    """SIGINT and SIGTERM: status 130 and 143, one line, and whole generations in the DB."""
    endless = {"trials": 1000000, "sampler": "random", "search.generation": 9}
    create_study(store, load_study("three-link-coast", endless))
    for stop, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        before = store.count("three-link-coast")
        process = Command(tmp_path, "study", "run", "three-link-coast", first=f"import os; os.chdir({str(tmp_path)!r})")
        while store.count("three-link-coast") == before:
            time.sleep(0.02)
        process.send(stop)
        assert process.wait(60.0) == status
        assert process.err.strip().splitlines()[-1].endswith("go on with: metaid study run three-link-coast")
    trials = results.trials_frame(store, "three-link-coast")
    assert trials["number"].tolist() == list(range(len(trials)))
    assert (trials.groupby("generation").size() == 9).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"search.start": 0.4}, "the start 0.4 of gravity_1 is not within its bounds 0.5 to 2"),
        ({"search.low": {"gravity_9": 0.5}}, "search: low: unknown lump 'gravity_9'"),
        ({"trials": 0}, "trials: should be greater than or equal to 1"),
        ({"sampler": "cma"}, "unknown sampler 'cma'; did you mean 'cmaes'"),
        ({"episode.measure": "spectrum"}, "unknown measure 'spectrum'; did you mean 'spectral'"),
        ({"episode.pushes": [[0.1, 0.2]]}, "every push needs 3 impulses"),
        ({"episode.pushes": [[0.0, 0.0, 0.0]]}, "without a push nothing moves"),
        ({"episode.mesure": "count"}, "unknown key 'mesure'; did you mean 'measure'"),
        ({"nominal": "two-link"}, "has 3 links, the nominal model 2"),
        ({"seed": -1}, "seed: should be greater than or equal to 0"),
        ({"search.sigma": float("nan")}, "sigma: should be a finite number"),
        ({"trials": "many"}, "trials: should be a valid integer"),
        ({"trials": True}, "trials: should be a valid integer"),
    ],
)
def test_settings_that_cannot_be_used_are_refused_with_the_reason(changes: dict[str, Any], message: str) -> None:
    """What, where, and what is allowed."""
    with pytest.raises(StudyError) as refused:
        load_study("three-link-coast", changes)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_specification_survives_the_study_db(store: Store) -> None:
    """What comes back from the DB is what was put in: a study needs none of its files any more."""
    spec = load_study(
        "three-link-coast",
        {"search.low": {"gravity_1": 0.7}, "episode.pushes": [[0.0, 0.1, 0.2]], "search.coordinates": "plain"},
    )
    create_study(store, spec, "study")
    assert StudySpec.model_validate_json(store.spec("study")) == spec
