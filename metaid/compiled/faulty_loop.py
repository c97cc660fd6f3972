"""Episodes on a chain with faults, compiled. Chains without faults have a loop of their own (`kernel`), which none of
this slows down.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from metaid.compiled.batch import Laws, laws_of
from metaid.compiled.decorator import choose, compiled
from metaid.compiled.law import LINK, compensate, has_fallen, place_links, turn_to_angles
from metaid.compiled.sensed_loop import SensedLoop, command, follow
from metaid.compiled.stages import Step
from metaid.episode import Episode, with_deadband
from metaid.models import Lumps
from metaid.plant import MujocoPlant


class PlanarLaw(NamedTuple):
    """The laws of one candidate (see `batch.Laws`), the timestep of the control in s with the clauses of the fall rule,
    and the links that the law is worked out with.
    """

    laws: Laws
    rule: tuple[float, float, float, float, float]
    links: Any


class FaultyLoop(SensedLoop):
    """An episode on one chain with faults, whose noise about the upright is no crossing."""

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step | None = None) -> None:
        super().__init__(plant, episode, step)
        self.episode = with_deadband(episode, self.plant)

    def sent(self, law: Lumps) -> PlanarLaw:
        laws = laws_of(self.episode, self.plant.inner.gravity, law[None])
        rule = self.plant.timestep, *self.episode.fall_rule.clauses
        return PlanarLaw(laws, rule, np.zeros(self.plant.njoint, LINK))


@compiled
def _command(law, push, position, speed, torque):  # type: ignore[no-untyped-def]
    gravity, coriolis, damping, coulomb, inertia, springs = law.laws
    place_links(position, speed, law.links)
    turn_to_angles(law.links, springs[push])
    own = gravity[0], coriolis[0], damping[0], coulomb[0], inertia[0], springs[push]
    compensate(own, law.links, speed, torque)


@compiled
def _falls(law, _push, step, positions, speeds):  # type: ignore[no-untyped-def]
    timestep, limit, margin, turn, runaway = law.rule
    pushed, link_speed = 0.0, 0.0
    for i in range(law.links.shape[0]):
        link_speed += speeds[0, i]
        pushed = max(pushed, abs(link_speed))
    if runaway * pushed * timestep < turn:
        turn = runaway * pushed * timestep  # Eq. 9
    place_links(positions[step], speeds[step], law.links)
    fallen = False
    for link in law.links:
        if has_fallen(link.angle, link.speed, margin * pushed, timestep, limit, turn):
            fallen = True
    return fallen


choose(command, {PlanarLaw: _command})
choose(follow, {PlanarLaw: _falls})
