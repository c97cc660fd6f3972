"""What is wrong with a rig, and which of it an identification is told to search."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from benchmarks.chains import Links
from metaid.plant import FaultSettings, PlantSettings

TIMESTEP = 0.002  # s
FINE, COARSE = 1e-4, 1e-3  # rad of noise on an angle
TORQUE_NOISE, DELAY, TILT, FRICTION = 0.3, 4, 0.03, 0.05  # N m, control steps, rad, N m s
PUSHES_DIFFER = 0.02  # of every impulse, as a share of it; only who pushes has to do with it
ENCODER = {"angle_noise": FINE, "speed_sensor": False, "push_noise": PUSHES_DIFFER}


@dataclass(frozen=True)
class Condition:
    """A rig with `faults` of a plant file and viscous `friction` in every joint, in N m s. `searched` names what of it
    an identification knows that it has to find beside the lumps: "friction", "tilt" or "delay".
    """

    title: str
    faults: dict[str, Any] = field(default_factory=dict)
    friction: float = 0.0
    searched: tuple[str, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether its sensors read what is true."""
        return not self.settings.is_noisy

    @property
    def settings(self) -> FaultSettings:
        """The faults as a plant file has them."""
        return FaultSettings(**self.faults)

    def plant(self, true: Links) -> PlantSettings:
        """The plant of these `true` links."""
        links = tuple(link.model_copy(update={"damping": self.friction}) for link in true)
        return PlantSettings(links=links, timestep=TIMESTEP, faults=self.settings)


CONDITIONS = {
    "none": Condition("no fault: angles and speeds are exact"),
    "coarse": Condition("1 mrad on the angles, no speed sensor", {**ENCODER, "angle_noise": COARSE}),
    "coarse, pushes alike": Condition(
        "1 mrad on the angles, no speed sensor, pushes that are all alike",
        {**ENCODER, "angle_noise": COARSE, "push_noise": 0.0},
    ),
    "fine": Condition("0.1 mrad on the angles, no speed sensor", ENCODER),
    "torque noise": Condition("torque noise of 0.3 N m every 2 ms", {**ENCODER, "torque_noise": TORQUE_NOISE}),
    "late": Condition("torques 8 ms late, which nobody is told", {**ENCODER, "delay": DELAY}),
    "late, searched": Condition("torques late, by how much is searched", {**ENCODER, "delay": DELAY}, 0.0, ("delay",)),
    "tilted": Condition("base tilted by 30 mrad, which nobody is told", {**ENCODER, "tilt": TILT}),
    "tilted, searched": Condition("base tilted, by how much is searched", {**ENCODER, "tilt": TILT}, 0.0, ("tilt",)),
    "friction": Condition("viscous friction of 0.05 N m s, which nobody is told", ENCODER, FRICTION),
    "friction, searched": Condition("viscous friction, which is searched", ENCODER, FRICTION, ("friction",)),
}
