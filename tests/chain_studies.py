"""Studies of random chains whose nominal models are wrong: what several tests vary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from conftest import random_links

from metaid.plant import LinkSettings, PlantSettings
from metaid.study import StudySettings, StudySpec

Links = tuple[LinkSettings, ...]


def random_chain(nlink: int, seed: int) -> tuple[Links, Links]:
    """The true links, base first, and the nominal ones: masses and inertias wrong by up to 30 %, centres of mass by up
    to 15 %. Lengths are known.
    """
    true, random = random_links(nlink, seed), np.random.default_rng([nlink, seed])

    def believed(link: LinkSettings) -> LinkSettings:
        factors = zip(("mass", "com", "inertia"), random.uniform([0.7, 0.85, 0.7], [1.3, 1.15, 1.3]), strict=True)
        return link.model_copy(update={key: getattr(link, key) * float(factor) for key, factor in factors})

    return true, tuple(map(believed, true))


def chain_study(
    chain: tuple[Links, Links],
    faults: Mapping[str, Any] | None = None,
    link: Mapping[str, float] | None = None,
    **settings: Any,
) -> StudySpec:
    """A study by output-error, unless its `settings` say otherwise, named `chain`.

    Args:
        chain: the true links, base first, and the nominal ones.
        faults: of the plant.
        link: what each true link has beside its own: friction, a spring.
        settings: those of a study file.
    """
    true, nominal = chain
    asked = {"plant": "chain", "nominal": "chain", "sampler": "output-error", **settings}
    plant = PlantSettings.model_validate(
        {"links": tuple(each.model_copy(update=dict(link or {})) for each in true), "faults": dict(faults or {})}
    )
    study = StudySettings.model_validate(asked)
    return StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study)


# Of the study `three-link`: exact sensors, light pushes, counted periods.
SMALL_PUSHES = {"plant": "three-link", "episode.measure": "crossing", "episode.peak_speed": 0.1}
