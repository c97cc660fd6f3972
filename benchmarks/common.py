"""What the benchmarks share: the problems that they measure, interleaved timing, a command line, markdown tables."""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from metaid.files import shipped_folder
from metaid.plant import LinkSettings, read_plant
from metaid.store import Store
from metaid.study import EpisodeSettings, SearchSettings, StudySettings, StudySpec, create_study

PLANTS = {1: "one-link", 2: "two-link", 3: "three-link", 5: "five-link", 10: "ten-link"}
STEPS = 5000  # of a whole episode, over its 2 pushes per link
PEAK_SPEED = 1.0  # rad/s of the fastest link after a push
START = 1.3  # factor of the nominal lumps, to search from
NEEDS_MORE = 77  # exit status of a benchmark that needs what is not installed, as of a test that automake skips
NO_LIMIT = 1000.0  # rad: nothing falls, so that all episodes are of the same length
Row = dict[str, Any]
Run = TypeVar("Run", bound="Resumable")


def two_digits(value: float) -> str:
    """A number of two digits, and no power of ten of a large one: 410, where :.2g has 4.1e+02."""
    return f"{float(f'{value:.2g}'):g}"


def make_spec(nlink: int, steps: int = STEPS, trials: int = 100, sampler: str = "cmaes") -> StudySpec:
    """A study of the shipped chain of `nlink` links in plain coordinates, `steps` in an episode of 2 rich pushes each.

    The nominal model is wrong by up to 20 % in masses and inertias and 10 % in centres of mass, always the same.
    """
    plant = read_plant(shipped_folder("plants") / f"{PLANTS[nlink]}.toml")
    random = np.random.default_rng(nlink)

    def wrong(link: LinkSettings) -> LinkSettings:
        mass, com, inertia = random.uniform([0.8, 0.9, 0.8], [1.2, 1.1, 1.2]).tolist()
        assert link.com is not None, "the shipped plants give all numbers"
        assert link.inertia is not None, "the shipped plants give all numbers"
        changes = {"mass": link.mass * mass, "com": min(link.com * com, link.length), "inertia": link.inertia * inertia}
        return link.model_copy(update=changes)

    episode = EpisodeSettings(steps=max(steps // (2 * nlink), 2), peak_speed=PEAK_SPEED, fall_limit=NO_LIMIT)
    search = SearchSettings(coordinates="plain", start=START)
    name = PLANTS[nlink]
    study = StudySettings(
        plant=name, nominal=name, sampler=sampler, trials=trials, seed=1, search=search, episode=episode
    )
    nominal = tuple(wrong(link) for link in plant.links)
    return StudySpec(name=name, plant_name=name, plant=plant, nominal=nominal, study=study)


@contextmanager
def made(spec: StudySpec) -> Iterator[tuple[Store, str]]:
    """A study made from `spec` in a new SQLite DB, which is deleted afterwards."""
    with tempfile.TemporaryDirectory() as folder, closing(Store(f"{folder}/metaid.db", create=True)) as store:
        yield store, create_study(store, spec)


class Resumable(Protocol):
    """A row of results that is one run's: a dataclass whose fields are numbers and words."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sampler(self) -> str: ...

    @property
    def links(self) -> int: ...

    @property
    def seed(self) -> int: ...


def resumed(
    kind: Callable[..., Run],
    wanted: Sequence[tuple[str, int, int]],
    measure: Callable[[str, int, int], Run],
    describe: Callable[[Run], str],
    results: Path | None,
) -> list[Run]:
    """The rows of all `wanted` runs, with a line on stderr for each that is measured.

    Args:
        kind: makes a row of its fields.
        wanted: sampler, number of links and seed of each run.
        measure: does one run.
        describe: what it found, for the line.
        results: a file of finished runs, one JSON object a line: what is in it is not run again, what is run is added.
    """
    done = finished(kind, results)
    for number, key in enumerate(wanted, 1):
        if key in done:
            continue
        done[key] = row = measure(*key)
        print(f"{number}/{len(wanted)} {key}: {describe(row)}", file=sys.stderr, flush=True)
        keep(row, results)
    return [done[key] for key in wanted]


def finished(kind: Callable[..., Run], results: Path | None) -> dict[tuple[str, int, int], Run]:
    """The rows of a file of `results`, if there is one, by sampler, number of links and seed; `kind` makes a row."""
    if results is None or not results.exists():
        return {}
    rows = (kind(**json.loads(line)) for line in results.read_text().splitlines())
    return {(row.sampler, row.links, row.seed): row for row in rows}


def keep(row: Resumable, results: Path | None) -> None:
    """Adds a row to a file of `results`, if there is to be one."""
    if results is not None:
        with results.open("a") as file:
            file.write(json.dumps(asdict(row)) + "\n")


def seconds(work: Callable[[], object]) -> float:
    """How long `work` takes by the clock."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def interleaved(
    works: Mapping[str, Callable[[], object]], repeats: int, chosen: Callable[[list[float]], float] = statistics.median
) -> dict[str, float]:
    """Median seconds of each of `works`, or what else is `chosen` of all, which take turns, so that what slows the
    machine slows them all alike.
    """
    taken: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            taken[name].append(seconds(work))
    return {name: chosen(times) for name, times in taken.items()}


def table(rows: Sequence[Row]) -> str:
    """Rows with the same keys as a markdown table."""
    cells = [list(rows[0]), *([_figure(value) for value in row.values()] for row in rows)]
    head, *others = (f"| {' | '.join(each)} |" for each in cells)
    return "\n".join([head, "|" + "---|" * len(rows[0]), *others])


def _figure(value: Any) -> str:
    if value is None:
        return "–"
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int) else str(value)
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"


def machine() -> Row:
    """What the figures were measured on."""
    names = [line.partition(":")[2].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    packages = ("mujoco-core", "numba", "numpy", "optuna", "cmaes", "ray", "sqlalchemy")
    return {
        "processor": f"{names[0] if names else platform.processor() or platform.machine()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": ", ".join(f"{name} {version(name)}" for name in packages),
        "load before": round(os.getloadavg()[0], 2),
    }


def _lines(path: str) -> list[str]:
    return Path(path).read_text().splitlines() if Path(path).exists() else []


def run_alone(name: str, measure: Callable[[bool], dict[str, list[Row]]]) -> None:
    """The command line of one benchmark: `--quick` measures less, `--json` prints JSON and not tables."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and sizes: to see that it works")
    arguments = parser.parse_args()
    found = measure(arguments.quick)
    if arguments.json:
        print(json.dumps({"machine": machine(), **found}, indent=2, ensure_ascii=False))
    else:
        print("\n\n".join(f"{title}\n\n{table(rows)}" for title, rows in found.items()))
