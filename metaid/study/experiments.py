"""The experiment of a study on a plant with faults, as the estimate needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from metaid.episode import Episode
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, Start, slope_weights
from metaid.study.pushing import rest_deviations
from metaid.study.settings import StudySpec

if TYPE_CHECKING:
    from metaid.estimation import NoisyExperiment, Unknowns

QUIETEST = 1e-9  # rad: so far a twin agrees with a sensor that has no noise


def noisy_experiment(
    plant: MujocoPlant, spec: StudySpec, episode: Episode, nominal: Lumps, unknowns: Unknowns, start_speeds: Array
) -> NoisyExperiment:
    """What the estimate knows of a plant with faults: how it is controlled, and what its user states of its pushes and
    of its encoders. Noise is that of the plant at rest. All else shows in the misfit.

    Args:
        plant: that is pushed.
        spec: of the study.
        episode: what is done to the plant.
        nominal: the lumps that candidates are factors of.
        unknowns: what an estimate is of.
        start_speeds: joint speeds (npush x njoint) that the pushes give in a calibration, in rad/s.
    """
    from metaid.estimation import NoisyExperiment  # loads numba, which most readers of a study do without

    faults, spread = plant.settings.faults, None
    if faults.push_noise:
        response = np.array([plant.start_speeds(Start.upright(impulse)) for impulse in np.eye(plant.njoint)]).T
        spread = response * (faults.push_noise * episode.pushes[:, None])
    of_encoder = faults.encoder_step / np.sqrt(12.0)  # at rest a coarse one shows no noise
    return NoisyExperiment(
        nominal=nominal,
        unknowns=unknowns,
        gravity=plant.gravity,
        timestep=plant.timestep,
        start_speeds=start_speeds,
        start_spread=spread,
        noise=np.maximum(np.hypot(rest_deviations(plant, spec, episode), of_encoder), QUIETEST),
        speed_weights=slope_weights(spec.timestep),
        substeps=faults.control_every,
        delay=faults.delay,
        lead=episode.lead,
    )
