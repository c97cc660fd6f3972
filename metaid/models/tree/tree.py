"""A serial arm: where its joints are, and what its links weigh.

Link i hangs on joint i, which joins it to the link before, the first to the base. The frame of a link has its origin on
the axis of its joint and moves with the link. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from metaid.models.lumps import Array

# Of each joint and its link, in this order: mass in kg; first moments about the origin of the link's frame in kg m;
# moments of inertia about the same point in kg m²; inertia of the rotor as the joint feels it, in kg m² (in kg for a
# slide); viscous friction in N m s (N s/m) and dry friction in N m (N).
PARAMETERS = ("m", "mx", "my", "mz", "xx", "xy", "xz", "yy", "yz", "zz", "rotor", "damping", "coulomb")

UPPER = np.triu_indices(3)  # rows and columns of the moments of inertia, in their order


@dataclass(frozen=True)
class Tree:
    """A serial arm. Joint coordinates q (njoint) are angles in rad, of a slide lengths in m.

    Attributes:
        names: of the joints (njoint), from the base on.
        position: origin of each link's frame at q = 0, in the frame of the link before (njoint x 3), in m.
        rotation: each link's frame at q = 0 in that of the link before (njoint x 3 x 3): its columns are the axes.
        axis: of each joint, in the frame of its link (njoint x 3), of length 1.
        slides: whether a joint is a slide, and no hinge (njoint).
        low: least joint coordinates (njoint), −inf where there is no limit.
        high: largest joint coordinates (njoint), inf where there is no limit.
        torque_limit: what the motors can give (njoint), in N m or N; inf where it is not known.
        gravity: of the base's frame (3), in m/s².
        mass: of the links (njoint), in kg.
        com: centres of mass in the links' frames (njoint x 3), in m.
        inertia: about the centres of mass, along the axes of the links' frames (njoint x 3 x 3), in kg m².
        rotor: inertia of the rotors as the joints feel them (njoint), in kg m² or kg.
        damping: viscous friction of the joints (njoint), in N m s or N s/m.
        coulomb: dry friction of the joints (njoint), in N m or N.
    """

    names: tuple[str, ...]
    position: Array
    rotation: Array
    axis: Array
    slides: NDArray[np.bool_]
    low: Array
    high: Array
    torque_limit: Array
    gravity: Array
    mass: Array
    com: Array
    inertia: Array
    rotor: Array
    damping: Array
    coulomb: Array

    @property
    def njoint(self) -> int:
        return len(self.names)

    def ranges(self, hinge: float, slide: float, middle: Array | float = 0.0) -> tuple[Array, Array]:
        """From where to where joints may move (njoint each), in rad or m: those without a limit so far, a `hinge` or a
        `slide`, to either side of a `middle`.
        """
        beyond = np.where(self.slides, slide, hinge)
        low = np.where(np.isfinite(self.low), self.low, middle - beyond)
        return low, np.where(np.isfinite(self.high), self.high, middle + beyond)

    @cached_property
    def parameters(self) -> Array:
        """The parameters of every joint and its link (njoint x 13), in the order of PARAMETERS."""
        moment = self.mass[:, None] * self.com
        offset = np.einsum("ni,ni->n", moment, self.com)[:, None, None] * np.eye(3)
        about_origin = self.inertia + offset - moment[:, :, None] * self.com[:, None, :]  # parallel axes
        inertia = about_origin[:, *UPPER]
        friction = np.stack([self.rotor, self.damping, self.coulomb], axis=1)
        return np.concatenate([self.mass[:, None], moment, inertia, friction], axis=1)

    @cached_property
    def axes_terms(self) -> Array:
        """What the axes of each link in the frame of the link before are a sum of (njoint x 3 x 3 x 3): as they are;
        times cos q; times sin q.
        """
        hinge, along = ~self.slides[:, None, None], self.axis[:, :, None] * self.axis[:, None, :]
        fixed = np.where(hinge, along, np.eye(3))
        parts = [fixed, np.eye(3) - fixed, np.where(hinge, crossing(self.axis), 0.0)]
        return np.asarray(self.rotation[:, None] @ np.stack(parts, axis=1), dtype=np.float64)

    def turned(self, zeros: Array) -> Tree:
        """The same arm, whose coordinates are less by these `zeros` (njoint)."""
        fixed, cosine, sine = np.moveaxis(self.axes_terms, 1, 0)
        angles = zeros[:, None, None]
        slid = self.rotation @ (np.where(self.slides, zeros, 0.0)[:, None] * self.axis)[:, :, None]
        rotation = fixed + np.cos(angles) * cosine + np.sin(angles) * sine
        return replace(self, position=self.position + slid[:, :, 0], rotation=rotation)

    def with_parameters(self, parameters: Array) -> Tree:
        """The same arm with these `parameters` (njoint x 13). They need not be those of a body that can be.

        A link without mass has no centre of mass, so its mass must not be 0.
        """
        mass, moment = parameters[:, 0], parameters[:, 1:4]
        com = moment / mass[:, None]
        offset = np.einsum("ni,ni->n", moment, com)[:, None, None] * np.eye(3)
        inertia = inertia_matrices(parameters) - offset + moment[:, :, None] * com[:, None, :]
        rotor, damping, coulomb = parameters[:, 10:].T
        return replace(self, mass=mass, com=com, inertia=inertia, rotor=rotor, damping=damping, coulomb=coulomb)


def inertia_matrices(parameters: Array) -> Array:
    """The moments of inertia among `parameters` (... x 10 or more) as matrices (... x 3 x 3)."""
    return parameters[..., [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(*parameters.shape[:-1], 3, 3)


def crossing(axes: Array) -> Array:
    """The matrices (... x 3 x 3) that make a x b of b, a being one of the `axes` (... x 3)."""
    matrices = np.zeros((*axes.shape, 3))
    matrices[..., [2, 0, 1], [1, 2, 0]] = axes
    matrices[..., [1, 2, 0], [2, 0, 1]] = -axes
    return matrices


def tilted_gravity(gravity: Array, tilt: Array) -> Array:
    """The `gravity` (3) that the frame of a base has which is turned by `tilt` (2), in rad, about its x and then its y
    axis.
    """
    (cosine, across), (sine, along) = np.cos(tilt), np.sin(tilt)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    about_y = np.array([[across, 0.0, along], [0.0, 1.0, 0.0], [-along, 0.0, across]])
    return np.ascontiguousarray((about_y @ about_x).T @ gravity)
