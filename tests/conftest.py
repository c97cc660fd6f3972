"""Chains to identify, random but repeatable, and the command line in-process."""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import optuna
import pytest
from browser import Browser, open_browser
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from places import ROOT
from postgres import Postgres, run_postgres
from rig import Serve, serving

from metaid.cli import main
from metaid.models import Array, Chain, Lumps
from metaid.plant import FaultSettings, LinkSettings, MujocoPlant, PlantSettings
from metaid.results import identified_factors, read_snapshot
from metaid.store import Store
from metaid.study import Problem, StudySpec

LONG_SET_UP = ("test_wheel.py", "test_workers.py")  # what is made for them takes longer than their tests


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests with a long set-up come first: at the end of a run a worker would have nothing to do meanwhile. Then those
    of arms, all in the part that one worker begins with: what is compiled for arms takes minutes, and is kept for the
    others.
    """
    items.sort(key=lambda item: (item.path.name not in LONG_SET_UP, "arm" not in item.path.name))


def pytest_collection_finish() -> None:
    """All that is imported and collected stays to the end of the run: no garbage is looked for in it."""
    gc.collect()
    gc.freeze()


def random_links(nlink: int, seed: int) -> tuple[LinkSettings, ...]:
    """Links with lengths, masses, centres of mass and inertias all different."""
    random = np.random.default_rng(seed)
    links = []
    for length in random.uniform(0.3, 0.5, nlink).tolist():
        mass = float(random.uniform(0.5, 1.5))
        inertia = mass * length**2 / 12 * float(random.uniform(0.7, 1.5))
        links.append(
            LinkSettings(length=length, mass=mass, com=length * float(random.uniform(0.3, 0.7)), inertia=inertia)
        )
    return tuple(links)


def rubbing_plant(nlink: int, damping: float = 0.03, frictionloss: float = 0.0, timestep: float = 0.002) -> MujocoPlant:
    """A heterogeneous chain with friction that differs from joint to joint."""
    links = tuple(
        link.model_copy(update={"damping": damping * (1 + i / 2), "frictionloss": frictionloss * (1 + i / 2)})
        for i, link in enumerate(random_links(nlink, 1))
    )
    return MujocoPlant("rubbing", PlantSettings(links=links, timestep=timestep))


def random_plant(nlink: int, seed: int = 1) -> MujocoPlant:
    """A heterogeneous chain."""
    return MujocoPlant(f"random-{nlink}", PlantSettings(links=random_links(nlink, seed)))


def wrong_chain(chain: Chain, seed: int) -> Chain:
    """A chain that another is believed to be: masses, lengths and the rest wrong by up to 30 %."""
    random = np.random.default_rng(seed)
    wrong = {key: getattr(chain, key) * random.uniform(0.7, 1.3, chain.nlink) for key in ("mass", "length", "inertia")}
    com = np.minimum(chain.com * random.uniform(0.85, 1.15, chain.nlink), wrong["length"])
    return replace(chain, **wrong, com=com)


def matching_spec(noisy: bool) -> StudySpec:
    """A study of two links by output-error that takes four trials, on an ideal or on a noisy plant."""
    from metaid.study import load_study

    if noisy:
        spec = load_study("two-link-tpe", {"sampler": "output-error", "trials": 4, "episode.measure": "smoothed"})
        faults = FaultSettings(angle_noise=1e-3, speed_sensor=False, push_noise=0.02)
        assert isinstance(spec.plant, PlantSettings)
        return spec.model_copy(update={"plant": spec.plant.model_copy(update={"faults": faults})})
    return load_study("two-link-tpe", {"sampler": "output-error", "trials": 8, "search.probes": 3})


def law_of(problem: Problem, factors: Array) -> Lumps:
    """The law whose lumps are `factors` (nlump) of a study's nominal ones; nothing is known of inertia."""
    return problem.robot.law_at(dict(zip(problem.names, (problem.robot.lumps.vector * factors).tolist(), strict=True)))


def what_is_known(store: Store, name: str) -> tuple[str, ...]:
    """All of a study's trials, with what they showed, and its lumps with their intervals, to the last bit."""
    from metaid import results

    shown = [trial.user_attrs for trial in optuna.load_study(study_name=name, storage=store.optuna).trials]
    return results.trials_frame(store, name).to_csv(), results.lumps_frame(store, name).to_csv(), str(shown)


def of_everyone(factory: pytest.TempPathFactory) -> Path:
    """The folder of all workers of the run."""
    base = factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Of all processes that ask for this `path` one goes on, and the others wait."""
    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Of the run's workers the first that calls one of metaid's loops compiles it. The others wait, and then have its
    machine code from the disk. Who calls whom has no circle, so nobody waits for ever.
    """
    folder, compile_now = of_everyone(tmp_path_factory), Dispatcher.compile

    def compile_alone(self: Any, signature: Any) -> Any:
        name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        if not name.startswith("metaid."):
            return compile_now(self, signature)
        with global_compiler_lock, locked(folder / f"{name}.lock"):
            return compile_now(self, signature)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "compile", compile_alone)
        yield


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """The folder `name`, filled by `make`: by the first of the run's workers that asks for it, while the others wait.
    It is not to be changed.
    """
    everyones = of_everyone(factory)
    folder, made = everyones / name, everyones / f"{name}.made"
    with locked(everyones / f"{name}.lock"):
        if not made.exists():
            shutil.rmtree(folder, ignore_errors=True)  # of a worker that was ended while it made it
            folder.mkdir()
            make(folder)
            made.touch()
    return folder


def best_error(store: Store, name: str) -> float:
    """The largest error of a lump by the best trial, whatever an estimate says beside it."""
    snapshot = read_snapshot(store, name)
    problem, truth = snapshot.problem, snapshot.problem.open_plant().true_lumps()
    assert truth is not None
    factors = np.array([trial.factors for trial in snapshot.survivors])
    values = np.array([trial.outcome.value for trial in snapshot.survivors])
    found = identified_factors(problem, factors, values) * problem.robot.lumps.vector
    return float(np.abs(found / truth.vector_of(problem.robot.lumps.searched) - 1.0).max())


class Finished(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str

    @property
    def verdict(self) -> list[str]:
        """The lines of the verdict, which ends what is printed: the first reason beside its word, and the others."""
        lines = self.out.splitlines()
        first = max(i for i, line in enumerate(lines) if not line.startswith("- "))
        return [lines[first], *(line.removeprefix("- ") for line in lines[first + 1 :])]


@pytest.fixture
def metaid(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Finished]:
    """Runs a command of the command line in an empty folder of its own. No line of what is printed ends in a space."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("METAID_STORAGE", raising=False)

    def run(*arguments: str) -> Finished:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        captured = capsys.readouterr()
        ended = [line for line in (captured.out + captured.err).split("\n") if line.endswith((" ", "\t"))]
        assert not ended, f"metaid {' '.join(arguments)} leaves spaces at the end of {ended[0]!r}"
        return Finished(int(stop.value.code or 0), captured.out, captured.err)

    return run


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures of a study are of few candidates along a line and over a plane: for tests of what there is on a page."""
    monkeypatch.setattr("metaid.show.figures.gallery.SWEPT", 7)
    monkeypatch.setattr("metaid.show.figures.gallery.GRID", 6)


@pytest.fixture(scope="session")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB of real runs, not to be changed: `plain` (three links, some falls), `boundary` (two links, half of them
    falls) and `counted` (one link, whole periods).
    """
    from metaid.study import load_study

    def make(folder: Path) -> None:
        made: dict[str, tuple[str, dict[str, object]]] = {
            "plain": (
                "three-link-coast",
                {"search.coordinates": "plain", "search.start": 1.4, "episode.fall_limit": 1.1, "trials": 800},
            ),
            "boundary": (
                "two-link-tpe",
                {"sampler": "random", "search.coordinates": "plain", "episode.measure": "crossing", "trials": 150},
            ),
            "counted": ("one-link-count", {}),
        }
        run_all(folder / "studied.db", {name: load_study(*asked) for name, asked in made.items()})

    return made_once(tmp_path_factory, "studied", make) / "studied.db"


@pytest.fixture(scope="session")
def estimated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB of real runs, not to be changed: `matched` (three links by output-error), `searched` (the same by cmaes),
    `hidden` and `hidden-searched`, likewise of a plant with friction that the model has not, and `noisy`, of a noisy
    plant.
    """
    from metaid.plant import PlantSettings
    from metaid.study import load_study

    def make(folder: Path) -> None:
        matched, searched = {"sampler": "output-error", "trials": 4}, {"sampler": "cmaes", "trials": 40}
        specs = {}
        for name, changes in (("matched", matched), ("searched", searched)):
            spec = specs[name] = load_study("three-link-coast", changes)
            assert isinstance(spec.plant, PlantSettings)
            links = tuple(link.model_copy(update={"damping": 0.05}) for link in spec.plant.links)
            rubbing = spec.model_copy(update={"plant": spec.plant.model_copy(update={"links": links})})
            specs["hidden" if name == "matched" else "hidden-searched"] = rubbing
        specs["noisy"] = load_study("noisy-three-link", {"trials": 2})
        run_all(folder / "estimated.db", specs)

    return made_once(tmp_path_factory, "estimated", make) / "estimated.db"


def run_all(path: Path, specs: Mapping[str, StudySpec]) -> None:
    """Makes a DB with these studies, all of them run."""
    from metaid.study import create_study, run_study

    store = Store(str(path), create=True)
    for name, spec in specs.items():
        create_study(store, spec, name)
        run_study(store, name)
    store.close()


@pytest.fixture(scope="session")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB of real runs, not to be changed: `exact` and `noisy`, the same arm with a tenth of a milliradian of noise;
    `bent`, whose nominal arm has another shape.
    """
    from arm_studies import make_arm_studies

    return made_once(tmp_path_factory, "arms", make_arm_studies) / "arms.db"


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One Chromium for all tests of a process."""
    with open_browser(tmp_path_factory.mktemp("chromium") / "profile") as running:
        yield running


@pytest.fixture
def browser(chromium: Browser) -> Browser:
    """Chromium without a page."""
    chromium.forget()
    return chromium


@pytest.fixture(scope="session")
def server() -> Iterator[Postgres]:
    """One PostgreSQL server for all tests of a process."""
    with run_postgres() as running:
        yield running


@pytest.fixture(scope="session")
def site() -> Path:
    """The site as `make docs` left it. Without one the test is skipped, or fails where it must not be
    (METAID_SITE=required, which .ci/run sets).
    """
    folder = ROOT / "build" / "site"
    if not (folder / "index.html").exists():
        (pytest.fail if os.environ.get("METAID_SITE") == "required" else pytest.skip)("needs the site: make docs")
    return folder


@pytest.fixture
def url(server: Postgres) -> str:
    """The URL of an empty database on it."""
    return server.new_database()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts the example rig with more arguments; ends it afterwards."""
    with serving(tmp_path) as start:
        yield start
