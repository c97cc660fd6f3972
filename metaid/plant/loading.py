"""Plants by the name of a shipped file, or by the path of one's own."""

from __future__ import annotations

from pathlib import Path

from metaid.errors import PlantError
from metaid.files import check, find_file, read_toml
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.settings import PlantSettings
from metaid.plant.socket_plant import SocketPlant, SocketSettings
from metaid.plant.wire import FORMS


def load_plant(name: str | Path) -> MujocoPlant:
    """The shipped plant of that name, or the plant file at that path.  Raises PlantError."""
    path = find_file("plants", str(name), PlantError)
    plant = MujocoPlant(path.stem, read_plant(path))
    _ = plant.simulation  # so that one that cannot be built is refused here
    return plant


def read_plant(path: Path) -> PlantSettings:
    """The checked contents of the file of a simulated plant.  Raises PlantError."""
    tables = read_toml(path, PlantError)
    if "socket" in tables:
        raise PlantError(
            f"{path}: a plant behind a socket has no links to simulate or draw (allowed: plant show, and in a study)"
        )
    return check(PlantSettings, tables, str(path), PlantError)


def read_any_plant(path: Path) -> PlantSettings | SocketSettings:
    """The checked contents of a plant file of either kind.  Raises PlantError."""
    tables = read_toml(path, PlantError)
    return check(SocketSettings, tables, str(path), PlantError) if "socket" in tables else read_plant(path)


def load_rig(name: str | Path) -> SocketPlant:
    """The plant behind the socket that the file at that path names.  Raises PlantError."""
    path = find_file("plants", str(name), PlantError)
    settings = read_any_plant(path)
    if not isinstance(settings, SocketSettings):
        raise PlantError(f"{path}: no plant behind a socket (allowed: a file with socket = '{FORMS}')")
    return SocketPlant(path.stem, settings)
