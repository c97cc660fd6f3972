"""What of a study of an arm is drawn at random when its file is read: the nominal arm about another, and from where its
pushes begin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.models.tree import PriorDeviations, Tree
from metaid.plant import ArmPlant
from metaid.study.settings import StudySettings
from metaid.study.spec import StartSettings


def drawn_nominal(tree: Tree, seed: int, prior: PriorDeviations) -> Tree:
    """An arm like `tree`, with the same joints.

    The masses and the moments of inertia about the centre of mass are wrong by up to the deviations of the `prior`, and
    so are the centres of mass, as a share of their distance from the joint. Each error is drawn evenly to both sides,
    with that `seed`. Nothing is known of friction and of rotors: they are 0.
    """
    random = np.random.Generator(np.random.SFC64([seed]))
    n, nothing = tree.njoint, np.zeros(tree.njoint)
    mass = tree.mass * (1.0 + prior.mass * random.uniform(-1.0, 1.0, n))
    lever = np.linalg.norm(tree.com, axis=1, keepdims=True)
    com = tree.com + prior.com * lever * random.uniform(-1.0, 1.0, (n, 3))
    inertia = tree.inertia * (1.0 + prior.inertia * random.uniform(-1.0, 1.0, n))[:, None, None]
    return replace(tree, mass=mass, com=com, inertia=inertia, rotor=nothing, damping=nothing, coulomb=nothing)


def drawn_starts(study: StudySettings, plant: ArmPlant, nominal: Tree) -> tuple[StartSettings, ...]:
    """From where the pushes of a study begin, those that coast before those that swing as on springs. The shapes of the
    `plant` are not to touch. Springs are as stiff as its motors have torque for by the `nominal` arm.
    """
    from metaid.plant.description import draw_starts  # loads MuJoCo

    episode = study.episode
    coasts = episode.coasts or 2 * plant.njoint
    springs = plant.njoint if episode.springs is None else episode.springs
    starts = draw_starts(plant, coasts + springs, episode.horizon, study.seed, episode.speed)
    written = [StartSettings.of(start) for start in starts]
    return (*written[:coasts], *(each.with_springs(nominal, episode.stiffness) for each in written[coasts:]))
