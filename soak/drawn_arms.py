"""Arms of 2 to 4 hinges in space, drawn at random, as MJCF."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

AXES = {"z": "0 0 1", "y": "0 1 0", "x": "1 0 0"}
POINTS = 8  # masses that a link is made of, so that its inertia is that of a body


@dataclass(frozen=True)
class DrawnArm:
    """An arm by its `names` (njoint), the `places` of its joints in the link before (njoint x 3) in m, their `axes`,
    and of each link the `inertial` element, and rotor and viscous friction in `rubbed` (njoint x 2).
    """

    names: tuple[str, ...]
    places: NDArray[np.float64]
    axes: tuple[str, ...]
    inertials: tuple[str, ...]
    rubbed: NDArray[np.float64]

    @property
    def mjcf(self) -> str:
        """The MJCF of the arm."""
        parts, n = [], len(self.names)
        for joint, name in enumerate(self.names):
            rotor, damping = self.rubbed[joint]
            parts.append(
                f'<body name="link-{joint + 1}" pos="{_numbers(self.places[joint])}">\n'
                f'<joint name="{name}" axis="{AXES[self.axes[joint]]}" range="-2.4 2.4" '
                f'armature="{rotor:.6f}" damping="{damping:.6f}" actuatorfrcrange="-60 60"/>\n{self.inertials[joint]}\n'
            )
        return (
            '<mujoco model="drawn">\n<compiler angle="radian" autolimits="true"/>\n<option gravity="0 0 -9.81"/>\n'
            f"<worldbody>\n{''.join(parts)}{'</body>' * n}\n</worldbody>\n</mujoco>\n"
        )

    def displaced(self, random: Generator, by: float) -> str:
        """The MJCF of one whose joints are off by so many m, but for the first, which moves nothing where it is."""
        off = by * random.choice([-1.0, 1.0], self.places.shape)
        off[0] = 0.0
        return replace(self, places=self.places + off).mjcf


def draw_arm(random: Generator) -> DrawnArm:
    """An arm whose neighbouring axes are not parallel more often than an arm of industry's are."""
    n = int(random.integers(2, 5))
    axes = [str(random.choice(["z", "y"])), *(str(random.choice(["y", "y", "x"])) for _ in range(n - 1))]
    places = np.column_stack([random.uniform(-0.05, 0.05, (n, 2)), random.uniform(0.15, 0.4, n)])
    inertials = tuple(_inertial(random, float(random.uniform(0.6, 2.5))) for _ in range(n))
    rubbed = np.column_stack([random.uniform(0.01, 0.05, n), random.uniform(0.05, 0.2, n)])
    return DrawnArm(tuple(f"joint-{i + 1}" for i in range(n)), places, tuple(axes), inertials, rubbed)


def _inertial(random: Generator, mass: float) -> str:
    points = random.uniform(-1.0, 1.0, (POINTS, 3)) * [0.05, 0.05, 0.14] + [0.0, 0.0, 0.14]
    com = points.mean(axis=0)
    around = points - com
    second = mass * around.T @ around / POINTS
    about = np.trace(second) * np.eye(3) - second + 1e-4 * mass * np.eye(3)
    entries = [about[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return f'<inertial pos="{_numbers(com)}" mass="{mass:.6f}" fullinertia="{_numbers(entries)}"/>'


def _numbers(values: object) -> str:
    return " ".join(f"{value:.8f}" for value in np.asarray(values, dtype=np.float64))
