"""The compensation law of an identified model as source text, in Python and in C, that needs nothing but a sine.

Both are the equations of docs/method.md written once more: 5, 6 and 15 for a chain, 36 to 38 for an arm.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from string import Template
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from metaid.models import FRICTION, SLIDING, Array, ChainModel, Lumps
from metaid.models.tree import PARAMETERS, Tree, joint_mass_matrix, joint_torque
from metaid.results.exporting.arm_law_texts import ARM_C, ARM_PYTHON
from metaid.results.exporting.chain_law_texts import (
    CHAIN_C,
    CHAIN_MASS_MATRIX_C,
    CHAIN_MASS_MATRIX_PYTHON,
    CHAIN_PYTHON,
    END_C,
)

Constants = Mapping[str, Array | NDArray[np.bool_]]


class Law(Protocol):
    """A law, which can be computed, and written in two languages."""

    @property
    def njoint(self) -> int:
        """How many joints it is for."""

    def torque(self, angles: Array, speeds: Array) -> Array:
        """The joint torque (njoint) that leaves nothing to accelerate the plant, in N m (of a slide in N)."""

    def mass_matrix(self, angles: Array) -> Array | None:
        """In joint coordinates (njoint x njoint), in kg m²; None where the inertia lumps are not known."""

    def python(self) -> str:
        """A Python module with a function `torque(q, qd)`, and `mass_matrix(q)` where that is known."""

    def c(self, name: str) -> str:
        """A C99 header with a function `NAME_torque(q, qd, torque)`, and `NAME_mass_matrix(q, matrix)` where that is
        known.
        """


@dataclass(frozen=True)
class ChainLaw:
    """The law of a chain's `lumps` in `gravity` (m/s²).  Eqs. 5, 6 and 15."""

    lumps: Lumps
    gravity: float

    @property
    def njoint(self) -> int:
        return self.lumps.nlink

    def torque(self, angles: Array, speeds: Array) -> Array:
        return ChainModel(self.lumps, self.gravity).torque(angles, speeds)

    def mass_matrix(self, angles: Array) -> Array | None:
        return ChainModel(self.lumps, self.gravity).mass_matrix(angles) if self.has_inertia else None

    @property
    def has_inertia(self) -> bool:
        """Whether the inertia lumps are known."""
        return self.lumps.inertia is not None

    @property
    def _constants(self) -> Constants:
        kinds = (*FRICTION, *(["inertia"] if self.has_inertia else []))
        parts = {kind: self.lumps.of(kind) for kind in kinds}
        return {"gravity": self.gravity * self.lumps.gravity, "coriolis": self.lumps.coriolis, **parts}

    def python(self) -> str:
        return _python(CHAIN_PYTHON + CHAIN_MASS_MATRIX_PYTHON * self.has_inertia, self._constants)

    def c(self, name: str) -> str:
        text = CHAIN_C + CHAIN_MASS_MATRIX_C * self.has_inertia + END_C
        return _c(text, name, self.lumps.nlink, self._constants)


@dataclass(frozen=True)
class ArmLaw:
    """The bias force and the friction of an arm with the joints of a `tree` and these `parameters` (njoint x 13), which
    need not be those of possible bodies.  Eqs. 36 to 38.
    """

    tree: Tree
    parameters: Array

    @property
    def njoint(self) -> int:
        return self.tree.njoint

    def torque(self, angles: Array, speeds: Array) -> Array:
        return joint_torque(self._arm, angles, speeds, np.zeros(self.njoint))

    def mass_matrix(self, angles: Array) -> Array | None:
        return joint_mass_matrix(self._arm, angles)

    @property
    def _arm(self) -> Tree:
        return self.tree.with_parameters(self.parameters)

    @property
    def _constants(self) -> Constants:
        tree, parameters = self.tree, self.parameters
        return {
            "gravity": tree.gravity,
            "position": tree.position,
            "rotation": tree.rotation,
            "axis": tree.axis,
            "slides": tree.slides,
            "mass": parameters[:, 0],
            "moment": parameters[:, 1:4],
            "inertia": parameters[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3),
            "rotor": parameters[:, PARAMETERS.index("rotor")],
            "damping": parameters[:, PARAMETERS.index("damping")],
            "coulomb": parameters[:, PARAMETERS.index("coulomb")],
        }

    def python(self) -> str:
        return _python(ARM_PYTHON, self._constants)

    def c(self, name: str) -> str:
        return _c(ARM_C, name, self.tree.njoint, self._constants)


def c_name(name: str) -> str:
    """A word of C for a study of that `name`."""
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return word if re.match(r"[A-Za-z]", word) else f"study_{word}".rstrip("_")


def _python(template: str, constants: Constants) -> str:
    texts = {key: _numbers(value, "[]", "    ") for key, value in constants.items()}
    return Template(template).substitute(texts, sliding=repr(SLIDING))


def _c(template: str, name: str, njoint: int, constants: Constants) -> str:
    texts = {key: _numbers(value, "{}", "        ") for key, value in constants.items()}
    words = {"name": name, "guard": f"{name.upper()}_TORQUE_H", "njoint": str(njoint)}
    return Template(template).substitute(texts, **words, sliding=repr(SLIDING))


def _numbers(values: Array | NDArray[np.bool_], brackets: str, indent: str) -> str:
    """Numbers as a literal, one row a line."""
    if values.ndim == 1:
        kind = int if values.dtype == np.bool_ else float
        return brackets[0] + ", ".join(repr(kind(each)) for each in values) + brackets[1]
    rows = f",\n{indent}".join(_numbers(row, brackets, indent + "    ") for row in values)
    return f"{brackets[0]}\n{indent}{rows}\n{indent[4:]}{brackets[1]}"
