"""The compensation law of an identified model as source text, in Python and in C, that needs nothing but a sine.

Both are the equations of docs/method.md written once more: 5, 6 and 12 for a chain, 49 to 51 for an arm. What is 0 of
an arm's friction is left out. The texts are templates beside this module, which constants of a model fill in.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from metaid.models import FRICTION, SLIDING, Array, ChainModel
from metaid.models.tree import PARAMETERS, JointFriction, Tree, inertia_matrices, joint_mass_matrix, rigid_torque

Constants = Mapping[str, Array | NDArray[np.bool_] | NDArray[np.intp]]


class _Written(ABC):
    """A law as source text, by templates of its `kind`."""

    kind: ClassVar[str]

    @property
    @abstractmethod
    def _constants(self) -> Constants:
        """What the templates are filled in with."""

    def python(self) -> str:
        """A Python module with a function `torque(q, qd)`, and `mass_matrix(q)` and `inverse_dynamics(q, qd, qdd)`
        where inertia is known. With pre-sliding the last takes the `slip`, too, which `slide(slip, dq)` keeps.
        """
        return _law_text(f"{self.kind}.py", self._constants, "[]", "    ")

    def c(self, name: str) -> str:
        """A C99 header with a function `NAME_torque(q, qd, torque)`, and `NAME_mass_matrix(q, matrix)` and
        `NAME_inverse_dynamics(q, qd, qdd, torque)` where inertia is known. With pre-sliding the last takes the `slip`
        before the torque, which `NAME_slide(dq, slip)` keeps, or NULL.
        """
        return _law_text(f"{self.kind}.h", self._constants, "{}", "        ", name=name)


@dataclass(frozen=True)
class ChainLaw(_Written, ChainModel):
    """The law of a chain's lumps.  Eqs. 5, 6 and 12."""

    kind: ClassVar[str] = "chain"

    @property
    def njoint(self) -> int:
        """How many joints it is for."""
        return self.lumps.nlink

    @property
    def has_inertia(self) -> bool:
        """Whether the inertia lumps are known, without which it has no more than `torque`."""
        return self.lumps.inertia is not None

    @property
    def _constants(self) -> Constants:
        return {
            "gravity": self.gravity * self.lumps.gravity,
            "coriolis": self.lumps.coriolis,
            "inertia": self.lumps.of("inertia"),
            "rotor": np.full(self.njoint, self.rotor, dtype=np.float64),
            **{kind: self.lumps.of(kind) for kind in FRICTION},
        }


@dataclass(frozen=True)
class ArmLaw(_Written):
    """The rigid bodies and the friction of an arm.  Eqs. 49 to 51.

    Attributes:
        tree: where the joints are.
        parameters: of its bodies and rotors (njoint x 13), which need not be those of possible bodies.
        friction: of its joints; that among the parameters does not count.
    """

    tree: Tree
    parameters: Array
    friction: JointFriction

    kind: ClassVar[str] = "arm"
    has_inertia: ClassVar[bool] = True

    @property
    def njoint(self) -> int:
        return self.tree.njoint

    def torque(self, angles: Array, speeds: Array) -> Array:
        """The joint torque (... x njoint) that leaves nothing to accelerate the plant, in N m (of a slide in N), of
        angles and speeds (... x njoint each); dry friction is what the speeds alone say.
        """
        friction, steady = self.friction, np.zeros_like(speeds)
        rigid = rigid_torque(self.tree, self.parameters, angles, speeds, steady)
        return rigid + friction.torque(angles, speeds, steady, rigid, friction.sliding.at(speeds))

    def inverse_dynamics(self, angles: Array, speeds: Array, accelerations: Array) -> Array:
        """As that of a chain. Rows (... x nrow x njoint) are in the order of time: where dry friction has pre-sliding
        it follows the motion.
        """
        rigid = rigid_torque(self.tree, self.parameters, angles, speeds, accelerations)
        friction, sliding = self.friction, self.friction.sliding
        slip = sliding.at(speeds) if angles.ndim == 1 else sliding.along(angles, speeds)
        return rigid + friction.torque(angles, speeds, accelerations, rigid, slip)

    def mass_matrix(self, angles: Array) -> Array:
        bodies = joint_mass_matrix(self.tree.with_parameters(self.parameters), angles)
        return bodies + self.friction.mass_matrix

    @property
    def _constants(self) -> Constants:
        tree, parameters, friction = self.tree, self.parameters, self.friction
        sliding = friction.sliding
        return {
            "gravity": tree.gravity,
            "position": tree.position,
            "rotation": tree.rotation,
            "axis": tree.axis,
            "slides": tree.slides,
            "mass": parameters[:, 0],
            "moment": parameters[:, 1:4],
            "inertia": inertia_matrices(parameters),
            "rotor": parameters[:, PARAMETERS.index("rotor")],
            "damping": friction.of("viscous"),
            **{term: friction.of(term) for term in ("coulomb", "root")},
            **{term: friction.of(term)[: self.njoint] for term in ("load", "offset", "spring")},
            **{name: sliding.means(getattr(sliding, name)) for name in ("still", "presliding", "bent")},
            "coupled": np.array(sliding.coupled, dtype=np.intp).reshape(-1, 2),
            "coupled_rotor": friction.coupled_rotor,
        }


Law = ChainLaw | ArmLaw  # either can be computed, and written in two languages


def c_name(name: str) -> str:
    """A word of C for a study of that `name`."""
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return word if re.match(r"[A-Za-z]", word) else f"study_{word}".rstrip("_")


def _law_text(template: str, constants: Constants, brackets: str, indent: str, **words: str) -> str:
    """A template with the constants of a model as literals, and in `has` which of them are not nothing."""
    literals = {key: _numbers(value, brackets, indent) for key, value in constants.items()}
    has = {key: bool(np.any(value)) for key, value in constants.items()}
    sizes = {"njoint": len(constants["rotor"]), "nmotor": len(constants["damping"]), "sliding": repr(SLIDING)}
    return filled_in(template, **literals, **sizes, **words, literals=literals, has=has)


def filled_in(template: str, **words: Any) -> str:
    """A template beside this module, filled in with these words."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # slow to load

    environment = Environment(
        loader=PackageLoader("metaid.exporting", "."),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(f"{template}.jinja").render(words)


def _numbers(values: Array | NDArray[np.bool_] | NDArray[np.intp], brackets: str, indent: str) -> str:
    """Numbers as a literal, one row a line."""
    if values.ndim == 1:
        kind = float if values.dtype == np.float64 else int
        return brackets[0] + ", ".join(repr(kind(each)) for each in values) + brackets[1]
    rows = f",\n{indent}".join(_numbers(row, brackets, indent + "    ") for row in values)
    return f"{brackets[0]}\n{indent}{rows}\n{indent[4:]}{brackets[1]}"
