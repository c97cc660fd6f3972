"""The study of a simulated chain, run on the bench instead, which shares no code with metaid (`soak.bench`)."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from metaid.plant import FaultSettings, PlantSettings, SocketSettings, of_each
from metaid.store import Store
from metaid.study import StudySpec, create_study
from soak.bench.serving import bench

NUMBERS = ("length", "mass", "com", "inertia")
OF_LINKS = {"damping": "viscous", "frictionloss": "dry", "stiffness": "cable"}
ALIKE = ("angle_noise", "encoder_step", "torque_noise")


@contextmanager
def made_on_bench(spec: StudySpec) -> Iterator[tuple[Store, str]]:
    """A study made from `spec` in a new SQLite DB, which is deleted afterwards, and the bench that it pushes: the links
    and the faults are those of the plant that `spec` has.
    """
    plant = spec.plant
    assert isinstance(plant, PlantSettings)
    period = plant.timestep * plant.faults.control_every
    with tempfile.TemporaryDirectory() as folder, closing(Store(f"{folder}/metaid.db", create=True)) as store:
        path = Path(folder, "links.toml")
        links = [{name: getattr(link, name) for name in NUMBERS} for link in plant.links]
        path.write_text(tomli_w.dumps({"links": links, "gravity": plant.gravity}))
        with bench(path, period, **imperfections(plant, spec.study.seed)) as address:
            rig = SocketSettings(
                socket=address, joints=len(links), gravity=plant.gravity, timestep=period, step_timeout=60.0
            )
            study = spec.study.model_copy(update={"workers": 1})
            yield store, create_study(store, spec.model_copy(update={"plant": rig, "study": study}))


def imperfections(plant: PlantSettings, seed: int) -> Mapping[str, Any]:
    """What a bench has of the faults and the joints of a simulated `plant`. Dry friction is by bristles, larger at
    rest, and cables are slack where links are straight, as MuJoCo's springs are. The `seed` is of all chance.
    """
    of_links = {ours: tuple(getattr(link, name) for link in plant.links) for name, ours in OF_LINKS.items()}
    faults = of_faults(plant.faults, plant.timestep, len(plant.links))
    return faults | of_links | {"slack": 0.0, "seed": float(seed)}


def of_faults(faults: FaultSettings, timestep: float, njoint: int) -> dict[str, Any]:
    """What a bench of `njoint` joints has of the `faults` of a plant file with a `timestep` in s."""
    limit = faults.torque_limit
    return {
        **{name: float(getattr(faults, name)) for name in ALIKE},
        "encoder_offset": float(of_each(faults.encoder_offset, njoint)[0]),
        "tilt": float(of_each(faults.tilt, 1)[0]),
        "delay": faults.delay * faults.control_every * timestep,
        "torque_limit": tuple(np.broadcast_to(0.0 if limit is None else limit, njoint).tolist()),
        "gains": tuple((np.broadcast_to(faults.torque_gain, njoint) - 1.0).tolist()),
        "start_speeds": faults.push_noise,
    }
