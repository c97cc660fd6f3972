"""Factors that a study file gives: one number for all, or a table by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.errors import EpisodeError, StudyError, unknown
from metaid.models import Array, factors_from_names
from metaid.study.settings import Factors, SearchSettings


def parameter_factors(key: str, given: Factors, names: Sequence[str]) -> Array:
    """What `[search]` gives under a `key` for the parameters of these `names` (nsearched).  Raises StudyError."""
    if not isinstance(given, dict):
        return np.full(len(names), given)
    for name in given:
        if name not in names:
            raise StudyError(f"search: {key}: {unknown('parameter', name, names)}")
    return np.array([given.get(name, SearchSettings.model_fields[key].default) for name in names])


def lump_factors(key: str, given: Factors, nlink: int, search: SearchSettings, stage: int) -> Array:
    """What `[search]` gives for the lumps of a stage (nsearched).

    Args:
        key: "start", "low" or "high".
        given: its value; a table may name lumps of both stages.
        nlink: the number of links.
        search: the table itself.
        stage: 1, or 2 for the inertia lumps.

    Raises:
        StudyError: a lump is not known.
    """
    default = SearchSettings.model_fields[key].default
    one, table = (default, given) if isinstance(given, dict) else (given, {})
    try:
        factors = factors_from_names(table, nlink, one, (*search.lumps, "inertia"))
    except EpisodeError as problem:
        raise StudyError(f"search: {key}: {problem}") from None
    return factors[-nlink:] if stage == 2 else factors[:-nlink]
