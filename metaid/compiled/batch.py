"""Candidates whose episodes several compiled loops run side by side, push by push, and what these gave.

A loop takes one push at a time from the queue. Pushes are independent of each other, so a generation of nine candidates
keeps two workers busy to the end. A push may be simulated before an earlier one of the same candidate is known to end
in a fall. It is left out of the record then. So the record does not depend on which loop took which push, nor when.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.queue import Queue
from metaid.episode import Episode, Record, Windows, windows_before_fall
from metaid.models import Array, Lumps

Laws = tuple[Array, Array, Array, Array, Array, Array]
Outputs = tuple[NDArray[np.int64], Array, Array, Array]


@dataclass(frozen=True)
class Batch:
    """`laws`: the candidates' gravity lumps times g (ncandidate x njoint), in N m; their Coriolis lumps (ncandidate x
    njoint x njoint); those of damping, dry friction and inertia (ncandidate x njoint); and the stiffness of
    each push (npush), in 1/s².
    `queue`: their pushes, candidate by candidate.

    Loops fill in `ran` and `fell` (ncandidate x npush): steps after a push, and whether it ended in a fall; the four
    `outputs` (ncandidate x npush x njoint) that a Record has; the two `windows`, motion (ncandidate x npush x nwindow x
    4 x njoint) and half periods (ncandidate x npush x nwindow x njoint); and, unless it is empty, `angles` (ncandidate
    x npush x nsteps + 1 x njoint).
    """

    episode: Episode
    timestep: float
    laws: Laws
    queue: Queue
    ran: NDArray[np.int64]
    fell: NDArray[np.bool_]
    outputs: Outputs
    windows: tuple[Array, NDArray[np.int64]]
    angles: Array

    def records(self) -> list[Record]:
        """What each candidate's episode showed, once the queue is empty and every loop is back."""
        return [self._record(candidate) for candidate in range(len(self.ran))]

    def _record(self, candidate: int) -> Record:
        fell = bool(self.fell[candidate].any())
        begun = 1 + int(self.fell[candidate].argmax()) if fell else self.episode.npush
        seen: list[Any] = [output[candidate] for output in (self.ran, self.fell, *self.outputs)]
        for output in seen:
            output[begun:] = 0
        kept = self.angles[candidate] if self.episode.keep_angles else ()
        angles = tuple(angles[: steps + 1] for angles, steps in zip(kept, seen[0][:begun], strict=False))
        windows = self._windows(candidate)
        return Record(self.timestep, *(*seen, angles, 0.0, windows))

    def _windows(self, candidate: int) -> Windows | None:
        if not self.episode.window_ends:
            return None
        motion, half_periods = (output[candidate] for output in self.windows)
        ends = np.array(self.episode.window_ends)
        return windows_before_fall(ends, motion, half_periods, self.ran[candidate], self.fell[candidate])


def laws_of(episode: Episode, gravity: float, candidates: Lumps) -> Laws:
    """What the loop sends to these `candidates`, lumps with a leading axis (ncandidate); `gravity` in m/s².

    Copies, all of one layout: the loop would be compiled anew for any other.
    """
    others = (candidates.of(kind) for kind in ("damping", "coulomb", "inertia"))
    lumps = gravity * candidates.gravity, candidates.coriolis, *others
    return (*(np.array(each, order="C") for each in lumps), episode.springs)  # type: ignore[return-value]
