"""A double pendulum's equations of motion, integrated on their own, and as an MJCF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.real.judging import Log, held
from metaid.models import Array

GRAVITY = 9.81  # m/s²
STEP = 0.002  # s
FULL = 2.0 / np.pi  # of arctan(100 v), where friction is the whole of it
MJCF = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" gravity="0 0 -{gravity}"/>
  <worldbody>
    <body>
      <inertial mass="{mass1}" pos="0 0 {com1}" fullinertia="{own1} {own1} {own1} 0 0 0"/>
      <joint name="one" axis="0 1 0" armature="{rotor1}" damping="{viscous1}" frictionloss="{coulomb1}"
             solreffriction="0.002 1" solimpfriction="0.99 0.99"/>
      <body pos="0 0 {length}">
        <inertial mass="{mass2}" pos="0 0 {com2}" fullinertia="{own2} {own2} {own2} 0 0 0"/>
        <joint name="two" axis="0 1 0" armature="{rotor2}" damping="{viscous2}" frictionloss="{coulomb2}"
               solreffriction="0.002 1" solimpfriction="0.99 0.99"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed armature="{motor}"><joint joint="one" coef="1"/><joint joint="two" coef="-{gear}"/></fixed>
  </tendon>
</mujoco>
"""


@dataclass(frozen=True)
class Pendulum:
    """Joint angles are 0 where it stands upright.

    Attributes:
        gravity: lumps of both links (2), in kg m.
        coriolis: the lump, in kg m².
        inertia: of both links about their joints, with all that hangs on the first (2), in kg m².
        rotors: reflected, of both joints (2), in kg m².
        motor, gear: inertia of a rotor in kg m² that the first joint carries, and the gear of the second, by which they
            act together.
        viscous, coulomb, offset: friction of both joints (2 each), in N m s, N m and N m.
        slope: Coulomb friction is coulomb · FULL · arctan(100 v) where it is 1, coulomb · arctan(100 v) where 1/FULL.
        length: of the first link, in m.
    """

    gravity: Array
    coriolis: float
    inertia: Array
    rotors: Array
    motor: float
    gear: float
    viscous: Array
    coulomb: Array
    offset: Array
    slope: float
    length: float

    def accelerations(self, angles: Array, speeds: Array, torques: Array) -> Array:
        """Of the joints (nstate x 2), in rad/s²."""
        first, second = angles[:, 0], angles[:, 0] + angles[:, 1]
        fast = speeds[:, 0] + speeds[:, 1]
        cosine, sine = self.coriolis * np.cos(angles[:, 1]), self.coriolis * np.sin(angles[:, 1])
        force = np.stack(
            [
                -GRAVITY * self.gravity[0] * np.sin(first) - sine * fast**2,
                -GRAVITY * self.gravity[1] * np.sin(second) + sine * speeds[:, 0] ** 2,
            ],
            axis=1,
        )
        force[:, 0] += force[:, 1]
        own = self.viscous * speeds + self.coulomb * self.slope * FULL * np.arctan(100.0 * speeds) + self.offset
        left = torques - force - own
        both = self.inertia[1] + cosine - self.gear * self.motor
        one = self.inertia.sum() + 2.0 * cosine + self.rotors[0] + self.motor
        two = self.inertia[1] + self.rotors[1] + self.gear**2 * self.motor
        determinant = one * two - both**2
        moved = [two * left[:, 0] - both * left[:, 1], one * left[:, 1] - both * left[:, 0]]
        return np.asarray(np.stack(moved, axis=1) / determinant[:, None], dtype=np.float64)

    def simulated(self, angles: Array, speeds: Array, log: Log, starts: Array, seconds: float) -> Array:
        """Angles (nstart x 2) after some `seconds`, by Runge and Kutta's fourth order, torques held as logged."""
        q, v, h = angles, speeds, STEP
        for step in range(round(seconds / h)):
            sent = held(log, starts + step * h)
            one = self.accelerations(q, v, sent)
            two = self.accelerations(q + h / 2 * v, v + h / 2 * one, sent)
            three = self.accelerations(q + h / 2 * v + h * h / 4 * one, v + h / 2 * two, sent)
            four = self.accelerations(q + h * v + h * h / 2 * two, v + h * three, sent)
            q, v = q + h * v + h * h / 6 * (one + two + three), v + h / 6 * (one + 2 * two + 2 * three + four)
        return q

    def as_mjcf(self) -> str:
        """The same motion by bodies that can be, Coulomb friction as `frictionloss` of the whole coefficient."""
        com2 = 0.9 * self.inertia[1] / self.gravity[1]
        mass2 = self.gravity[1] / com2
        left, first = self.inertia[0] - mass2 * self.length**2, self.gravity[0] - mass2 * self.length
        com1 = 0.9 * left / first
        mass1 = first / com1
        return MJCF.format(
            gravity=GRAVITY, length=self.length, motor=self.motor, gear=self.gear,
            mass1=mass1, com1=com1, own1=left - mass1 * com1**2, rotor1=self.rotors[0],
            mass2=mass2, com2=com2, own2=self.inertia[1] - mass2 * com2**2, rotor2=self.rotors[1],
            viscous1=self.viscous[0], viscous2=self.viscous[1],
            coulomb1=self.coulomb[0], coulomb2=self.coulomb[1],
        )  # fmt: skip


def lab_pendulum(path: Path) -> Pendulum:
    """That of the lab's `model_parameters.yml`, with the equations of its plant: motors whose rotors turn on links, and
    friction b v + cf arctan(100 v).
    """
    cells = (line.split(":") for line in path.read_text(encoding="utf-8").splitlines() if ":" in line)
    given = {name.strip(): float(value) for name, value in cells}
    far, length, motor, gear = given["m2"] * given["r2"], given["l1"], given["Ir"], given["gr"]
    return Pendulum(
        gravity=np.array([given["m1"] * given["r1"] + given["m2"] * length, far]),
        coriolis=length * far,
        inertia=np.array([given["I1"] + given["m2"] * length**2, given["I2"]]),
        rotors=np.array([gear**2 * motor, 0.0]),
        motor=motor,
        gear=gear,
        viscous=np.array([given["b1"], given["b2"]]),
        coulomb=np.array([given["cf1"], given["cf2"]]),
        offset=np.zeros(2),
        slope=1.0 / FULL,
        length=length,
    )


def of_values(values: dict[str, float]) -> Pendulum:
    """That of lumps and friction by name, as least squares find them."""

    def both(name: str) -> Array:
        return np.array([values.get(f"{name}_{joint}", 0.0) for joint in (1, 2)])

    return Pendulum(
        gravity=both("gravity"),
        coriolis=values["coriolis_1_2"],
        inertia=both("inertia"),
        rotors=np.array([0.0, values["rotor_2"]]),
        motor=0.0,
        gear=0.0,
        viscous=both("damping"),
        coulomb=both("coulomb"),
        offset=both("offset"),
        slope=1.0,
        length=values["coriolis_1_2"] / values["gravity_2"],
    )
