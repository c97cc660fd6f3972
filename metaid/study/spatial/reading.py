"""A study file of an arm, made whole: the arms written out, and from where the pushes begin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from metaid.errors import PlantError, StudyError
from metaid.files import check
from metaid.models.tree import Tree, base_parameters
from metaid.plant import ArmPlant, ArmSettings, ArmStart, SocketSettings, read_any_plant
from metaid.study.spatial.nominal import drawn_nominal
from metaid.study.spatial.settings import (
    ArmEpisodeSettings,
    ArmPlantSettings,
    ArmSpec,
    ArmStudySettings,
    DrawnNominalSettings,
    StartSettings,
    TreeSettings,
)


def arm_spec(
    path: Path,
    tables: dict[str, Any],
    plant_path: Path,
    settings: ArmSettings | SocketSettings,
    named: Callable[[str, str], Path],
) -> ArmSpec:
    """The study of an arm that a file describes.

    Args:
        path: of the study file.
        tables: what it says.
        plant_path: of the file of its plant.
        settings: of that plant, simulated or a rig.
        named: finds the plant file that a key of the study file names.

    Raises:
        StudyError: the file says what no study is.
        PlantError: a plant file is missing, or describes no serial arm.
    """
    stated = tables.get("nominal")
    if isinstance(stated, dict) and "links" in stated:
        raise StudyError(
            f"{path}: plant {plant_path.stem} is an arm, and the nominal model has the links of a planar chain "
            "(allowed: nominal = the plant file of an arm, or [nominal] with plant and seed)"
        )
    study = check(ArmStudySettings, tables, str(path), StudyError)
    shaped, nominal = _nominal(study, named)
    if isinstance(settings, SocketSettings):
        plant: ArmPlantSettings | SocketSettings = _agreeing(settings, nominal, path)
        study = study.model_copy(update={"estimate": study.estimate.of_rig})
    else:
        shaped = ArmPlant(plant_path.stem, settings)
        plant = _simulated(shaped, nominal, path)
    starts = _starts(study.episode, shaped, study.seed)
    coasts = _coasts(study.episode, shaped)
    stiffness = np.array(
        [0.0 if i < coasts else study.episode.stiffness_of(nominal, start) for i, start in enumerate(starts)]
    )
    return ArmSpec(
        name=path.stem,
        plant_name=plant_path.stem,
        plant=plant,
        nominal=TreeSettings.of(nominal),
        counted_by=base_parameters(nominal, None, "tilt" in study.estimate.undeclared_faults).names,
        starts=tuple(StartSettings(pose=start.pose.tolist(), speeds=start.speeds.tolist()) for start in starts),
        stiffness=stiffness.tolist(),
        study=study,
    )


def _simulated(plant: ArmPlant, nominal: Tree, path: Path) -> ArmPlantSettings:
    """A simulated plant, written out."""
    if nominal.names != plant.tree.names:
        raise StudyError(
            f"{path}: plant {plant.name} has the joints {', '.join(plant.tree.names)}, the nominal arm "
            f"{', '.join(nominal.names)}: they must agree"
        )
    settings = plant.settings
    return ArmPlantSettings(
        arm=TreeSettings.of(plant.tree),
        timestep=plant.timestep,
        truth_known=settings.truth_known,
        faults=settings.faults,
        stiffness=settings.stiffness,
    )


def _agreeing(rig: SocketSettings, nominal: Tree, path: Path) -> SocketSettings:
    """A rig that has the joints and the gravity of the nominal arm."""
    if rig.joints != nominal.njoint:
        raise StudyError(
            f"{path}: the rig has {rig.joints} joints, the nominal arm {nominal.njoint} "
            f"({', '.join(nominal.names)}): they must agree"
        )
    pull = float(np.linalg.norm(nominal.gravity))
    if not np.isclose(pull, rig.gravity):
        raise StudyError(
            f"{path}: the nominal arm's gravity is {pull:g} m/s², the rig's {rig.gravity:g}: they must agree, "
            "it is not searched"
        )
    return rig


def _nominal(study: ArmStudySettings, named: Callable[[str, str], Path]) -> tuple[ArmPlant, Tree]:
    """The arm that the nominal one is, or is drawn about, and the nominal one."""
    if not isinstance(study.nominal, DrawnNominalSettings):
        arm = _arm_at(named("nominal", study.nominal))
        return arm, arm.tree
    arm = _arm_at(named("nominal", study.nominal.plant))
    return arm, drawn_nominal(arm.tree, study.nominal.seed, study.estimate.prior)


def _arm_at(path: Path) -> ArmPlant:
    settings = read_any_plant(path)
    if not isinstance(settings, ArmSettings):
        raise PlantError(f"{path}: no arm, as the plant of the study is (allowed: a plant file with mjcf or urdf)")
    return ArmPlant(path.stem, settings)


def _coasts(episode: ArmEpisodeSettings, plant: ArmPlant) -> int:
    return episode.coasts or 2 * plant.njoint


def _starts(episode: ArmEpisodeSettings, plant: ArmPlant, seed: int) -> tuple[ArmStart, ...]:
    """Of the coasts, then of the springs."""
    from metaid.plant.description import draw_starts  # loads MuJoCo

    springs = plant.njoint if episode.springs is None else episode.springs
    return draw_starts(plant, _coasts(episode, plant) + springs, episode.horizon, seed, episode.speed)
