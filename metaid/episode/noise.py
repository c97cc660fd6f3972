"""The noise of an episode on a plant with faults."""

from __future__ import annotations

from dataclasses import replace

from metaid.episode.episode import Episode
from metaid.plant import FaultyPlant, Noise, draw, stream

RESTING = 1000  # readings of the plant at rest, which tell how far noise alone can throw one

DEADBAND = 5.0  # of their standard deviation: a reading so near the upright tells no side


def noise_of(plant: FaultyPlant, episode: Episode, number: int) -> Noise:
    """The noise of an `episode` in the trial of that `number`: the same whenever, wherever, after whatever and with
    whatever candidate it is run.
    """
    return draw(plant.faults, stream(episode.seed, number), episode.npush, episode.steps, plant.njoint)


def with_deadband(episode: Episode, plant: FaultyPlant) -> Episode:
    """The `episode` in which noise about the upright is no crossing."""
    return replace(episode, deadband=DEADBAND * float(plant.rest(RESTING, episode.seed).std()))
