"""How the plant of a study is controlled and read, as far as the estimate is told: `Loop`, of any robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from metaid.models import Array
from metaid.plant import FaultSettings, SocketSettings, joint_limits, slope_weights
from metaid.study.settings import StudySettings

if TYPE_CHECKING:
    from metaid.estimation import Loop

QUIETEST = 2e-7  # rad: so far a twin agrees with a sensor that has no noise, after pushes that let rounding grow
QUIETEST_RIG = 1e-4  # rad: the least noise that readings of a rig are taken to have, that of an encoder of 14 bits
LONGEST_STEP = 3e-3  # s, of the twin of a rig that moves continuously: `study check` says what its steps are wrong by


def loop_of_rig(
    rig: SocketSettings,
    angle_noise: Sequence[float] | None,
    start_spread: Array | None,
    study: StudySettings,
) -> Loop:
    """That of a rig, by what was measured at it. The resolution of its encoders is what its readings show.

    Args:
        rig: the plant file.
        angle_noise: standard deviations of readings at rest (njoint), in rad; None before they are measured.
        start_spread: a root of the covariance of how its pushes begin; None where all are alike.
        study: what its file says.
    """
    from metaid.estimation import Loop  # loads numba, which most readers of a study do without

    is_continuous = rig.motion == "continuous"
    substeps = math.ceil(rig.timestep / LONGEST_STEP) if is_continuous else 1
    noise = np.zeros(rig.joints) if angle_noise is None else np.array(angle_noise)
    return Loop(
        timestep=rig.timestep / substeps,
        noise=np.maximum(noise, QUIETEST_RIG),
        speed_weights=slope_weights(rig.timestep),
        start_spread=start_spread,
        substeps=substeps,
        lead=study.episode.lead,
        torque_limits=joint_limits(study.estimate.torque_limit, rig.joints),
        has_unknown_encoders=True,
        is_continuous=is_continuous,
    )


def loop_of_plant(
    timestep: float,
    faults: FaultSettings,
    angle_noise: Array,
    start_spread: Array | None,
    study: StudySettings,
) -> Loop:
    """That of a simulated plant, by what its user states of it. What is said of faults that are searched is not used.

    Args:
        timestep: of the simulation, in s.
        faults: of the plant file.
        angle_noise: standard deviations of its sensors (njoint), in rad, without what encoder steps add.
        start_spread: a root of the covariance of how its pushes begin; None where all are alike.
        study: what its file says.
    """
    from metaid.estimation import Loop  # loads numba, which most readers of a study do without

    of_encoder = faults.encoder_step / np.sqrt(12.0)  # at rest a coarse one shows no noise
    return Loop(
        timestep=timestep,
        noise=np.maximum(np.hypot(angle_noise, of_encoder), QUIETEST),
        speed_weights=slope_weights(timestep * faults.control_every),
        start_spread=start_spread,
        substeps=faults.control_every,
        delay=0 if "delay" in study.estimate.undeclared_faults else faults.delay,
        lead=study.episode.lead,
        torque_limits=joint_limits(study.estimate.torque_limit, len(angle_noise)),
    )
