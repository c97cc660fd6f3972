"""A run ends once all lumps at once are known as well as wanted, and what that takes is known beforehand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chain_studies import chain_study, random_chain
from click.testing import CliRunner
from pandas.testing import assert_frame_equal

from metaid import results
from metaid.cli import app
from metaid.cli.checks.until import describe_forecast, describe_reached
from metaid.errors import StudyError
from metaid.models import DEVIATIONS, deviations_at_once
from metaid.plant import FaultSettings
from metaid.store import Store
from metaid.study import (
    Forecast,
    Problem,
    StudySpec,
    create_study,
    forecast,
    refuse_until,
    run_study,
)
from metaid.study.reading import read_study
from metaid.study.settings import EstimateSettings

pytestmark = pytest.mark.slow

NOISE = {"angle_noise": 0.01, "speed_sensor": False, "push_noise": 0.1}
WANTED = 0.005  # reached after a few trials, not after the first


@pytest.fixture(scope="module")
def spec() -> StudySpec:
    """A study of a link with so much noise that a trial leaves intervals wide."""
    return chain_study(random_chain(1, 1), NOISE, trials=2, episode={"measure": "smoothed"})


@pytest.fixture(scope="module")
def store(spec: StudySpec, tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A DB with that study, run until all is WANTED, as `until`."""
    store = Store(str(tmp_path_factory.mktemp("until") / "metaid.db"), create=True)
    run_study(store, create_study(store, spec, "until"), until=WANTED)
    return store


def widest(store: Store, name: str) -> float:
    """Half the widest interval of those that hold all lumps of a study at once, as a share of its lump."""
    lumps = results.lumps_frame(store, name)
    at_once = deviations_at_once(len(lumps)) / DEVIATIONS
    return float(np.sinh(0.5 * at_once * np.log(lumps["high"] / lumps["low"])).max())


def test_run_ends_once_all_lumps_are_known_as_well(spec: StudySpec, store: Store) -> None:
    """And not before; its trials are the first of those of a run until they are narrower still."""
    create_study(store, spec, "longer")
    ended = store.count("until")
    assert ended > 2, "the study's own trials are not the limit"
    assert widest(store, "until") <= WANTED
    shown = results.summary(store, "until")
    assert shown["estimate"]["half_width"] == pytest.approx(widest(store, "until"))
    assert "reached, with 95 % all lumps at once are within" in describe_reached(shown, WANTED)
    assert "not reached, the least known lump is" in describe_reached(shown, 0.5 * widest(store, "until"))
    run_study(store, "longer", trials=ended - 1, until=0.1 * WANTED)
    assert widest(store, "longer") > WANTED
    run_study(store, "longer", trials=ended, until=0.1 * WANTED)
    tables = [results.trials_frame(store, name) for name in ("until", "longer")]
    assert_frame_equal(*tables, check_exact=True)


def test_stopped_run_goes_on_until_the_same(spec: StudySpec, store: Store) -> None:
    """However often it was stopped; one that is there already adds no trial."""
    create_study(store, spec, "stopped")
    whole = store.count("until")
    run_study(store, "stopped", trials=1, until=WANTED)
    assert run_study(store, "stopped", until=WANTED).trials == whole
    assert run_study(store, "stopped", until=WANTED).trials == whole
    assert run_study(store, "stopped", trials=1, until=2.0 * WANTED).trials == whole


def test_pushes_and_time_that_it_takes_are_foreseen(spec: StudySpec, store: Store) -> None:
    """By the nominal model; the plant takes at most half as many again."""
    problem, trials = Problem(spec), store.count("until")
    foreseen = forecast(problem, WANTED)
    assert foreseen.is_reached
    assert foreseen.half_width <= WANTED
    assert foreseen.trials / 3.0 <= trials <= 1.5 * foreseen.trials
    assert foreseen.pushes == foreseen.trials * len(problem.episode.pushes)
    assert foreseen.seconds == pytest.approx(foreseen.pushes * problem.episode.steps * problem.timestep, rel=0.2)


def test_nominal_model_explains_what_it_shows_itself() -> None:
    """Impulses that differ give it other speeds than they give the plant."""
    spec = chain_study(random_chain(3, 405), NOISE, trials=4, seed=405, episode={"measure": "smoothed"})
    foreseen = forecast(Problem(spec), 0.01)
    assert foreseen.is_reached
    assert foreseen.trials <= 4


def test_what_no_number_of_trials_reaches_is_said() -> None:
    """With how well the least known lump is known in the end, or that nothing was explained."""
    foreseen = Forecast(until=0.001, trials=32, pushes=64, seconds=120.0, half_width=0.004)
    assert not foreseen.is_reached
    said = describe_forecast(foreseen.row)
    head = "--until 0.001: not reached, for after 32 trials, 64 pushes, 2 min of motion the least known is known to"
    assert said.startswith(f"{head} 0.004 of it")
    assert "no estimate explains 32 trials" in describe_forecast(replace(foreseen, half_width=np.inf).row)


def test_searched_fault_is_not_told_beforehand(spec: StudySpec) -> None:
    """The nominal plant has none of those that are searched: a forecast is to know as little as its user."""
    late = spec.plant.model_copy(update={"faults": FaultSettings(delay=3, tilt=0.02, angle_noise=0.01)})
    study = spec.study.model_copy(update={"estimate": EstimateSettings(faults=("delay",))})
    nominal = Problem(spec.model_copy(update={"plant": late, "study": study})).robot.nominal_plant()
    assert nominal.settings.faults == FaultSettings(tilt=0.02, angle_noise=0.01)


@pytest.mark.parametrize(
    ("study", "until", "message"),
    [
        ("three-link", 0.01, "sampler 'cmaes' does not work by intervals .allowed: output-error"),
        ("three-link-oscillation", 0.5, "until is 50.000% .allowed: above 0 to 10%"),
    ],
)
def test_studies_without_such_intervals_are_refused(study: str, until: float, message: str) -> None:
    """In one line that says what is allowed."""
    with pytest.raises(StudyError, match=message):
        refuse_until(read_study(study), until)


def test_commands_say_what_it_takes_and_whether_it_was_reached(tmp_path: Path) -> None:
    """`check` beforehand, `run` at its end; and a share is one."""
    storage = str(tmp_path / "metaid.db")
    run = CliRunner().invoke
    checked = run(app, ["study", "check", "noisy-three-link", "--until", "0.5%"])
    assert "--until 0.005: if the nominal model were right, " in checked.output
    run(app, ["study", "create", "noisy-three-link", "--storage", storage])
    ran = run(app, ["study", "run", "noisy-three-link", "--storage", storage, "--until", "0.5%", "--quiet"])
    assert "--until 0.005: reached, with 95 % all lumps at once are within " in ran.output
    wrong = run(app, ["study", "check", "noisy-three-link", "--until", "much"])
    assert wrong.exit_code == 2
    assert "'much' is no share (allowed: above 0 to below 1, as 0.5% or 0.005)" in " ".join(wrong.output.split())
