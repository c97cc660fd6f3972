"""Studies in Python: to run them, and to read what a DB has of them. Storage is a URL or a file's path; default
METAID_STORAGE, else metaid.db.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from metaid import results
from metaid.api.episodes import spec_of
from metaid.exporting import IdentifiedModel
from metaid.results import (
    PUSHES,
    Comparison,
    Findings,
    Validation,
    identified_model,
    read_findings,
    read_snapshot,
    started_from,
)
from metaid.store import DEFAULT_STORAGE, Store
from metaid.study import OptunaObjective, Progress, StudySpec, ensure_study, run_study, stored_spec
from metaid.study import check as checked

if TYPE_CHECKING:
    import optuna


def _opened(storage: str | None, create: bool = False) -> closing[Store]:
    """The DB, that of METAID_STORAGE or metaid.db here where none is named, closed afterwards."""
    return closing(Store(storage or os.environ.get("METAID_STORAGE") or DEFAULT_STORAGE, create))


def run(
    study: str | Path | StudySpec,
    name: str | None = None,
    storage: str | None = None,
    trials: int | None = None,
    workers: int | None = None,
    engine: str = "local",
    ray_address: str | None = None,
    watch: Callable[[Progress], None] = lambda progress: None,
    patience: float | None = None,
    start_from: str | None = None,
    until: float | None = None,
) -> pd.DataFrame:
    """Creates the study in the DB unless it is there, and runs it up to its number of trials.

    Args:
        study: a shipped name, the path of a study file, or settings.
        name: of the study in the DB; default: the file's.
        storage: a URL or the path of an SQLite file; default: METAID_STORAGE, else metaid.db.
        trials: in all, those in the DB included; default: the study's.
        workers: that evaluate; default: the study's.
        engine: "local", for threads of this process, or "ray".
        ray_address: of a running Ray cluster; default: one on this machine.
        watch: called with the progress after each generation.
        patience: s after which a silent Ray worker or DB server is given up; default: 120 and 300.
        start_from: name of a study in the DB; what it identified is the nominal model of this one.
        until: a share; the run ends once all lumps at once are known to it with 95 % (with `output-error`).

    Returns:
        The study's lumps, as `lumps` has them.

    Raises:
        StorageError: a study of that name was made from other settings, or the DB cannot be used.
        StudyError: the study contradicts itself, or is to start from one that has identified nothing.
        WorkerError: workers were lost again and again.

    Example:
        >>> found = metaid.run("three-link-oscillation")
        >>> found.loc[:2, ["name", "nominal", "identified", "low", "high"]].round(4)
                name  nominal  identified    low   high
        0  gravity_1   0.9695       0.980  0.980  0.980
        1  gravity_2   0.5208       0.482  0.482  0.482
        2  gravity_3   0.1350       0.091  0.091  0.091
    """
    spec = spec_of(study)
    with _opened(storage, create=start_from is None) as store:
        if start_from is not None:
            spec = started_from(store, spec, start_from)
        name = ensure_study(store, spec, name)
        run_study(store, name, trials, workers, engine, ray_address, watch, patience, until)
        return results.lumps_frame(store, name)


def objective(study: str | Path | StudySpec, storage: str | None = None) -> OptunaObjective:
    """A study as a plain Optuna objective, for `optuna.Study.optimize` with any sampler and any pruner.

    Args:
        study: a shipped name, the path of a study file, or settings; with a `storage`, the name of a study in that DB.
        storage: a URL or the path of an SQLite file that has the study.

    Raises:
        StudyError: the study contradicts itself, or is of a rig and not in a DB.
        StorageError: the DB has no such study.

    Example:
        >>> tried = optuna.create_study()
        >>> tried.optimize(metaid.objective("one-link-count"), n_trials=3)
        >>> len(tried.trials)
        3
    """
    return OptunaObjective(_spec(study, storage))


def check(study: str | Path | StudySpec, storage: str | None = None, until: float | None = None) -> dict[str, Any]:
    """What a study can determine by its nominal model, before any trial: as `metaid study check --json` prints it.
    `study` and `storage` are those of `objective`; with `until`, a share, also what it takes until all is known to it.
    Raises StudyError where the study cannot be run, or not until then, and StorageError.

    Example:
        >>> [lump["name"] for lump in metaid.check("three-link")["lumps"] if not lump["determined"]]
        []
    """
    return checked(_spec(study, storage), until)


def _spec(study: str | Path | StudySpec, storage: str | None) -> StudySpec:
    """The settings of a study: of that name in the DB where there is a `storage`, else shipped, of a file, or given."""
    if storage is None or not isinstance(study, str | Path):
        return spec_of(study)
    with _opened(storage) as store:
        return stored_spec(store, str(study))


def trials(name: str, storage: str | None = None) -> pd.DataFrame:
    """Every trial of a study: state, value, generation, steps, periods per joint, factors by lump name.

    Example:
        >>> metaid.trials("three-link-oscillation")[["number", "state"]]
           number     state
        0       0  COMPLETE
        1       1  COMPLETE
        2       2  COMPLETE
    """
    with _opened(storage) as store:
        return results.trials_frame(store, name)


def lumps(name: str, storage: str | None = None) -> pd.DataFrame:
    """The lumps of a study: nominal, factor, identified, range at the minimum or 95 % interval, and truth and error
    where the plant knows them.

    Example:
        >>> bool(metaid.lumps("three-link-oscillation").error.abs().max() < 0.001)
        True
    """
    with _opened(storage) as store:
        return results.lumps_frame(store, name)


@dataclass(frozen=True)
class Study:
    """A study in the DB by its name, or one of Optuna that `objective` was optimized in."""

    name: str | optuna.Study
    storage: str | None = None

    @property
    def estimate(self) -> pd.DataFrame:
        """The lumps that all trials together say, whichever sampler proposed them: columns as `metaid.lumps` has them,
        `low` to `high` being the 95 % interval; NaN where the model does not explain what was seen.  Raises
        StorageError, and StudyError where no estimate can be made.
        """
        if not isinstance(self.name, str):
            return results.estimate_frame(results.snapshot_of(self.name))
        with _opened(self.storage) as store:
            return results.estimate_frame(read_snapshot(store, self.name))


def study(name: str | optuna.Study, storage: str | None = None) -> Study:
    """The study of that name, or an Optuna study that `objective` was optimized in: its `estimate`.

    Example:
        >>> metaid.study("three-link-oscillation").estimate.identified.round(3).tolist()
        [0.98, 0.482, 0.091, 0.217, 0.041, 0.035, 0.397, 0.161, 0.019]
    """
    return Study(name, storage)


def bodies(name: str, storage: str | None = None) -> pd.DataFrame:
    """What the estimate of a study says of each link: the least and the largest mass, centre of mass and inertia, and
    length where none is assumed, of all possible bodies whose lumps are within the ellipsoid of the 95 % intervals.
    Raises StorageError, and StudyError where no estimate found lumps.

    Example:
        >>> metaid.bodies("three-link-oscillation").head(3).round(2)
             name unit  nominal   low  high  bounded  true
        0  mass_1   kg     1.60  0.87   inf    False   1.3
        1  mass_2   kg     0.65  0.60  1.53     True   0.9
        2  mass_3   kg     0.90  0.43  1.08     True   0.7
    """
    with _opened(storage) as store:
        return results.bodies_table(read_snapshot(store, name))


def studies(storage: str | None = None) -> pd.DataFrame:
    """The studies of a DB, one row each.

    Example:
        >>> metaid.studies()[["name", "plant", "sampler"]]
                             name       plant       sampler
        0  three-link-oscillation  three-link  output-error
    """
    with _opened(storage) as store:
        return results.studies_frame(store)


def summary(name: str, storage: str | None = None) -> dict[str, Any]:
    """A study as `metaid study show --json` prints it.

    Example:
        >>> metaid.summary("three-link-oscillation")["verdict"]
        'found'
    """
    with _opened(storage) as store:
        return results.summary(store, name)


def compare(*names: str, storage: str | None = None) -> Comparison:
    """Studies of the same plant beside one another: `studies`, a frame of what each took, and `lumps`, one of what each
    found.  Raises StorageError, and StudyError where they are not of the same plant.

    Example:
        >>> once_more = metaid.run("three-link-oscillation", name="again")
        >>> compared = metaid.compare("three-link-oscillation", "again")
        >>> compared.studies[["name", "trials", "seconds"]]
                             name  trials  seconds
        0  three-link-oscillation       3     18.0
        1                   again       3     18.0
    """
    with _opened(storage) as store:
        return results.compare(store, names)


def validate(name: str, storage: str | None = None, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """Coasting and tracking with the identified lumps of a study, and with its nominal ones and the true ones beside;
    of an arm with its base parameters.

    Args:
        name: of the study.
        storage: of the DB.
        pushes: how many pushes, which the search never used.
        seed: of these pushes.

    Raises:
        StorageError: the DB has no such study.
        StudyError: no lump was found, or the plant is a rig.

    Example:
        >>> metaid.validate("three-link-oscillation", pushes=1)
        <Validation on three-link: pushes=1, nominal, identified, true>
    """
    with _opened(storage) as store:
        return results.validate(read_snapshot(store, name), pushes, seed)


def model(name: str, storage: str | None = None, even_if_not_found: bool = False) -> IdentifiedModel:
    """The identified model of a study: `torque(q, v)`, `mass_matrix(q)`, `lumps`; `write(path)` writes it as a plant
    file, MJCF, URDF, Python, C or JSON, by the ending of the path.

    Args:
        name: of the study.
        storage: of the DB.
        even_if_not_found: whether to take the last estimate, or the best trial, where the verdict is not `found`.

    Raises:
        StorageError: the DB has no such study.
        StudyError: the study has found no model.

    Example:
        >>> model = metaid.model("three-link-oscillation")
        >>> model.torque([0.1, 0.0, 0.0], [0.0, 0.0, 0.0]).round(3)
        array([-1.521, -0.561, -0.089])
        >>> model.mass_matrix(np.zeros((1000, 3))).shape
        (1000, 3, 3)
        >>> model.write("three-link.xml")
    """
    with _opened(storage) as store:
        return identified_model(read_snapshot(store, name), even_if_not_found)


def load_findings(name: str, storage: str | None = None) -> Findings:
    """All that a study knows, for `metaid.figures`.

    Example:
        >>> metaid.load_findings("three-link-oscillation")
        <Findings of three-link-oscillation: trials=3, found>
    """
    with _opened(storage) as store:
        return read_findings(store, name)
