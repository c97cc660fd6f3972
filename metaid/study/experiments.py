"""The experiment of a study on a plant with faults or on a rig, as the estimate needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from metaid.episode import Episode
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, SocketSettings, Start, joint_limits, slope_weights
from metaid.study.calibration import start_spread
from metaid.study.pushing import rest_deviations
from metaid.study.settings import EstimateSettings, PushedSettings, StudySpec

if TYPE_CHECKING:
    from metaid.estimation import NoisyExperiment, Unknowns

QUIETEST = 1e-9  # rad: so far a twin agrees with a sensor that has no noise
QUIETEST_RIG = 1e-4  # rad: the least noise that readings of a rig are taken to have, that of an encoder of 14 bits
SUBSTEPS = 2  # of the twin of a rig that moves continuously, in each timestep of it


def noisy_experiment(
    plant: MujocoPlant, spec: StudySpec, episode: Episode, nominal: Lumps, unknowns: Unknowns, start_speeds: Array
) -> NoisyExperiment:
    """What the estimate knows of a plant with faults: how it is controlled, and what its user states of its pushes,
    of its encoders, and of the noise of its torques. Noise of its sensors is that of the plant at rest. What is said of
    faults that are searched is not used. All else shows in the misfit.

    Args:
        plant: that is pushed.
        spec: of the study.
        episode: what is done to the plant.
        nominal: the lumps that candidates are factors of.
        unknowns: what an estimate is of.
        start_speeds: joint speeds (npush x njoint) that the pushes give in a calibration, in rad/s.
    """
    from metaid.estimation import Loop, NoisyExperiment, searched_faults  # loads numba, which most readers do without

    faults, wanted = plant.settings.faults, spec.study.estimate
    of_encoder = faults.encoder_step / np.sqrt(12.0)  # at rest a coarse one shows no noise
    loop = Loop(
        timestep=plant.timestep,
        noise=np.maximum(np.hypot(rest_deviations(plant, spec, episode), of_encoder), QUIETEST),
        speed_weights=slope_weights(spec.timestep),
        start_spread=spread_of_pushes(plant, episode.pushes),
        substeps=faults.control_every,
        delay=0 if "delay" in wanted.undeclared_faults else faults.delay,
        lead=episode.lead,
        torque_limits=joint_limits(wanted.torque_limit, plant.njoint),
    )
    return NoisyExperiment(
        nominal=nominal,
        unknowns=unknowns,
        gravity=plant.gravity,
        timestep=plant.timestep,
        start_speeds=start_speeds,
        loop=loop,
        faults=searched_faults(wanted.searched_faults, unknowns, plant.gravity, start_speeds),
        takes_up=wanted.takes_up_faults and not faults.torque_noise,
        torque_noise=np.full(plant.njoint, faults.torque_noise) if faults.torque_noise else None,
    )


def spread_of_pushes(plant: MujocoPlant, pushes: Array) -> Array | None:
    """A root of the covariance (npush x njoint x njoint) of the joint speeds, in rad/s, that `pushes` (npush x njoint),
    in N s, give a plant about their means; None where pushes do not differ.
    """
    if not plant.settings.faults.push_noise:
        return None
    response = np.array([plant.start_speeds(Start.upright(impulse)) for impulse in np.eye(plant.njoint)]).T
    return np.asarray(response * (plant.settings.faults.push_noise * pushes[:, None]), dtype=np.float64)


def rig_experiment(
    rig: SocketSettings,
    pushed: PushedSettings | None,
    wanted: EstimateSettings,
    episode: Episode,
    nominal: Lumps,
    unknowns: Unknowns,
    start_speeds: Array,
) -> NoisyExperiment:
    """What the estimate knows of a rig: what was measured at it when the study was created. The resolution of its
    encoders is what its readings show.

    Args:
        rig: the plant file.
        pushed: what was measured; None before that, when it is taken to have as little noise as any rig.
        wanted: which faults are searched.
        episode: what is done to it.
        nominal: the lumps that candidates are factors of.
        unknowns: what an estimate is of.
        start_speeds: joint speeds (npush x njoint) that the pushes gave, in rad/s.
    """
    from metaid.estimation import Loop, NoisyExperiment, searched_faults  # loads numba, which most readers do without

    is_continuous = rig.motion == "continuous"
    substeps = SUBSTEPS if is_continuous else 1
    noise = np.zeros(rig.joints) if pushed is None else np.array(pushed.angle_noise)
    loop = Loop(
        timestep=rig.timestep / substeps,
        noise=np.maximum(noise, QUIETEST_RIG),
        speed_weights=slope_weights(rig.timestep),
        start_spread=None if pushed is None else start_spread(pushed),
        substeps=substeps,
        lead=episode.lead,
        torque_limits=joint_limits(wanted.torque_limit, rig.joints),
        has_unknown_encoders=True,
        is_continuous=is_continuous,
    )
    return NoisyExperiment(
        nominal=nominal,
        unknowns=unknowns,
        gravity=rig.gravity,
        timestep=loop.timestep,
        start_speeds=start_speeds,
        loop=loop,
        faults=searched_faults(wanted.searched_faults, unknowns, rig.gravity, start_speeds),
        takes_up=wanted.takes_up_faults,
    )
