"""What the methods that know the torques see: a chain along exciting trajectories, measured perfectly or with noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from benchmarks.chains import Links
from metaid.episode import natural_time
from metaid.errors import StudyError
from metaid.models import Array, ChainModel
from metaid.plant import MujocoPlant, PlantSettings, chain_of
from metaid.results import BANDWIDTH, smooth_sinusoids, track

SWING, PERIODS, RUNS = 1.5, (4.0, 12.0), 8  # of the recorded motion: rad, natural times, trajectories
TIGHTNESS = 2.0 * BANDWIDTH  # of its feedback, in rad per natural time
NOISE = 1e-3  # rad
# The best of the spans and motions that were tried on these chains, so that the noisy rows are not a strawman:
FILTER_SPAN, FILTER_ORDER = 1.5, 5  # of the derivatives' filter, in natural times, and of its polynomial


@dataclass(frozen=True)
class Recording:
    """Joint `angles` (rad), `speeds` (rad/s), `accelerations` (rad/s²) and `torques` (N m), each (nrun x nsteps x
    njoint), at every `timestep` (s)."""

    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array
    timestep: float

    @property
    def seconds(self) -> float:
        """How long the plant moved for it, in s."""
        return self.angles[..., 0].size * self.timestep


def record(true: Links, nominal: Links, seed: int) -> Recording:
    """A plant of the `true` links along exciting trajectories, driven by computed torque of the `nominal` ones.

    The accelerations are those of the plant itself, as if measured perfectly.  Raises StudyError if control is lost.
    """
    plant = MujocoPlant("chain", PlantSettings(links=true))
    believed = chain_of(nominal)
    model = ChainModel(believed.lumps, plant.gravity)
    scale = natural_time(believed, plant.gravity)
    seen = []
    for run in range(RUNS):
        motion = smooth_sinusoids(plant.njoint, scale, plant.timestep, 1000 * seed + run, 1, SWING, PERIODS)
        seen.append(track(plant, model, model, motion, TIGHTNESS / scale))
        if len(seen[-1].angles) < len(motion.angles):
            raise StudyError(
                f"{plant.njoint} links, seed {seed}: the nominal model lost control of the recorded motion"
            )
    speeds = np.array([run.speeds for run in seen])
    return Recording(
        np.array([run.angles for run in seen])[:, :-1],
        speeds[:, :-1],
        np.diff(speeds, axis=1) / plant.timestep,
        np.array([run.torques for run in seen])[:, :-1],
        plant.timestep,
    )


def with_noise(clean: Recording, nominal: Links, gravity: float, seed: int) -> Recording:
    """The recording with normal noise on every angle, and speeds and accelerations that are filtered derivatives of
    it.
    """
    random = np.random.default_rng([seed, clean.angles.shape[2]])
    angles = clean.angles + NOISE * random.normal(size=clean.angles.shape)
    return filtered(angles, clean.torques, clean.timestep, natural_time(chain_of(nominal), gravity))


def filtered(angles: Array, torques: Array, timestep: float, scale: float, span: float = FILTER_SPAN) -> Recording:
    """A recording of noisy `angles` (rad) and commanded `torques` (N m), (nrun x nsteps x njoint): derivatives by
    Savitzky-Golay, which lags nowhere, over a `span` in units of the natural time `scale`, in s.

    The torques pass through the same filter.
    """
    window = max(round(span * scale / timestep), FILTER_ORDER + 2) | 1

    def smooth(signal: Array, derivative: int = 0) -> Array:
        result: Array = savgol_filter(signal, window, FILTER_ORDER, derivative, timestep, axis=1)
        return result

    return Recording(smooth(angles), smooth(angles, 1), smooth(angles, 2), smooth(torques), timestep)
