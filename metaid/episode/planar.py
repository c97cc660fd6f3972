"""Episodes of planar chains: struck at rest, counted about the upright, over at the first fall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from metaid.episode.pushed import Pushed
from metaid.episode.record import Record, Seen, crossings, energies, windows_of
from metaid.errors import EpisodeError
from metaid.models import Array, ChainModel, Lumps
from metaid.plant import Plant, Start


@dataclass(frozen=True)
class Planar:
    """A planar chain; its laws are lumps. The first fall ends its episode, and not only its push; `measures` are
    those by which it can be measured.
    """

    ends_at_fall: ClassVar[bool] = True
    measures: ClassVar[tuple[str, ...]] = ("count", "crossing", "spectral", "smoothed")

    def check_pushes(self, pushes: Array) -> None:
        """Raises EpisodeError where nothing can begin with these (npush x njoint)."""
        if not np.isfinite(pushes).all() or not np.any(pushes, axis=1).all():
            raise EpisodeError(
                "every push needs a finite impulse, in N s, on at least one link: without a push nothing moves"
            )

    def start(self, pose: Array, push: Array) -> Start:
        """From where a push begins, by its pose and its impulses, or joint speeds of an arm (njoint each)."""
        return Start(push, pose)

    def torques(self, law: Lumps, plant: Plant, episode: Pushed) -> Callable[[int, Array, Array], Array]:
        """What a law sends the plant (njoint), in N m or N, after a push, by its number, at joint angles and speeds
        (njoint each).
        """
        models = [ChainModel(law, plant.gravity, stiffness) for stiffness in episode.springs.tolist()]
        return lambda push, angles, speeds: models[push].torque(angles, speeds)

    def falls(self, episode: Pushed, speeds: Array, timestep: float) -> Callable[[Array, Array], bool]:
        """Whether a push has fallen at joint angles and speeds (njoint each), when it began with these `speeds`."""
        rule = episode.fall_rule
        allowed = rule.allowed_speeds(np.cumsum(speeds))
        return lambda angles, speeds: rule.has_fallen(np.cumsum(angles), np.cumsum(speeds), allowed, timestep)

    def record(self, seen: Seen, episode: Pushed) -> Record:
        """What an episode showed, but for its readings."""
        (angles, speeds), steps, pushes = seen.padded(episode.steps), seen.steps, np.arange(episode.npush)
        crosses = (episode.states[:, 0] == 0.0) & (speeds[0] != 0.0)
        crossed, span = crossings(angles, crosses, seen.timestep, episode.deadband)
        sums = energies(speeds, seen.timestep, -episode.springs[:, None] * angles[:-1])
        at_end = steps, pushes
        shown = crossed[at_end], span, sums[0][at_end], sums[1][at_end]
        kept = tuple(angles for angles, _ in seen.motions) if episode.keep_angles else ()
        windows = windows_of(seen, episode.window_ends, (angles, speeds, *sums), crossed)
        return Record(seen.timestep, steps, seen.fell, *shown, kept, episode.noise_floor.energy, windows)


PLANAR = Planar()
