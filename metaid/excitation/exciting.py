"""All of it in one call: from a nominal robot to the motion to record, and what a log of it will say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from metaid.errors import PlantError
from metaid.excitation.forecast import LASTS, LogForecast, LogNoise, forecast
from metaid.excitation.limits import OF_JOINTS, Limits, read_limits, usual_limits
from metaid.excitation.search import Criterion, MotionSearch, best_of_random, draws, improved
from metaid.excitation.series import Series, Trajectory
from metaid.frames import json_rows
from metaid.models import COARSEST, Array
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant, MujocoPlant, SimulatedPlant, load_plant
from metaid.recorded import model_of

PERIOD = 8.0  # s, about
RATE = 250.0  # rows a second
SHORTEST, LONGEST = 4.0, 600.0  # s of a motion
USUAL = 40  # draws that say how large torques are
LEAST = 0.05  # of the strongest joint's torque, for one that needs next to none
SECOND = 300  # draws, and tries, of a second motion
PAYLOAD = 0.1  # of the mass of all links
OF_TWO = 2.0**0.5  # of the difference of two logs


@dataclass(frozen=True)
class Excitation:
    """A motion to record.

    Attributes:
        plant: the name of the nominal robot.
        joints: their names (njoint).
        series: the motion, which is repeated for so many `seconds`.
        seconds: in all.
        problem: what it was found for.
        criterion: by which it is best.
        forecast: what a log of it will say.
        second: by what a second, different motion as long multiplies the deviations (nparam).
        again: by what the same motion once more does (nparam).
        payload: the mass in kg whose second log tells the gain of each drive, and their standard deviations as shares
            (njoint); None of a chain.
    """

    plant: str
    joints: tuple[str, ...]
    series: Series
    seconds: float
    problem: MotionSearch
    criterion: Criterion
    forecast: LogForecast
    second: Array
    again: Array
    payload: tuple[float, Array] | None

    def __repr__(self) -> str:
        return f"<Excitation of {self.plant}: njoint={len(self.joints)}, {self.seconds:g} s>"

    @property
    def limits(self) -> Limits:
        return self.problem.limits

    def at(self, times: Array) -> Trajectory:
        """The motion at some times (nstep), in s."""
        return self.series.at(times)

    def frame(self, rate: float = RATE) -> pd.DataFrame:
        """The motion with `rate` rows a second: `time` in s, and of every joint its angle, speed, acceleration and
        nominal torque, in rad, s and N m (of slides in m and N).
        """
        times = np.arange(round(self.seconds * rate) + 1) / rate
        motion = self.at(times)
        kinds = {
            "angle": motion.angles,
            "speed": motion.speeds,
            "acceleration": motion.accelerations,
            "nominal_torque": self.nominal_torques(times),
        }
        columns = {"time": times}
        for kind, values in kinds.items():
            columns |= {f"{kind}_{name}": each for name, each in zip(self.joints, values.T, strict=True)}
        return pd.DataFrame(columns)

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """What a log will say of each parameter, as rows."""
        model, told = self.problem.model, self.forecast
        columns = {
            "name": model.names,
            "unit": model.units,
            "nominal": self.problem.nominal,
            "sd": told.deviations,
            "determined": told.determined,
            "second_motion": self.second,
            "same_again": self.again,
            "expression": model.expressions,
        }
        return json_rows(pd.DataFrame(columns))

    @property
    def summary(self) -> dict[str, Any]:
        """All of it as `metaid excite --json` prints it; None of what has no limit, and of gains that are not known."""
        limits = {key: getattr(self.limits, key) for key in OF_JOINTS}
        bounded = {
            key: [each if np.isfinite(each) else None for each in values.tolist()] for key, values in limits.items()
        }
        payload = None
        if self.payload is not None:
            mass, gains = self.payload
            payload = {"mass": mass, "gain_sd": [each if each < COARSEST else None for each in gains.tolist()]}
        return {
            "plant": self.plant,
            "joints": list(self.joints),
            "seconds": self.seconds,
            "period": self.series.period,
            "start": self.series.start.tolist(),
            "criterion": self.criterion.value(self.series),
            "limits": bounded | {"floor": self.limits.floor},
            "parameters": self.parameters,
            "unknown_joints": list(self.forecast.unknown),
            "payload": payload,
        }

    def nominal_torques(self, times: Array) -> Array:
        """What the nominal robot needs (nstep x njoint), in N m or N."""
        return self.problem.torques(*self.at(times))


def excite(
    nominal: str | Path | Mapping[str, Any],
    *,
    seconds: float = 30.0,
    limits: str | Path | None = None,
    noise: LogNoise | None = None,
    seed: int = 1,
) -> Excitation:
    """The motion to record of a robot, and what a log of it will say: `write_motion` writes it.

    Args:
        nominal: the nominal robot: the name of a shipped plant, or the path of a plant file, an MJCF or a URDF;
            or a dict with the keys of a plant file.
        seconds: of the motion.
        limits: a file of limits; what it leaves out is as the robot's file says, or as usual.
        noise: of the log.
        seed: of the search.

    Raises:
        PlantError: the robot or the limits cannot be used, or no motion keeps them.

    Example:
        >>> motion = metaid.excite("one-link", seconds=10)
        >>> motion.frame().columns.tolist()
        ['time', 'angle_1', 'speed_1', 'acceleration_1', 'nominal_torque_1']
    """
    if not SHORTEST <= seconds <= LONGEST:
        raise PlantError(f"a motion of {seconds:g} s (allowed: {SHORTEST:g} to {LONGEST:g} s)")
    noise = noise or LogNoise()
    plant = load_plant(nominal)
    own = usual_limits(plant) if limits is None else read_limits(Path(limits), plant)
    problem = problem_of(plant, own, seconds / max(round(seconds / PERIOD), 1))
    with threadpool_limits(1):  # matrices this small are slower on several
        criterion = criterion_of(problem, seconds, noise, seed)
        first = improved(problem, criterion, best_of_random(problem, criterion, seed), seed)
        series = first[1]
        information, nothing = criterion.information(series), np.eye(len(criterion.scales))
        beside = replace(criterion, before=information)
        others = (first, best_of_random(problem, beside, seed + 1, SECOND))
        another = max(others, key=lambda each: beside.value(each[1]))
        _, second = improved(problem, beside, another, seed + 1, SECOND)
        usual = _deviations(information)
        return Excitation(
            plant.name,
            plant.joint_names,
            series,
            seconds,
            problem,
            criterion,
            forecast(problem, series, seconds, noise),
            _deviations(information + criterion.information(second) - nothing) / usual,
            _deviations(2.0 * information - nothing) / usual,
            None if problem.model.is_chain else _payload(plant, criterion, series),
        )


def problem_of(plant: ArmPlant | MujocoPlant, limits: Limits, period: float) -> MotionSearch:
    """What is searched of a robot."""
    model, tree = model_of(plant), plant.tree
    nominal = np.concatenate([model.nominal, tree.damping, tree.coulomb])
    if isinstance(plant, MujocoPlant):
        return MotionSearch(model, nominal, limits, period, None)
    from metaid.excitation.contacts import Contacts  # loads MuJoCo

    return MotionSearch(model, nominal, limits, period, Contacts(plant, limits.floor))


def criterion_of(problem: MotionSearch, seconds: float, noise: LogNoise, seed: int) -> Criterion:
    """What is best: torques have noise as a share of what random motions need.

    Args:
        problem: what is searched.
        seconds: of the log.
        noise: of it.
        seed: of the motions.

    Raises:
        PlantError: no motion keeps the limits.
    """
    model = problem.model
    drawn = [rows @ problem.nominal for _, _, rows in draws(problem, [seed, 2], USUAL)]
    if not drawn:
        why = problem.refused.most_common(1)[0][0]
        raise PlantError(f"no motion was found that keeps its limits: {why} (allowed: wider limits, another home)")
    needed = np.sqrt(np.mean([(torques**2).mean(axis=0) for torques in drawn], axis=0))
    usual = np.maximum(needed, LEAST * needed.max())
    bodies = np.sqrt(np.maximum(np.diag(model.covariance), 1e-300))
    scales = np.concatenate([bodies, usual / problem.limits.speed, usual])
    return Criterion(model, scales, max(noise.torque, 1e-4) * usual, seconds / (2.0 * LASTS))


def _deviations(information: Array) -> Array:
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))), dtype=np.float64)


def _payload(plant: SimulatedPlant, criterion: Criterion, series: Series) -> tuple[float, Array]:
    """A payload in kg at the last link's centre of mass, and the standard deviations of the drives' gains (njoint) by
    the difference of two logs along the same motion.
    """
    tree = plant.tree
    mass = float(f"{PAYLOAD * tree.mass.sum():.1g}")
    loaded = replace(tree, mass=tree.mass + mass * (np.arange(tree.njoint) == tree.njoint - 1))
    motion = series.over(200)
    carried = np.sqrt(((joint_torque(loaded, *motion) - joint_torque(tree, *motion)) ** 2).mean(axis=0))
    with np.errstate(divide="ignore"):
        return mass, OF_TWO * criterion.noise / (np.sqrt(criterion.readings) * carried)
