"""Chains to identify and what is seen of them: MuJoCo is the plant, so nothing is shared with the twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from chain_studies import random_chain

from metaid.compiled import CompiledLoop, FaultyLoop, fastest_step
from metaid.episode import RICH_FALL_LIMIT, Episode, FallRule, natural_time, rich_pushes, window_ends
from metaid.estimation import ChainLaws, LogUnknowns, ReadTrial, WatchedTrial, upright
from metaid.estimation.noisy.loop import filtered_speeds
from metaid.models import Array, Chain, Lumps
from metaid.plant import FaultSettings, MujocoPlant, PlantSettings, Start, chain_of, slope_weights

GRAVITY, TIMESTEP, NOISE = 9.81, 0.002, 1e-3


@dataclass(frozen=True)
class Watched:
    """A plant, the nominal model that is wrong of it, and its pushes."""

    plant: MujocoPlant
    nominal: Chain
    episode: Episode
    starts: Array

    def trial(self, law: Lumps, windows: int = 6) -> WatchedTrial:
        """What the plant shows under this `law`."""
        ends = window_ends(self.episode.steps, windows, 0.5 ** (windows - 1))
        seen = CompiledLoop(self.plant, replace(self.episode, window_ends=ends)).run(law).windows
        assert seen is not None
        return WatchedTrial(law, TIMESTEP, upright(self.starts), seen, self.episode.stiffness)

    def read_trial(self, law: Lumps) -> ReadTrial:
        """What its sensors read under this `law`, and what it was sent."""
        faults, npush, njoint = self.plant.settings.faults, *self.starts.shape
        episode = FaultyLoop(self.plant, self.episode, fastest_step(self.plant))
        kept = episode.run(law).angles
        readings = np.zeros((npush, self.episode.steps + 1, njoint))
        steps = np.zeros(npush, dtype=np.int64)
        for push, angles in enumerate(kept):
            readings[push, : len(angles)], steps[push] = angles, len(angles) - 1
        speeds = filtered_speeds(readings, self.starts, slope_weights(TIMESTEP))
        torques = ChainLaws(self.nominal.lumps, GRAVITY).commanded(law, readings, speeds)
        spread = None
        if faults.push_noise:
            response = np.array([self.plant.start_speeds(Start.upright(impulse)) for impulse in np.eye(njoint)]).T
            spread = response * (faults.push_noise * self.episode.pushes[:, None])
        return ReadTrial(TIMESTEP, readings, torques, steps, upright(self.starts), spread, np.full(njoint, NOISE))


def watched(
    nlink: int,
    seed: int = 0,
    damping: float = 0.0,
    faults: FaultSettings | None = None,
    longer: float = 1.0,
    stiffness: float = 0.0,
    springs: Sequence[float] = (),
    chain: int | None = None,
) -> Watched:
    """A random chain, its joints with this `damping` and these `springs`, watched for `longer` than a study
    would; `stiffness` is the law's. Which `chain` it is follows from the `seed` of pushes and noise unless it is given.
    """
    true, nominal = random_chain(nlink, seed + 1 if chain is None else chain)
    each = zip(true, springs or nlink * (0.0,), strict=True)
    links = tuple(link.model_copy(update={"damping": damping, "stiffness": spring}) for link, spring in each)
    settings = PlantSettings(links=links, timestep=TIMESTEP, faults=faults or FaultSettings())
    plant, believed = MujocoPlant("chain", settings), chain_of(nominal)
    steps = round(1.5 * natural_time(believed, GRAVITY) / TIMESTEP)
    pushes = rich_pushes(plant, 2 * nlink, 1.0 / (steps * TIMESTEP), seed)
    wanted = {"keep_angles": True, "stiffness": stiffness, "seed": seed}
    episode = Episode(pushes, round(longer * steps), FallRule(RICH_FALL_LIMIT), **wanted)
    return Watched(plant, believed, episode, np.array([plant.start_speeds(start) for start in episode.starts]))


def raised(lumps: Lumps, factor: float) -> Lumps:
    """`lumps` with those of gravity larger by a `factor`: a law that makes a chain oscillate."""
    factors = np.ones(len(lumps.vector))
    factors[: lumps.nlink] = factor
    return lumps.scaled(factors)


def some_torque(seen: Watched) -> Array:
    """A share of what each joint needs (njoint), in N m: noise of the torques may be as large."""
    return 0.03 * LogUnknowns(seen.nominal.lumps, GRAVITY).torques(float(np.abs(seen.starts).max()))
