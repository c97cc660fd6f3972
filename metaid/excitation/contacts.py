"""Whether an arm touches itself, what stands around it, or the floor along a motion."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from metaid.errors import usable_mujoco
from metaid.models import Array
from metaid.plant import ArmPlant
from metaid.plant.description import CLEARANCE, Clearance

with usable_mujoco():
    import mujoco


class Contacts:
    """What the shapes of an arm's whole file meet. Shapes that are near each other at home belong together, and those
    that are below the floor there stand in it.
    """

    def __init__(self, plant: ArmPlant, floor: float | None) -> None:
        """Of a plant, with the height of a `floor` in m, where there is one."""
        self._clear = Clearance(plant.arm.whole, plant.home)
        self._whole, self._floor = plant.arm.whole, floor
        self._data = mujoco.MjData(self._whole.model)
        model = self._whole.model
        moves = np.array(self._whole.link_of)[model.geom_bodyid] >= 0
        bounded = model.geom_rbound > 0.0
        touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        self._judged: NDArray[np.bool_] = moves & bounded & touches
        if floor is not None:
            self._judged &= self._lowest(plant.home) > floor + CLEARANCE

    def met(self, poses: Iterable[Array]) -> str | None:
        """What touches what in the first of some poses (njoint each) where anything does; None where nothing does."""
        for pose in poses:
            if pair := self._clear.met(pose):
                return f"{pair} come within {CLEARANCE:g} m of each other"
            if self._floor is not None and (self._judged & (self._lowest(pose) < self._floor + CLEARANCE)).any():
                return f"a shape comes within {CLEARANCE:g} m of the floor"
        return None

    def _lowest(self, pose: Array) -> Array:
        """How low each shape reaches (ngeom), in m, by the box around it."""
        model, data = self._whole.model, self._data
        data.qpos[:] = self._whole.at(pose)
        mujoco.mj_kinematics(model, data)
        up = data.geom_xmat.reshape(-1, 3, 3)[:, 2]
        middle, half = model.geom_aabb[:, :3], model.geom_aabb[:, 3:]
        return np.asarray(data.geom_xpos[:, 2] + (up * middle).sum(axis=1) - (np.abs(up) * half).sum(axis=1))
