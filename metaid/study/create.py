"""A study put into a DB, read back from it, and deleted."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from metaid.errors import StorageError, StudyError
from metaid.search import SAMPLERS
from metaid.store import SPEC_KEY, Store, refuse_if_run
from metaid.study.loading import problem_of
from metaid.study.spec import StudySpec

if TYPE_CHECKING:
    import optuna


def create_study(store: Store, spec: StudySpec, name: str | None = None) -> str:
    """Puts a study without trials into the DB and returns its name.  Raises StorageError if the name is taken.

    A rig is pushed, to find what pushes it needs and what they do.  Raises LostPlant where it does not answer.
    """
    refuse_what_cannot_be_run(spec)
    problem = problem_of(spec)
    name = spec.name if name is None else name
    if not name or len(name) > 200 or not name.isprintable():
        raise StudyError("a study's name has 1 to 200 printable characters")
    if name in store.names():
        allowed = _other_sampler(stored_spec(store, name), spec, name) or "choose another with --name, or delete it"
        raise StorageError(f"{store.url} has a study '{name}' already ({allowed})")
    if not problem.spec.is_simulated:
        spec = problem.calibrated()
        refuse_what_cannot_be_run(spec)
    store.create(name, spec.model_dump_json(), len(spec.joints))
    return name


def ensure_study(store: Store, spec: StudySpec, name: str | None = None) -> str:
    """Creates the study unless the DB has it, made from the same settings; returns its name.  Raises StorageError if
    from others.
    """
    name = spec.name if name is None else name
    if name not in store.names():
        return create_study(store, spec, name)
    stored = stored_spec(store, name).model_copy(update={"pushed": None})
    if stored != spec:
        allowed = _other_sampler(stored, spec, name) or "choose another name, or delete it"
        raise StorageError(f"{store.url} has a study '{name}' made from other settings ({allowed})")
    return name


def _other_sampler(stored: StudySpec, wanted: StudySpec, name: str) -> str | None:
    """How to go on with the sampler of the `wanted` study where the `stored` one has another; None where it has not."""
    old, new = stored.study.sampler, wanted.study.sampler
    if old == new:
        return None
    return (
        f"its sampler is {old}, which cannot change; go on with {new} in a new study that starts from what this one "
        f"found: --name {name}-{new} --from {name}, in Python name= and start_from="
    )


def refuse_what_cannot_be_run(spec: StudySpec) -> None:
    """Raises StudyError where no sampler can search as these settings say."""
    problem_of(spec).make_searcher()


def advice(spec: StudySpec) -> str | None:
    """What to think over before the study is run, in one line; None if nothing."""
    sampler, trials = spec.study.sampler, spec.study.trials
    advised = SAMPLERS[sampler].advised_trials
    if advised is None or trials <= advised:
        return None
    return (
        f"{trials} trials with {sampler}: each takes longer than the one before "
        f"(advised: at most {advised} with {sampler}, or sampler = 'cmaes')"
    )


def question(spec: StudySpec) -> str | None:
    """What to ask about the units of the study's plant or nominal model, in one line; None if nothing."""
    return problem_of(spec).question


def stored_spec(store: Store, name: str) -> StudySpec:
    """The settings that a study in the DB was made from.  Raises StorageError."""
    return _read(store.spec(name), f"{store.url}: study '{name}'")


def optuna_spec(study: optuna.Study) -> StudySpec | None:
    """The settings that the trials of an Optuna study are evaluated with by `metaid.objective`, in whatever storage it
    is; None where it has none yet.  Raises StorageError.
    """
    settings = study.user_attrs.get(SPEC_KEY)
    return None if settings is None else _read(json.dumps(settings), f"the Optuna study '{study.study_name}'")


def _read(settings: str, study: str) -> StudySpec:
    """The settings (JSON) of a study, as messages call it."""
    try:
        return StudySpec.model_validate_json(settings)
    except ValueError:
        raise StorageError(f"{study} was made by another version of metaid") from None


def delete_study(store: Store, name: str) -> None:
    """Deletes a study and its trials from the DB.  Raises StorageError if it is not there, or is being run."""
    store.delete(name, lambda connection, study_id: refuse_if_run(connection, study_id, name))
