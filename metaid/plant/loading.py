"""Plants by the name of a shipped file, or by the path of one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from metaid.errors import PlantError
from metaid.files import check, find_file, read_toml
from metaid.plant.arm_plant import ArmPlant
from metaid.plant.arm_settings import ArmSettings
from metaid.plant.asked import refuse_files_outside
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.settings import PlantSettings
from metaid.plant.socket_plant import SocketPlant, SocketSettings
from metaid.plant.wire import FORMS

# Endings of what describes an arm, and the key of a plant file that names it.
ARM_FILES = {".xml": "mjcf", ".urdf": "urdf", ".xacro": "urdf"}
PLANT_KEYS = {"links", "socket", "mjcf", "urdf"}  # each plant file has one of them
DICT = Path("dict")  # how messages name a plant that is in no file
AnySettings = PlantSettings | SocketSettings | ArmSettings


def load_plant(name: str | Path | Mapping[str, Any], joints: Sequence[str] | None = None) -> MujocoPlant | ArmPlant:
    """The shipped plant of that name, or what is at that path: a plant file, an MJCF or a URDF; or of a dict with the
    keys of a plant file. Of an arm only these `joints` move where they are said.  Raises PlantError.

    Example:
        >>> metaid.load_plant("three-link")
        <MujocoPlant three-link: njoint=3>
        >>> metaid.load_plant({"links": [{"length": 0.3, "mass": 0.5}, {"length": 0.2, "mass": 0.4}]})
        <MujocoPlant dict: njoint=2>
    """
    if isinstance(name, Mapping):
        path, settings = DICT, _any_plant(name, DICT)
    else:
        path = find_file("plants", str(name), PlantError)
        settings = read_any_plant(path)
    settings = with_joints(settings, joints, path)
    plant: MujocoPlant | ArmPlant
    if isinstance(settings, ArmSettings):
        plant = ArmPlant(path.stem, settings)
    else:
        plant = MujocoPlant(path.stem, _of_chain(path, settings))
    _ = plant.model  # so that one that cannot be built is refused here
    return plant


def load_chain(name: str | Path) -> MujocoPlant:
    """The same, of planar chains alone.  Raises PlantError."""
    path = find_file("plants", str(name), PlantError)
    plant = MujocoPlant(path.stem, read_plant(path))
    _ = plant.model
    return plant


def read_plant(path: Path) -> PlantSettings:
    """The checked contents of the file of a simulated chain.  Raises PlantError."""
    return _of_chain(path, read_any_plant(path))


def _of_chain(path: Path, settings: AnySettings) -> PlantSettings:
    if not isinstance(settings, PlantSettings):
        raise PlantError(f"{path}: {settings.why_no_chain}")
    return settings


def with_joints(settings: AnySettings, joints: Sequence[str] | None, path: Path) -> AnySettings:
    """Settings of a plant file at a path with other joints that move.  Raises PlantError where it is no arm's."""
    if joints is None:
        return settings
    if not isinstance(settings, ArmSettings):
        raise PlantError(f"{path}: joints: all of it move (allowed: joints of an MJCF or URDF)")
    return settings.model_copy(update={"joints": tuple(joints)})


def read_any_plant(path: Path) -> AnySettings:
    """The checked contents of a plant file of any kind; an arm's file is found from here. An MJCF (`.xml`) or URDF
    alone is an arm, too.  Raises PlantError.
    """
    if path.suffix in ARM_FILES:
        return check(ArmSettings, {ARM_FILES[path.suffix]: str(path)}, str(path), PlantError)
    return _any_plant(read_toml(path, PlantError), path)


def _any_plant(tables: Mapping[str, Any], path: Path) -> AnySettings:
    """The checked `tables` of the plant file at a path."""
    if "socket" in tables:
        return check(SocketSettings, tables, str(path), PlantError)
    if "mjcf" in tables or "urdf" in tables:
        arm = check(ArmSettings, tables, str(path), PlantError)
        return arm.model_copy(update={arm.kind: str(path.parent / arm.file)})
    if isinstance(tables.get("plant"), str) and not tables.keys() & PLANT_KEYS:
        raise PlantError(f"{path}: a study file, and no plant file (its plant is {tables['plant']})")
    return check(PlantSettings, tables, str(path), PlantError)


def refuse_parts_outside(path: Path, folder: Path) -> None:
    """Raises PlantError where the MJCF or URDF of the plant file at a path, or a file that it names, lies outside a
    `folder`.
    """
    for file in read_any_plant(path).files:
        refuse_files_outside(Path(file), folder)


def load_rig(name: str | Path) -> SocketPlant:
    """The plant behind the socket that the file at that path names.  Raises PlantError."""
    path = find_file("plants", str(name), PlantError)
    settings = read_any_plant(path)
    if not isinstance(settings, SocketSettings):
        raise PlantError(f"{path}: no plant behind a socket (allowed: a file with socket = '{FORMS}')")
    return SocketPlant(path.stem, settings)
