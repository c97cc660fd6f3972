"""Bad input by the ten thousand: plant files, study files, arguments, factors and DBs that are wrong in every way.

A case is a family and a number; `python -m soak.inputs plants 1234` does one again and says what was handed in.
"""

from __future__ import annotations

import faulthandler
import json
import math
import os
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import chdir, closing, contextmanager
from pathlib import Path
from random import Random

import numpy as np

from metaid import api
from metaid.compiled import Objective
from metaid.episode import Episode, Outcome, run_stepwise, tip_push
from metaid.files import shipped_folder, shipped_names
from metaid.models import lump_names
from metaid.plant import ArmPlant, MujocoPlant, load_chain, load_plant, read_plant
from metaid.plant.description import draw_starts
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study
from soak import cases
from soak.arguments import arguments
from soak.common import SoakResult, soaked
from soak.judge import BrokenPromiseError, command, promised

SEED = 7
CASES = {"plants": 40_000, "arms": 2_000, "studies": 31_000, "factors": 22_000, "arguments": 4_000, "databases": 1_000}
LONGEST_EPISODE = 20_000  # steps of an accepted study that are run
PROCESSES = 2
ARM = b'mjcf = "arm.xml"\n'
UNSET = "DISPLAY", "WAYLAND_DISPLAY", "METAID_STORAGE"  # no window opens, no other DB is meant


class Workshop:
    """A `folder` with what cases are made from, and in which they are tried: a DB of two small studies, shipped files,
    objectives.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plants, self.studies = (
            [(shipped_folder(kind) / f"{name}.toml").read_bytes() for name in shipped_names(kind) if "ten-" not in name]
            for kind in ("plants", "studies")
        )
        self.arms = [path.read_bytes() for path in sorted((shipped_folder("plants") / "arms").glob("*.xml"))]
        self.names = ("small", "plain")
        self.template = folder / "template.db"
        with closing(Store(str(self.template), create=True)) as store:
            for name, source, trials in (("small", "two-link-tpe", 12), ("plain", "one-link-count", 12)):
                create_study(store, load_study(source, {"trials": trials, "workers": 1, "seed": 3}), name)
                run_study(store, name, 8)
        with closing(sqlite3.connect(self.template)) as connection:
            connection.execute("PRAGMA journal_mode=DELETE")  # one file, so that a copy is whole
        shutil.copy(self.template, folder / "used.db")
        self.objectives = [self._objective(name) for name in ("one-link", "two-link", "three-link")]

    @staticmethod
    def _objective(name: str) -> Objective:
        plant = load_chain(name)
        return Objective(plant, plant.chain.lumps, Episode(tip_push(plant, 1.0), 300), "spectral")


@contextmanager
def workshop() -> Iterator[Workshop]:
    """A workshop in a folder of its own, which is the current one meanwhile: nothing is left of it."""
    before = {name: os.environ.pop(name) for name in UNSET if name in os.environ}
    try:
        with tempfile.TemporaryDirectory(prefix="metaid-inputs-") as folder, chdir(folder):
            yield Workshop(Path(folder))
    finally:
        os.environ.update(before)


def plants(random: Random, shop: Workshop) -> None:
    """A plant file is refused or shown; an accepted one moves, by finite numbers or in a fall."""
    Path("plant.toml").write_bytes(cases.toml(random, shop.plants))
    if random.random() < 0.3:
        command(["plant", "show", "plant.toml", *random.choice(([], ["--json"]))])
        return
    with promised():
        plant = MujocoPlant("plant", read_plant(Path("plant.toml")))
        record, trajectory = run_stepwise(plant, plant.chain.lumps, Episode(tip_push(plant, 0.1), 5))
        if record.fall_step is None and not np.isfinite(trajectory.speeds).all():
            raise BrokenPromiseError("a state that is not finite, and no fall")


def arms(random: Random, shop: Workshop) -> None:
    """An arm's plant file and its MJCF are refused or shown; an accepted arm moves from a start by finite numbers."""
    Path("arm.xml").write_bytes(cases.xml(random, shop.arms))
    Path("arm.toml").write_bytes(cases.toml(random, [ARM]) if random.random() < 0.2 else ARM)
    if random.random() < 0.1:
        command(["plant", "show", "arm.toml", *random.choice(([], ["--json"]))])
        return
    with promised():
        plant = load_plant("./arm.toml")
        if isinstance(plant, ArmPlant):
            (start,) = draw_starts(plant, 1, 0.3, 1)
            plant.push(start)
            plant.step()
            if not np.isfinite([start.pose, start.speeds, *plant.states()]).all():
                raise BrokenPromiseError(f"a state that is not finite: {plant.states()}")


def studies(random: Random, shop: Workshop) -> None:
    """A study file is refused, or is a problem whose candidates have finite measures."""
    Path("plant.toml").write_bytes(random.choice(shop.plants))
    Path("study.toml").write_bytes(cases.toml(random, shop.studies))
    if random.random() < 0.02:
        whole(["study", "create", "study.toml", "--storage", "used.db", "--name", f"made-{random.random()}"])
        return
    with promised():
        problem = Problem(load_study("study.toml"))
        batch = problem.make_searcher().ask()
        if not np.isfinite(batch).all():
            raise BrokenPromiseError("candidates that are not finite")
        if problem.episode.total_steps <= LONGEST_EPISODE and random.random() < 0.02:
            _finite(problem.make_objective().evaluate(batch[0]))


def factors(random: Random, shop: Workshop) -> None:
    """Factors are refused, or the outcome's numbers are finite."""
    objective = random.choice(shop.objectives)
    names = lump_names(objective.nominal.nlink)
    given = cases.factors(random, len(names))
    if random.random() < 0.1 and isinstance(given, list):
        with promised():
            named = dict(zip([*names, "gravity_9", ""], given, strict=False))
            shown = api.perturb(objective.plant.name, named, random.choice((0, -1, 50)))
            json.dumps(shown, allow_nan=False)
        return
    with promised():
        _finite(objective.evaluate(given))


def _finite(outcome: Outcome) -> None:
    if not (math.isfinite(outcome.value) and outcome.value >= 0.0 and outcome.steps >= 1):
        raise BrokenPromiseError(f"accepted as an outcome: {outcome}")


def some_arguments(random: Random, shop: Workshop) -> None:
    """A command line is refused or does what it says; the DB is whole before and after."""
    if random.random() < 0.01:
        shutil.copy(shop.template, "used.db")
    whole(arguments(random, shop.names, "used.db"))


def databases(random: Random, shop: Workshop) -> None:
    """A spoiled DB is refused or read; what is not whole is not made less so by going on."""
    path = Path("spoiled.db")
    for left in Path().glob("spoiled.db*"):
        left.unlink()
    shutil.copy(shop.template, path)
    by_bytes = random.random() < 0.4
    (cases.spoil_bytes if by_bytes else cases.spoil_rows)(random, path)
    name = random.choice(shop.names)
    asked = random.choice((["list"], ["show", name, "--json"], ["show", name], ["export", name, "-o", "trials.csv"]))
    told = command(["study", *asked, "--storage", str(path)])
    if asked[0] == "export" and told.status == 0:
        _no_nan(Path("trials.csv"))
    if random.random() < 0.3:
        command(["study", "run", name, "--storage", str(path), "--trials", "10", "--workers", "1", "--quiet"])
        if not by_bytes:
            _whole_db(path)


def _no_nan(path: Path) -> None:
    for line in path.read_text().splitlines()[1:]:
        for cell in line.split(","):
            if cell not in ("COMPLETE", "PRUNED") and not math.isfinite(float(cell)):
                raise BrokenPromiseError(f"{cell!r} in a table")


def whole(words: list[str]) -> None:
    """Runs a command; afterwards the DB is sound, and a command that was refused has left no file."""
    before = _files()
    told = command(words)
    _whole_db(Path("used.db"))
    if told.status == 2 and (left := _files() - before):
        raise BrokenPromiseError(f"refused, and yet left {left}")


def _files() -> set[str]:
    return {name for name in os.listdir() if not name.endswith(("-wal", "-shm"))}


def _whole_db(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        if (found := connection.execute("PRAGMA integrity_check").fetchone()) != ("ok",):
            raise BrokenPromiseError(f"the DB is not whole: {found}")
        incomplete = connection.execute(
            "SELECT count(*) FROM studies WHERE study_id NOT IN (SELECT study_id FROM study_directions)"
            " OR study_id NOT IN (SELECT study_id FROM study_user_attributes)"
        ).fetchone()
        if path.name == "used.db" and incomplete != (0,):
            raise BrokenPromiseError("a study that is half there")
        if connection.execute("SELECT count(*) FROM trials WHERE state = 'RUNNING'").fetchone() != (0,):
            raise BrokenPromiseError("a trial left RUNNING")


FAMILIES: dict[str, Callable[[Random, Workshop], None]] = {
    "plants": plants,
    "arms": arms,
    "studies": studies,
    "factors": factors,
    "arguments": some_arguments,
    "databases": databases,
}


def check(shop: Workshop, family: str, numbers: Iterable[int]) -> list[str]:
    """Tries cases by their numbers; returns a line for each broken promise, with what does it again."""
    broken = []
    for number in numbers:
        try:
            FAMILIES[family](Random(f"{SEED} {family} {number}"), shop)
        except BrokenPromiseError as found:
            broken.append(f"python -m soak.inputs {family} {number}: {found}")
    return broken


def _share(family: str, numbers: range) -> tuple[int, list[str]]:
    faulthandler.dump_traceback_later(1200, exit=True)  # a hang in compiled code, which no exception ends
    with workshop() as shop:
        return len(numbers), check(shop, family, numbers)


def run(scale: float) -> list[SoakResult]:
    """A result for each family, its cases shared among processes."""
    return [_family(family, max(round(scale * count), PROCESSES)) for family, count in CASES.items()]


def _family(family: str, count: int) -> SoakResult:
    def work() -> tuple[int, Sequence[str]]:
        with ProcessPoolExecutor(PROCESSES) as pool:
            shares = list(
                pool.map(_share, [family] * PROCESSES, [range(i, count, PROCESSES) for i in range(PROCESSES)])
            )
        return sum(done for done, _ in shares), [line for _, lines in shares for line in lines]

    return soaked(f"bad input: {family}", count, work)


if __name__ == "__main__":
    with workshop() as told:
        print("\n".join(check(told, sys.argv[1], map(int, sys.argv[2:]))) or "every promise was kept")
