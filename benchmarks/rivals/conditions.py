"""What is wrong with a rig, and which of it an identification is told to search."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.chains import Links
from metaid.plant import FaultSettings, PlantSettings

TIMESTEP = 0.002  # s
FINE, COARSE = 1e-4, 1e-3  # rad of noise on an angle
SHIFT, TURN = 1e-3, float(np.deg2rad(0.5))  # m and rad, by which joints or encoders are not where they should be
TORQUE_NOISE, DELAY, TILT, FRICTION = 0.3, 4, 0.03, 0.05  # N m, control steps, rad, N m s
PUSHES_DIFFER = 0.02  # of every impulse, as a share of it; only who pushes has to do with it
ENCODER = {"angle_noise": FINE, "speed_sensor": False, "push_noise": PUSHES_DIFFER}


@dataclass(frozen=True)
class Condition:
    """A rig with `faults` of a plant file and viscous `friction` in every joint, in N m s. `searched` names what of it
    an identification knows that it has to find beside the lumps: "friction", "tilt", "delay" or "offset". Where the rig
    is `misplaced`, joints are not where everybody believes them to be.
    """

    title: str
    faults: dict[str, Any] = field(default_factory=dict)
    friction: float = 0.0
    searched: tuple[str, ...] = ()
    misplaced: bool = False

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

    def believed(self, nominal: Links, seed: int) -> Links:
        """The `nominal` links, with the lengths that everybody measured."""
        if not self.misplaced:
            return nominal
        wrong = SHIFT * np.random.default_rng([seed, len(nominal), 2]).choice([-1.0, 1.0], len(nominal))
        pairs = zip(nominal, wrong.tolist(), strict=True)
        return tuple(link.model_copy(update={"length": link.length + off}) for link, off in pairs)


CONDITIONS = {
    "none": Condition("My sensors are exact, for this is a simulator"),
    "coarse": Condition("My encoder is coarse: 1 mrad of noise, no speed sensor", {**ENCODER, "angle_noise": COARSE}),
    "coarse, pushes alike": Condition(
        "The same, and my pushes are all alike",
        {**ENCODER, "angle_noise": COARSE, "push_noise": 0.0},
    ),
    "fine": Condition("My encoder is good: 0.1 mrad of noise, no speed sensor", ENCODER),
    "torque noise": Condition(
        "I have no torque sensor, and my drives are rough: 0.3 N m of noise on every torque",
        {**ENCODER, "torque_noise": TORQUE_NOISE},
    ),
    "late": Condition("My torques are 8 ms late, and nobody knows", {**ENCODER, "delay": DELAY}),
    "late, searched": Condition(
        "My torques are late, and that is searched", {**ENCODER, "delay": DELAY}, 0.0, ("delay",)
    ),
    "tilted": Condition("My base is tilted by 30 mrad, and nobody knows", {**ENCODER, "tilt": TILT}),
    "tilted, searched": Condition("My base is tilted, and that is searched", {**ENCODER, "tilt": TILT}, 0.0, ("tilt",)),
    "friction": Condition("My joints have viscous friction of 0.05 N m s, and nobody knows", ENCODER, FRICTION),
    "friction, searched": Condition(
        "My joints have viscous friction, and that is searched", ENCODER, FRICTION, ("friction",)
    ),
    "kinematics": Condition(
        "My encoders read 0.5° too much, my lengths are wrong by 1 mm, and nobody knows; so are all frames of an arm",
        {**ENCODER, "encoder_offset": TURN},
        misplaced=True,
    ),
    "kinematics, searched": Condition(
        "My encoders read 0.5° too much, and that is searched",
        {**ENCODER, "encoder_offset": TURN},
        searched=("offset",),
        misplaced=True,
    ),
}
