"""What real benches have that a rigid chain of ideal motors has not, each by a number that is 0 where it is absent."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Each = tuple[float, ...]


@dataclass(frozen=True)
class Imperfections:
    """SI units. What is of each joint is given for as many as have it, the others have none.

    Attributes:
        encoder_step: resolution of the angles, in rad.
        angle_noise: standard deviation of a reading, in rad.
        encoder_offset: by which each angle is read too large, in rad.
        speed_filter: time constant of the speeds that are shown, in s.
        tick_jitter: standard deviation of a tick's length, in s.
        tells_time: whether readings carry the time.
        delay: by which torques are late, in s.
        delay_jitter: standard deviation of it, as a share of it.
        torque_lag: time constant of the drives, in s.
        torque_noise: standard deviation of what each drive adds to each torque, in N m.
        torque_limit: of each drive, in N m; 0 for none.
        gains: what each drive delivers beyond what it is told, as a share of it.
        rotors: reflected inertia, in kg m².
        viscous: friction, in N m s.
        dry: friction, in N m, by bristles that bend by `bending` in rad; `stiction` times as much at rest, less by
            speeds of `stribeck` in rad/s.
        cogging: amplitude in N m, `teeth` times a turn.
        cable: stiffness in N m/rad, `slack` at an angle in rad.
        tilt: of the base, in rad; of an arm about its y axis.
        start_angles: standard deviation of where a push begins, in rad.
        start_speeds: standard deviation of what it gives, as a share of it.
        rate: steps of the simulation in a second.
        seed: of all chance.
    """

    encoder_step: float = 0.0
    angle_noise: float = 0.0
    encoder_offset: float = 0.0
    speed_filter: float = 0.0
    tick_jitter: float = 0.0
    tells_time: float = 0.0
    delay: float = 0.0
    delay_jitter: float = 0.0
    torque_lag: float = 0.0
    torque_noise: float = 0.0
    torque_limit: Each = ()
    gains: Each = ()
    rotors: Each = ()
    viscous: Each = ()
    dry: Each = ()
    bending: float = 1e-3
    stiction: float = 1.25
    stribeck: float = 0.1
    cogging: Each = ()
    teeth: float = 14.0
    cable: Each = ()
    slack: float = 0.3
    tilt: float = 0.0
    start_angles: float = 0.0
    start_speeds: float = 0.0
    rate: float = 20000.0
    seed: int = 0

    def each(self, name: str, count: int) -> NDArray[np.float64]:
        """What is of each of `count` joints."""
        given = getattr(self, name)
        return np.array([*given, *[0.0] * count][:count])

    @classmethod
    def parsed(cls, settings: list[str]) -> Imperfections:
        """From texts as `viscous=0.02,0.01`.  Raises SystemExit for what is none."""
        kinds = {field.name: field.type for field in fields(cls)}
        given: dict[str, float | Each] = {}
        for text in settings:
            name, _, value = text.partition("=")
            if name not in kinds:
                raise SystemExit(f"--set {text}: unknown (allowed: {', '.join(kinds)})")
            numbers = tuple(float(part) for part in value.split(","))
            given[name] = numbers if kinds[name] == "Each" else numbers[0]
        return cls(**given | ({"seed": int(given["seed"])} if "seed" in given else {}))  # type: ignore[arg-type]
