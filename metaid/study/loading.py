"""Studies by name, by path, or by the text that a DB has of them; and what follows from each, made once."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

from metaid.models.tree import Tree
from metaid.plant import LinkSettings
from metaid.study.problem import Problem
from metaid.study.reading import read_study
from metaid.study.spec import StudySpec

_latest: deque[Problem] = deque(maxlen=4)  # so that a command makes what follows from a study once


def problem_of(spec: StudySpec) -> Problem:
    """What follows from a study's settings. It is made once: settings that were asked about before have the same one,
    which is not to be changed.

    Raises StudyError where the settings contradict each other.
    """
    known = next((each for each in tuple(_latest) if each.spec == spec), None)
    if known is None:
        known = Problem(spec)
        _latest.append(known)
    return known


def load_study(name: str | Path, changes: dict[str, Any] | None = None) -> StudySpec:
    """The shipped study of that name, or the study file at that path, with `changes` by dotted key, which can be run.
    Raises StudyError, PlantError.

    Example:
        >>> metaid.load_study("three-link", {"trials": 6})
        <StudySpec three-link: plant noisy-three-link, cmaes, trials=6>
    """
    spec = read_study(name, changes)
    problem_of(spec).check()
    return spec


def with_nominal(spec: StudySpec, nominal: tuple[LinkSettings, ...] | Tree) -> StudySpec:
    """A study whose nominal model is this one: the links of a chain, or an arm.  Raises StudyError where that is no
    model of the study's plant.
    """
    changed = spec.with_nominal(nominal)
    problem_of(changed).check()
    return changed
