"""What is measured at a rig when a study of it is created: the noise of its sensors at rest, how its pushes begin, and
by how much the same push differs from one time to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from metaid.episode import Calibration, elsewhere, natural_time
from metaid.errors import PlantError
from metaid.models import Array, Chain, ChainModel
from metaid.models.tree import Tree, joint_torque
from metaid.plant import ArmStart, SocketPlant, Start
from metaid.study.spec import PushedSettings, StudySpec

QUIETEST_RIG = 1e-4  # rad: the least noise that readings of a rig are taken to have, that of an encoder of 14 bits
REPEATS = 4  # of each push in a calibration; a power of two, so that the mean of equal speeds is one of them
RESTING = 2.0  # natural times for which a chain stands at rest
FEWEST_READINGS, MOST_READINGS = 20, 200  # at rest
DRIFT = 4  # coefficients of what a rig at rest may drift by in FEWEST_READINGS; what is left is noise
UPRIGHT = 0.5  # rad from the upright in which every joint of a chain at rest must be
AWAY = 0.3  # rad or m, and a share of the fastest joint: how far from what an arm was asked a push may begin
LARGEST_IMPULSE = 1e4  # N s; a rig that needs more has not answered to its trial pushes
LARGEST_SPREAD = 0.2  # of an impulse: what a push may differ by from one time to the next
RESTLESS = 2.0  # of the variance right after pushes: a joint whose speed has more of it at rest is moved there
LEAST_SQUARE = 1e-12  # rad²/s²: pushes that give less give nothing
LEAST_TOLERANCE = 0.02  # of the fastest joint of a push: what it may differ by where the calibration showed less
CHANCE = 1e-5  # that an honest push is refused


def calibrate_chain(plant: SocketPlant, nominal: Chain, pushes: Array, repeats: int) -> PushedSettings:
    """What is measured at a rig that is a chain, of its sensors and of its `pushes`.

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
    wanted = round(RESTING * natural_time(nominal, plant.gravity) / plant.timestep)
    count = int(np.clip(wanted, FEWEST_READINGS, MOST_READINGS))
    still, law = Start.upright(np.zeros(plant.njoint)), ChainModel(nominal.lumps, plant.gravity)
    angle_noise, speed_noise = _noise(_held(plant, still, count, law.torque))
    angles, joint_speeds = np.moveaxis(_begun(plant, [Start.upright(push) for push in different]), 2, 0)
    speeds = joint_speeds.mean(axis=0)
    differing = np.sqrt(joint_speeds.var(axis=0, ddof=1).mean(axis=0))
    noise = _push_noise(joint_speeds - speeds, _per_share(different, speeds), speed_noise)
    if not noise <= LARGEST_SPREAD:
        raise PlantError(
            f"plant {plant.name}: the same push differs by {noise:.0%} from one time to the next "
            f"(allowed: at most {LARGEST_SPREAD:.0%}; an estimate needs pushes that can be repeated)"
        )
    return PushedSettings(
        impulses=pushes.tolist(),
        angles=(0.0 * pushes).tolist(),
        speeds=np.tile(speeds, (repeats, 1)).tolist(),
        push_noise=noise,
        angle_spread=np.sqrt(np.maximum((angles**2).mean(axis=(0, 1)) - angle_noise**2, 0.0)).tolist(),
        speed_spread=np.sqrt(np.minimum(speed_noise, differing) ** 2 / REPEATS).tolist(),
        angle_noise=angle_noise.tolist(),
        speed_noise=speed_noise.tolist(),
    )


def calibrate_arm(plant: SocketPlant, nominal: Tree, starts: Sequence[ArmStart]) -> PushedSettings:
    """What is measured at a rig that is an arm: it is held once under the nominal law, and brought to each start
    REPEATS times. A coordinate is known no better than QUIETEST_RIG: an encoder that shows no noise has steps.

    Raises PlantError where a push begins elsewhere than it was asked to, LostPlant where the rig does not answer.
    """
    still = np.zeros(plant.njoint)
    at_rest = ArmStart(starts[0].pose, still)
    noise = _noise(_held(plant, at_rest, FEWEST_READINGS, lambda pose, _: joint_torque(nominal, pose, still, still)))
    seen = _begun(plant, starts, _refuse_elsewhere)
    variance = ((seen - seen.mean(axis=0)) ** 2).sum(axis=0).mean(axis=0) / (REPEATS - 1) - noise**2
    least = np.stack([np.maximum(noise[0], np.sqrt(REPEATS) * QUIETEST_RIG), noise[1]])
    spread = np.sqrt((1.0 + 1.0 / REPEATS) * np.maximum(variance, 0.0) + least**2 / REPEATS)
    poses, speeds = seen.mean(axis=0).swapaxes(0, 1)
    return PushedSettings(
        angles=poses.tolist(),
        speeds=speeds.tolist(),
        angle_spread=spread[0].tolist(),
        speed_spread=spread[1].tolist(),
        angle_noise=noise[0].tolist(),
        speed_noise=noise[1].tolist(),
    )


def _noise(rest: Array) -> Array:
    """The standard deviation of angles in rad and of speeds in rad/s (2 x njoint) about a slow drift, from readings at
    rest (nreading x 2 x njoint). A rig that noise of its torques moves drifts otherwise in each part of them.
    """
    drifts = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, FEWEST_READINGS), DRIFT))[0]
    parts = rest[: len(rest) // FEWEST_READINGS * FEWEST_READINGS].reshape(-1, FEWEST_READINGS, rest[0].size)
    left = parts - drifts @ (drifts.T @ parts)
    # A reading that never changes has no noise; what the projection leaves of it is rounding.
    left[..., (parts == parts[0, 0]).all(axis=(0, 1))] = 0.0
    freedom = len(parts) * (FEWEST_READINGS - DRIFT)
    deviations: Array = np.sqrt((left**2).sum(axis=(0, 1)) / freedom)
    return deviations.reshape(rest.shape[1:])


def _held(plant: SocketPlant, start: Start | ArmStart, count: int, torque: Callable[[Array, Array], Array]) -> Array:
    """So many readings (nreading x 2 x njoint), joint coordinates and speeds, of a rig at rest that a law holds; fewer
    of a chain that noise of its torques lets fall.

    Args:
        plant: the rig.
        start: where it is to rest.
        count: of the readings.
        torque: the law, of joint coordinates and speeds (njoint each).

    Raises:
        PlantError: a chain does not stand upright for FEWEST_READINGS.
    """
    seen: list[tuple[Array, Array]] = []
    try:
        plant.push(start)
        for _ in range(count):
            angles, speeds = plant.states()
            if isinstance(start, Start) and not (np.abs(angles) <= UPRIGHT).all():
                if len(seen) >= FEWEST_READINGS:
                    break
                raise PlantError(
                    f"plant {plant.name}: it does not stand when it is not pushed: joint angles {angles.tolist()} rad "
                    f"at tick {len(seen)} (allowed: within {UPRIGHT:g} rad of the upright)"
                )
            seen.append((angles, speeds))
            plant.apply_torque(torque(angles, speeds))
            plant.step()
    finally:
        plant.stop()
    return np.array(seen)


def _begun(
    plant: SocketPlant, starts: Sequence[Any], check: Callable[[str, Any, Array], None] = lambda what, start, seen: None
) -> Array:
    """Joint coordinates and speeds (REPEATS x npush x 2 x njoint) right after each of the pushes that begin from these
    `starts`; which push it is, where it was to begin, and these (2 x njoint) go through a `check`.
    """
    seen = []
    for start in [*starts] * REPEATS:
        try:
            plant.push(start)
            seen.append(np.stack(plant.states()))
        finally:
            plant.stop()
        check(f"plant {plant.name}: push {(len(seen) - 1) % len(starts) + 1}", start, seen[-1])
    return np.array(seen).reshape(REPEATS, len(starts), 2, plant.njoint)


def _refuse_elsewhere(what: str, start: ArmStart, seen: Array) -> None:
    """Raises PlantError where `what` was pushed began elsewhere than at a `start`: as it was `seen` (2 x njoint)."""
    if (found := elsewhere(seen, np.stack([start.pose, start.speeds]), AWAY, AWAY)) is not None:
        raise PlantError(f"{what} was to begin elsewhere: {found[0]} (allowed: {found[1]})")


def _per_share(impulses: Array, start_speeds: Array) -> Array:
    """What all of each impulse gives the joints (npush x njoint x nimpulse), in rad/s; from the `impulses` (npush x
    njoint), in N s, and the joint speeds that they gave (npush x njoint), in rad/s, which are linear in them.
    """
    response = np.linalg.lstsq(impulses, start_speeds, rcond=None)[0].T
    return np.asarray(response * impulses[:, None], dtype=np.float64)


def _push_noise(deviations: Array, per_share: Array, speed_noise: Array) -> float:
    """By which share of itself an impulse differs from one time to the next, as a standard deviation, by `deviations`
    of joint speeds from their means (nrepeat x npush x njoint). All of each impulse gives the joints `per_share` (npush
    x njoint x nimpulse), in rad/s. Joints that noise of torques moves at rest, which moves nothing right after a push,
    do not tell.
    """
    variance = (deviations**2).sum(axis=(0, 1)) / (len(deviations) - 1)
    read = len(per_share) * speed_noise**2
    tells = read <= RESTLESS * variance
    share = (variance - read)[tells].sum() / max((per_share[:, tells] ** 2).sum(), LEAST_SQUARE)
    return float(np.sqrt(max(share, 0.0)))


def start_spread(pushed: PushedSettings) -> Array | None:
    """A root of the covariance of the joint speeds, in rad/s, right after each push about those that were measured
    (npush x njoint x njoint), or of the joint coordinates and speeds (npush x 2 njoint x 2 njoint) where coordinates
    differ, too; None where all pushes were alike. Each impulse differs by itself, and each speed.
    """
    speeds, of_angles, of_speeds = (
        np.array(each) for each in (pushed.speeds, pushed.angle_spread, pushed.speed_spread)
    )
    if not (pushed.push_noise or of_angles.any() or of_speeds.any()):
        return None
    npush, n = speeds.shape
    covariance = np.diag(of_speeds**2) + (1.0 + 1.0 / REPEATS) * _differing(pushed)
    values, vectors = np.linalg.eigh(covariance)
    roots: Array = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    if not of_angles.any():
        return roots
    both = np.zeros((npush, 2 * n, 2 * n))
    both[:, :n, :n], both[:, n:, n:] = np.diag(of_angles), roots
    return both


def _differing(pushed: PushedSettings) -> Array:
    """Covariance of the joint speeds (npush x njoint x njoint), in rad²/s², right after each push from one time to the
    next. Impulses differ, or the speeds that they give: either alone may be all of it.
    """
    speeds = np.array(pushed.speeds)
    each = speeds[:, :, None] * np.eye(speeds.shape[1])
    if not pushed.push_noise:
        return 0.0 * each
    by_impulses = _per_share(np.array(pushed.impulses), speeds)
    each *= np.linalg.norm(by_impulses) / np.linalg.norm(speeds)
    share = pushed.push_noise * np.concatenate([by_impulses, each], axis=-1)
    return np.asarray(share @ share.transpose(0, 2, 1))


def calibration_of(spec: StudySpec, pushed: PushedSettings, nominal: Chain) -> Calibration:
    """What the readings of every trial are compared with: what was measured at the rig of a study when it was `pushed`.
    The forces of the `nominal` chain bound the accelerations.
    """
    from scipy.special import stdtrit  # slow to load, and only rigs need it

    start_speeds, speed_noise = np.array(pushed.speeds), np.array(pushed.speed_noise)
    variance = (1.0 + 1.0 / REPEATS) * (np.diagonal(_differing(pushed), axis1=1, axis2=2) + speed_noise**2)
    freedom = (REPEATS - 1) * len(start_speeds) // spec.study.episode.repeats
    deviations = float(stdtrit(freedom, 1.0 - CHANCE / 2.0))  # few repeats tell the spread but roughly
    least = LEAST_TOLERANCE * np.abs(start_speeds).max(axis=1, keepdims=True)
    tolerance = deviations * np.sqrt(variance) + least
    return Calibration(start_speeds, tolerance, np.array(pushed.angle_noise), speed_noise, nominal, spec.gravity)
