"""What is measured at a rig when a study of it is created: the noise of its sensors at rest, what its pushes do, and by
how much the same push differs from one time to the next.
"""

from __future__ import annotations

import numpy as np

from metaid.episode import Calibration, natural_time
from metaid.errors import PlantError
from metaid.models import Array, Chain, ChainModel
from metaid.plant import SocketPlant, Start
from metaid.study.resting import FEWEST_READINGS, MOST_READINGS, REPEATS, noise_at_rest
from metaid.study.settings import PushedSettings

RESTING = 2.0  # natural times for which the rig stands at rest
UPRIGHT = 0.5  # rad from the upright in which every joint of a rig at rest must be
LARGEST_IMPULSE = 1e4  # N s; a rig that needs more has not answered to its trial pushes
LARGEST_SPREAD = 0.2  # of an impulse: what a push may differ by from one time to the next
LEAST_TOLERANCE = 0.02  # of the fastest joint of a push: what it may differ by where the calibration showed less
CHANCE = 1e-5  # that an honest push is refused


def calibrate(plant: SocketPlant, nominal: Chain, pushes: Array, repeats: int) -> PushedSettings:
    """What is measured at a rig of its sensors and of its `pushes`.

    Args:
        plant: the rig; it is brought to rest once, and pushed REPEATS times by each push.
        nominal: the chain whose law holds it at rest.
        pushes: of the study (npush x njoint), in N s.
        repeats: of every push in them.

    Raises:
        PlantError: it does not rest, or its pushes differ by more than LARGEST_SPREAD.
        LostPlant: it does not answer.
    """
    different = pushes[: len(pushes) // repeats]
    for push, impulses in enumerate(different):
        if not np.abs(impulses).max() <= LARGEST_IMPULSE:
            raise PlantError(
                f"plant {plant.name}: push {push + 1} would need an impulse of {np.abs(impulses).max():.3g} N s "
                f"(allowed: at most {LARGEST_IMPULSE:g}); the speeds after its trial pushes are too low to be believed"
            )
    angle_noise, speed_noise = noise_at_rest(rest_readings(plant, nominal))
    angles, joint_speeds = np.moveaxis(np.array([_begun(plant, different) for _ in range(REPEATS)]), 2, 0)
    speeds = np.cumsum(joint_speeds.mean(axis=0), axis=-1)
    noise = _push_noise(joint_speeds - joint_speeds.mean(axis=0), _per_share(different, _joints(speeds)), speed_noise)
    if not noise <= LARGEST_SPREAD:
        raise PlantError(
            f"plant {plant.name}: the same push differs by {noise:.0%} from one time to the next "
            f"(allowed: at most {LARGEST_SPREAD:.0%}; an estimate needs pushes that can be repeated)"
        )
    return PushedSettings(
        impulses=pushes.tolist(),
        speeds=np.tile(speeds, (repeats, 1)).tolist(),
        push_noise=noise,
        angle_spread=np.sqrt(np.maximum((angles**2).mean(axis=(0, 1)) - angle_noise**2, 0.0)).tolist(),
        angle_noise=angle_noise.tolist(),
        speed_noise=speed_noise.tolist(),
    )


def rest_readings(plant: SocketPlant, nominal: Chain) -> Array:
    """Joint angles in rad and speeds in rad/s (nreading x 2 x njoint) of a rig that stands upright under the law of its
    nominal model.  Raises PlantError where it does not stand.
    """
    law = ChainModel(nominal.lumps, plant.gravity)
    wanted = round(RESTING * natural_time(nominal, plant.gravity) / plant.timestep)
    seen: list[tuple[Array, Array]] = []
    try:
        plant.push(Start.upright(np.zeros(plant.njoint)))
        for _ in range(int(np.clip(wanted, FEWEST_READINGS, MOST_READINGS))):
            angles, speeds = plant.states()
            if not (np.abs(angles) <= UPRIGHT).all():
                raise PlantError(
                    f"plant {plant.name}: it does not stand when it is not pushed: joint angles {angles.tolist()} rad "
                    f"at tick {len(seen)} (allowed: within {UPRIGHT:g} rad of the upright)"
                )
            seen.append((angles, speeds))
            plant.apply_torque(law.torque(angles, speeds))
            plant.step()
    finally:
        plant.stop()
    return np.array(seen)


def _begun(plant: SocketPlant, pushes: Array) -> Array:
    """Joint angles and speeds (npush x 2 x njoint) right after each of the `pushes` (npush x njoint), in N s."""
    seen = []
    for impulses in pushes:
        plant.push(Start.upright(impulses))
        seen.append(plant.states())
        plant.stop()
    return np.array(seen)


def _joints(speeds: Array) -> Array:
    """Joint speeds (npush x njoint) from absolute link `speeds` (npush x njoint), in rad/s."""
    return np.diff(speeds, axis=1, prepend=0.0)


def _per_share(impulses: Array, start_speeds: Array) -> Array:
    """What all of each impulse gives the joints (npush x njoint x nimpulse), in rad/s; from the `impulses` (npush x
    njoint), in N s, and the joint speeds that they gave (npush x njoint), in rad/s, which are linear in them.
    """
    response = np.linalg.lstsq(impulses, start_speeds, rcond=None)[0].T
    return np.asarray(response * impulses[:, None], dtype=np.float64)


def _push_noise(deviations: Array, per_share: Array, speed_noise: Array) -> float:
    """By which share of itself an impulse differs from one time to the next, as a standard deviation.

    Args:
        deviations: of joint speeds from their means (nrepeat x npush x njoint), in rad/s.
        per_share: what all of each impulse gives the joints (npush x njoint x nimpulse), in rad/s.
        speed_noise: standard deviation of a speed reading (njoint), in rad/s.
    """
    variance = (deviations**2).sum() / (len(deviations) - 1) - len(per_share) * (speed_noise**2).sum()
    return float(np.sqrt(max(variance, 0.0) / (per_share**2).sum()))


def start_spread(pushed: PushedSettings) -> Array | None:
    """A root of the covariance of the joint speeds, in rad/s, right after each push about those that were measured
    (npush x njoint x njoint), or of the joint angles and speeds (npush x 2 njoint x 2 njoint) where angles differ, too;
    None where all pushes were alike. Each impulse differs by itself, and each speed.
    """
    speed_noise, angle_spread = np.array(pushed.speed_noise), np.array(pushed.angle_spread)
    if pushed.push_noise == 0.0 and not speed_noise.any() and not angle_spread.any():
        return None
    speeds = _joints(np.array(pushed.speeds))
    share = pushed.push_noise * np.concatenate(
        [_per_share(np.array(pushed.impulses), speeds), speeds[:, :, None] * np.eye(speeds.shape[1])], axis=-1
    )
    covariance = (1.0 + 1.0 / REPEATS) * share @ share.transpose(0, 2, 1) + np.diag(speed_noise**2) / REPEATS
    values, vectors = np.linalg.eigh(covariance)
    roots: Array = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    if not angle_spread.any():
        return roots
    npush, n = speeds.shape
    both = np.zeros((npush, 2 * n, 2 * n))
    both[:, :n, :n], both[:, n:, n:] = np.diag(angle_spread), roots
    return both


def calibration_of(pushed: PushedSettings, nominal: Chain, gravity: float, repeats: int) -> Calibration:
    """What the readings of every trial are compared with.

    Args:
        pushed: what was measured at the rig.
        nominal: the chain whose forces bound the accelerations.
        gravity: in m/s².
        repeats: of every push.
    """
    from scipy.special import stdtrit  # slow to load, and only rigs need it

    start_speeds, speed_noise = _joints(np.array(pushed.speeds)), np.array(pushed.speed_noise)
    share = pushed.push_noise * _per_share(np.array(pushed.impulses), start_speeds)
    variance = (1.0 + 1.0 / REPEATS) * ((share**2).sum(axis=-1) + speed_noise**2)
    freedom = (REPEATS - 1) * len(start_speeds) // repeats
    deviations = float(stdtrit(freedom, 1.0 - CHANCE / 2.0))  # few repeats tell the spread but roughly
    least = LEAST_TOLERANCE * np.abs(start_speeds).max(axis=1, keepdims=True)
    tolerance = deviations * np.sqrt(variance) + least
    return Calibration(start_speeds, tolerance, np.array(pushed.angle_noise), speed_noise, nominal, gravity)
