"""Episodes of planar chains: struck at rest, counted about the upright, over at the first fall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from metaid.episode.pushed import Pushed
from metaid.episode.record import Record, Seen, crosses_at, crossings, energies, windows_of
from metaid.errors import EpisodeError
from metaid.models import Array, ChainModel, Lumps
from metaid.plant import Plant, Start


@dataclass(frozen=True)
class Planar:
    """A planar chain; its laws are lumps."""

    ends_at_fall: ClassVar[bool] = True
    measures: ClassVar[tuple[str, ...]] = ("count", "crossing", "spectral", "smoothed")

    def check_pushes(self, pushes: Array) -> None:
        if not np.isfinite(pushes).all() or not np.any(pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )

    def start(self, pose: Array, push: Array) -> Start:
        return Start(push, pose)

    def torques(self, law: Lumps, plant: Plant, episode: Pushed) -> Callable[[int, Array, Array], Array]:
        models = [ChainModel(law, plant.gravity, stiffness) for stiffness in episode.springs.tolist()]
        return lambda push, angles, speeds: models[push].torque(angles, speeds)

    def falls(self, episode: Pushed, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        rule = episode.fall_rule
        allowed = rule.allowed_speeds(np.cumsum(speeds))
        return lambda angles, speeds: rule.has_fallen(np.cumsum(angles), np.cumsum(speeds), allowed, timestep)

    def record(self, seen: Seen, episode: Pushed) -> Record:
        timestep, motions = seen.timestep, seen.motions
        shape, springs = episode.pushes.shape, episode.springs
        half_periods, span = np.zeros(shape, dtype=np.int64), np.zeros(shape)
        speed_energy, acceleration_energy = np.zeros(shape), np.zeros(shape)
        for push, ((angles, speeds), start) in enumerate(zip(motions, episode.starts, strict=False)):
            crosses = crosses_at(start, speeds[0])
            half_periods[push], span[push] = crossings(angles, crosses, timestep, episode.deadband)
            wanted = -springs[push] * angles[:-1]
            speed_energy[push], acceleration_energy[push] = energies(speeds, timestep, wanted)
        sums = half_periods, span, speed_energy, acceleration_energy
        kept = tuple(angles for angles, _ in motions) if episode.keep_angles else ()
        floor, windows = episode.noise_floor.energy, windows_of(seen, episode)
        return Record(timestep, seen.steps, seen.fell, *sums, kept, floor, windows)


PLANAR = Planar()
