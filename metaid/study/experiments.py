"""The experiment of a study on a plant with faults or on a rig, as the estimate needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from metaid.episode import Episode
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, SocketSettings, Start
from metaid.study.calibration import start_spread
from metaid.study.loops import loop_of_plant, loop_of_rig
from metaid.study.pushing import rest_deviations
from metaid.study.settings import EstimateSettings
from metaid.study.spec import PushedSettings, StudySpec

if TYPE_CHECKING:
    from metaid.estimation import Experiment, LogUnknowns


def noisy_experiment(
    plant: MujocoPlant, spec: StudySpec, episode: Episode, nominal: Lumps, unknowns: LogUnknowns, start_speeds: Array
) -> Experiment:
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
    from metaid.estimation import (
        ChainLaws,
        Experiment,
        searched_faults,
        upright,
    )  # loads numba, which most readers do without

    faults, wanted = plant.settings.faults, spec.study.estimate
    noise, spread = rest_deviations(plant, spec, episode), spread_of_pushes(plant, episode.pushes)
    loop = loop_of_plant(plant.timestep, faults, noise, spread, wanted, episode.lead)
    return Experiment(
        laws=ChainLaws(nominal, unknowns.gravity),
        unknowns=unknowns,
        timestep=plant.timestep,
        starts=upright(start_speeds),
        loop=loop,
        faults=searched_faults(wanted.searched_faults, unknowns, start_speeds, wanted.teeth),
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
    unknowns: LogUnknowns,
    start_speeds: Array,
) -> Experiment:
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
    from metaid.estimation import (
        ChainLaws,
        Experiment,
        searched_faults,
        upright,
    )  # loads numba, which most readers do without

    noise, spread = (None, None) if pushed is None else (pushed.angle_noise, start_spread(pushed))
    loop = loop_of_rig(rig, noise, spread, wanted, episode.lead)
    return Experiment(
        laws=ChainLaws(nominal, unknowns.gravity),
        unknowns=unknowns,
        timestep=loop.timestep,
        starts=upright(start_speeds),
        loop=loop,
        faults=searched_faults(wanted.searched_faults, unknowns, start_speeds, wanted.teeth),
        takes_up=wanted.takes_up_faults,
    )
