"""A study file, read and made whole: the settings checked, the plant and the nominal model written out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from metaid.errors import PlantError, StudyError
from metaid.files import check, find_file, read_toml
from metaid.models.tree import Tree, base_parameters
from metaid.plant import (
    ARM_FILES,
    PLANT_KEYS,
    ArmPlant,
    ArmSettings,
    LinkSettings,
    PlantSettings,
    SocketSettings,
    read_any_plant,
    read_plant,
    refuse_parts_outside,
)
from metaid.study.drawn import drawn_nominal, drawn_starts
from metaid.study.settings import (
    DrawnNominalSettings,
    NominalSettings,
    StudySettings,
    refuse_unsuited,
    with_defaults,
)
from metaid.study.spec import ArmPlantSettings, StudySpec, TreeSettings

NAMES_PLANT = "allowed: a file with plant = NAME or PATH, nominal = … and what else a study has"

Named = Callable[[str, str], Path]


def read_study(name: str | Path, changes: dict[str, Any] | None = None) -> StudySpec:
    """The shipped study of that name, or the study file at that path, with `changes` by dotted key; it may
    still contradict itself.  Raises StudyError, PlantError.

    What the file names lies in its own folder; a path in `changes` is the user's own and may be anywhere.
    """
    path = find_file("studies", str(name), StudyError)
    if path.suffix in ARM_FILES:
        raise StudyError(f"{path}: describes a robot, and is no study file ({NAMES_PLANT})")
    tables = read_toml(path, StudyError)
    if "plant" not in tables and tables.keys() & PLANT_KEYS:
        raise StudyError(f"{path}: a plant file, and no study file ({NAMES_PLANT})")
    changes = changes or {}
    for key, value in changes.items():
        _change(tables, key, value)

    def named(key: str, value: str) -> Path:
        if key in changes:
            return find_file("plants", value, PlantError)
        found = find_file("plants", value, PlantError, path)
        if found.resolve().is_relative_to(path.parent.resolve()):
            refuse_parts_outside(found, path.parent)
        return found

    return _spec(path, check(StudySettings, tables, str(path), StudyError), named)


def _change(tables: dict[str, Any], key: str, value: Any) -> None:
    *parents, last = key.split(".")
    for parent in parents:
        tables = tables.setdefault(parent, {})
        if not isinstance(tables, dict):
            raise StudyError(f"--set {key}: '{parent}' is not a table")
    tables[last] = value


def _spec(path: Path, study: StudySettings, named: Named) -> StudySpec:
    """The study of the file at a path; `named` finds the plant file that a key of it names.

    Raises StudyError where the file says what no study is, PlantError where a plant file is missing or describes no
    robot.
    """
    plant_path = named("plant", study.plant)
    plant = read_any_plant(plant_path)
    is_rig = isinstance(plant, SocketSettings)
    is_arm = _names_arm(study, named) if is_rig else not isinstance(plant, PlantSettings)
    refuse_unsuited(study, is_arm, str(path))
    study = with_defaults(study, is_arm, is_rig)
    whole: dict[str, Any] = {"name": path.stem, "plant_name": plant_path.stem, "plant": plant, "study": study}
    if not is_arm:
        return StudySpec(nominal=_nominal_links(study, whole["plant"], path, named), **whole)
    arm, nominal = _nominal_arm(study, named)
    if isinstance(plant, SocketSettings):
        _refuse_other_rig(plant, nominal, path)
    else:
        arm = ArmPlant(plant_path.stem, whole["plant"])
        whole["plant"] = _simulated(arm, nominal, path)
    return StudySpec(
        nominal=TreeSettings.of(nominal),
        counted_by=base_parameters(nominal, None, "tilt" in study.estimate.undeclared_faults).names,
        starts=drawn_starts(study, arm, nominal),
        **whole,
    )


def _names_arm(study: StudySettings, named: Named) -> bool:
    """Whether the nominal model of a study is an arm."""
    if not isinstance(study.nominal, str):
        return isinstance(study.nominal, DrawnNominalSettings)
    return isinstance(read_any_plant(named("nominal", study.nominal)), ArmSettings)


def _nominal_links(
    study: StudySettings, plant: PlantSettings | SocketSettings, path: Path, named: Named
) -> tuple[LinkSettings, ...]:
    """Those of a nominal chain."""
    if isinstance(study.nominal, NominalSettings):
        return study.nominal.links
    model = read_plant(named("nominal", str(study.nominal)))
    if model.gravity != plant.gravity:
        raise StudyError(
            f"{path}: the nominal model's gravity is {model.gravity} m/s², the plant's {plant.gravity}: "
            "they must agree, it is not searched"
        )
    return model.links


def _nominal_arm(study: StudySettings, named: Named) -> tuple[ArmPlant, Tree]:
    """The arm that the nominal one is, or is drawn about, and the nominal one."""
    drawn = study.nominal if isinstance(study.nominal, DrawnNominalSettings) else None
    path = named("nominal", str(study.nominal) if drawn is None else drawn.plant)
    settings = read_any_plant(path)
    if not isinstance(settings, ArmSettings):
        raise PlantError(f"{path}: no arm, as the plant of the study is (allowed: a plant file with mjcf or urdf)")
    arm = ArmPlant(path.stem, settings)
    arm.refuse_couples()
    return arm, arm.tree if drawn is None else drawn_nominal(arm.tree, drawn.seed, study.estimate.prior)


def _simulated(plant: ArmPlant, nominal: Tree, path: Path) -> ArmPlantSettings:
    """A simulated plant, written out."""
    if nominal.names != plant.tree.names:
        raise StudyError(
            f"{path}: plant {plant.name} has the joints {', '.join(plant.tree.names)}, the nominal arm "
            f"{', '.join(nominal.names)}: they must agree"
        )
    plant.refuse_couples()
    settings, sprung = plant.settings, [(i, name) for i, name in enumerate(nominal.names) if plant.stiffness[i]]
    return ArmPlantSettings(
        arm=TreeSettings.of(plant.tree),
        timestep=plant.timestep,
        truth_known=settings.truth_known,
        faults=settings.faults,
        stiffness={name: float(plant.stiffness[i]) for i, name in sprung},
        slack={name: float(plant.slack[i]) for i, name in sprung},
    )


def _refuse_other_rig(rig: SocketSettings, nominal: Tree, path: Path) -> None:
    """Raises StudyError where a rig has not the joints and the gravity of the nominal arm."""
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
