"""A study of a chain that `output-error` identifies: what several benchmarks vary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.chains import Links
from metaid.plant import FaultSettings, PlantSettings
from metaid.study import EpisodeSettings, StudySettings, StudySpec
from metaid.study.settings import EstimateSettings


def chain_study(
    chain: tuple[Links, Links],
    trials: int,
    seed: int,
    faults: Mapping[str, Any],
    every_link: Mapping[str, float] | None = None,
    estimate: Mapping[str, Any] | None = None,
) -> StudySpec:
    """A study of so many `trials`, whose measure is `smoothed`.

    Args:
        chain: the true links, base first, and the nominal ones.
        trials: at most.
        seed: of the study.
        faults: as a plant file has them.
        every_link: what each true link has beside its own: friction, a spring.
        estimate: the `[estimate]` of a study file.
    """
    true, nominal = chain
    study = StudySettings(
        plant="chain",
        nominal="chain",
        sampler="output-error",
        trials=trials,
        seed=seed,
        episode=EpisodeSettings(measure="smoothed"),
        estimate=EstimateSettings.model_validate(dict(estimate or {})),
    )
    links = tuple(link.model_copy(update=dict(every_link or {})) for link in true)
    plant = PlantSettings(links=links, faults=FaultSettings.model_validate(dict(faults)))
    return StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study)
