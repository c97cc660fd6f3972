"""Pushes: impulses that give the links the speeds that are wanted."""

from __future__ import annotations

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array, Chain
from metaid.plant import MujocoPlant, Plant, Start

REACH = 1.0  # rad that the fastest link of a rich push coasts through within the horizon: short of the fall limit

TRIAL_IMPULSE = 1.0 / 16.0  # N s, where it is not known yet what a push does; a power of two, so nothing is rounded

NO_ANSWER = 1e-9  # of the speed of the fastest joint: a slower one has not answered to a push

SLOWEST_LINK, SLOWEST_JOINT = 0.3, 0.2  # of the peak speed, in a rich push


def pushed_speeds(plant: Plant, pushes: Array) -> Array:
    """The absolute link speeds (npush x njoint), in rad/s, that are seen right after each of the `pushes` (npush x
    njoint), in N s. A simulated plant is not moved: it knows them.
    """
    if isinstance(plant, MujocoPlant):
        return np.array([np.cumsum(plant.start_speeds(Start.upright(impulses))) for impulses in pushes])
    seen = []
    for impulses in pushes:
        plant.push(Start.upright(impulses))
        seen.append(np.cumsum(plant.states()[1]))
        plant.stop()
    return np.array(seen)


def pushes_for(plant: Plant, speeds: Array) -> Array:
    """The impulses (npush x njoint), in N s, that give the plant these absolute link `speeds` (npush x njoint), in
    rad/s.

    Found as one would on a rig: one trial push at each link, watching the speeds; they are linear in the impulses.
    Raises PlantError where a joint does not answer to them.
    """
    response = pushed_speeds(plant, TRIAL_IMPULSE * np.eye(plant.njoint)).T / TRIAL_IMPULSE
    _refuse_no_answer(plant, response)
    impulses: Array = np.asarray(np.linalg.solve(response, speeds.T).T, dtype=np.float64)
    return impulses


def _refuse_no_answer(plant: Plant, response: Array) -> None:
    """Raises PlantError where the link speeds per impulse of a plant, its `response` (njoint x npush) in rad/s per N s,
    do not tell what a push does.
    """
    fastest = np.abs(np.diff(response, axis=0, prepend=0.0)).max(axis=1)  # of each joint
    for joint in np.flatnonzero(~(fastest > NO_ANSWER * fastest.max()))[:1]:
        raise PlantError(
            f"plant {plant.name}: joint {joint + 1} does not answer: no trial push of {TRIAL_IMPULSE:g} N s gives it "
            "any speed (allowed: a rig of which every joint turns when it is pushed)"
        )
    if np.linalg.matrix_rank(response) < len(response):
        raise PlantError(
            f"plant {plant.name}: trial pushes at different links give all joints the same speeds "
            "(allowed: a rig whose speeds tell which link was pushed)"
        )


def tip_push(plant: Plant, peak_speed: float) -> Array:
    """One push at the tip alone (1 x njoint), in N s, that gives the plant's fastest link `peak_speed`, in rad/s.
    Raises PlantError where nothing moves.
    """
    impulses = TRIAL_IMPULSE * np.eye(plant.njoint)[-1:]
    fastest = float(np.abs(pushed_speeds(plant, impulses)).max())
    if not fastest > 0.0:
        raise PlantError(f"plant {plant.name}: no joint answers to a trial push of {TRIAL_IMPULSE:g} N s at the tip")
    return impulses * (peak_speed / fastest)


def rich_speeds(njoint: int, count: int, seed: int) -> Array:
    """Link speeds (count x njoint) as fractions of a peak speed: a random sign and 0.3 to 1 for every link.

    No joint gets less than 0.2 of the peak: one that hardly moves tells little of the lumps about it.
    """
    random = np.random.default_rng(seed)
    speeds = np.zeros((count, njoint))
    for push in range(count):
        below = 0.0
        for link in range(njoint):
            speed = below
            while abs(speed - below) < SLOWEST_JOINT:
                speed = random.uniform(SLOWEST_LINK, 1.0) * random.choice([-1.0, 1.0])
            speeds[push, link] = below = speed
    return speeds


def rich_pushes(plant: Plant, count: int, peak_speed: float, seed: int) -> Array:
    """Random pushes (count x njoint), in N s, that each turn every link and joint.

    Args:
        plant: that is pushed; it is struck to find out how it answers.
        count: of the pushes.
        peak_speed: the largest speed that a link may get, in rad/s.
        seed: of the pushes.
    """
    return pushes_for(plant, peak_speed * rich_speeds(plant.njoint, count, seed))


def natural_time(chain: Chain, gravity: float) -> float:
    """√(l/g) for the chain's mean link length, in s: what sets every time scale of its motion."""
    return float(np.sqrt(chain.length.mean() / gravity))
