"""The twin of a planar chain, which moves in absolute angles of its links."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import Joints, ReadTrial, WatchedTrial
from metaid.estimation.twin.planar_motion import PlanarBalance, PlanarDerivatives, PlanarSpace
from metaid.estimation.twin.twin import Twin
from metaid.estimation.twin.workspace import KINDS, Beside
from metaid.models import Array, Lumps


class PlanarTwin(Twin):
    """A chain whose unknowns are `LogUnknowns`."""

    @cached_property
    def lumps(self) -> Lumps:
        """Of the chain."""
        lumps: Lumps = self.unknowns.lumps(self.point)
        return lumps

    @property
    def links(self) -> Array:
        return np.tril(np.ones((self.unknowns.njoint, self.unknowns.njoint)))

    @property
    def space(self) -> tuple[NDArray[np.int64], PlanarSpace]:
        n = self.unknowns.njoint
        return np.arange(-1, n - 1), PlanarSpace(np.zeros(n), np.zeros(n), np.zeros((n, n)))

    def _leaning(self, joints: Joints) -> tuple[Array, Array, Array]:
        lean = joints.tilt - np.cumsum(joints.offset, axis=-1)  # what reads too much leans the other way.  Eq. 43
        return lean, np.diff(lean, axis=-1, prepend=0.0), np.zeros((0, len(lean)))

    def _moving(self, trial: WatchedTrial | ReadTrial, joints: Joints, unknown: Beside) -> tuple[Any, Any]:
        lumps, gravity, n = self.lumps, self.unknowns.gravity, self.unknowns.njoint
        law = Lumps(np.zeros(n), np.zeros((n, n))) if trial.law is None else trial.law
        at_once, builds_up = (0.0, 1.0) if trial.is_continuous else (1.0, 0.0)
        rubs = trial.is_continuous and bool(joints.dry.any() or unknown.by_kind[:, KINDS.index("dry")].any())
        balance = PlanarBalance(
            gravity=gravity * (law.gravity - lumps.gravity),
            coriolis=law.coriolis - lumps.coriolis,
            damping=law.of("damping") - lumps.of("damping") - joints.viscous,
            coulomb=law.of("coulomb") - lumps.of("coulomb") - at_once * joints.dry,
            spring=0.0 - joints.spring,
            lean=self._leaning(joints)[0],
            straight=np.array(joints.offset),
            dry=builds_up * joints.dry,
            presliding=float(joints.presliding[0]) if rubs else 0.0,
            cogging=np.array(joints.cogging),
            mass_coriolis=np.array(lumps.coriolis),
            mass_inertia=lumps.of("inertia") + joints.rotor + np.append(joints.rotor[1:], 0.0),
            rotor=np.array(joints.rotor),
            law_coriolis=np.array(law.coriolis),
            law_inertia=np.array(law.of("inertia")),
            stiffness=0.0,
        )
        # Of what is a multiple of a parameter the derivative by the logarithm of that is itself.
        derivatives = PlanarDerivatives(
            gravity=gravity * lumps.gravity,
            coriolis=np.array(lumps.coriolis),
            inertia=np.array(lumps.of("inertia")),
            damping=np.array(lumps.of("damping")),
            coulomb=np.array(lumps.of("coulomb")),
            columns=self.unknowns.columns,
            beside=unknown,
        )
        return balance, derivatives
