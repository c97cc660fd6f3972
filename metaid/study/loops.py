"""How the plant of a study is controlled and read, as far as the estimate is told: `Loop`, of any robot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from metaid.plant import SocketSettings, of_each, slope_weights
from metaid.study.arm import StudiedArm
from metaid.study.calibration import QUIETEST_RIG, start_spread
from metaid.study.chain import StudiedChain
from metaid.study.spec import StudySpec

if TYPE_CHECKING:
    from metaid.estimation import Loop

QUIETEST = 2e-7  # rad: so far a twin agrees with a sensor that has no noise, after pushes that let rounding grow
LONGEST_STEP = 3e-3  # s, of the twin of a rig that moves continuously: `study check` says what its steps are wrong by


def loop_of(spec: StudySpec, robot: StudiedArm | StudiedChain) -> Loop:
    """That of a simulated plant by what its user states of it, but for faults that are searched; that of a rig by what
    was measured at it, where the resolution of its encoders is what its readings show.
    """
    from metaid.estimation import Loop  # loads numba, which most readers of a study do without

    wanted, lead = spec.study.estimate, spec.study.episode.lead
    torque_limits = of_each(wanted.torque_limit, len(spec.joints))
    if isinstance(spec.plant, SocketSettings):
        rig, pushed = spec.plant, spec.pushed  # None before it is measured
        is_continuous = rig.motion == "continuous"
        substeps = math.ceil(rig.timestep / LONGEST_STEP) if is_continuous else 1
        angle_noise = np.zeros(rig.joints) if pushed is None else np.array(pushed.angle_noise)
        return Loop(
            timestep=rig.timestep / substeps,
            noise=np.maximum(angle_noise, QUIETEST_RIG),
            speed_weights=slope_weights(rig.timestep),
            start_spread=None if pushed is None else start_spread(pushed),
            substeps=substeps,
            lead=lead,
            torque_limits=torque_limits,
            has_unknown_encoders=True,
            is_continuous=is_continuous,
        )
    faults = spec.faults
    of_encoder = faults.encoder_step / np.sqrt(12.0)  # at rest a coarse one shows no noise
    return Loop(
        timestep=spec.plant.timestep,
        noise=np.maximum(np.hypot(robot.resting_noise(), of_encoder), QUIETEST),
        speed_weights=slope_weights(spec.plant.timestep * faults.control_every),
        start_spread=robot.start_spread(),
        substeps=faults.control_every,
        delay=0 if "delay" in wanted.undeclared_faults else faults.delay,
        lead=lead,
        torque_limits=torque_limits,
    )
