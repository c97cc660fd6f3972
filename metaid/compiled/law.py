"""The compensation law and the fall rule as the compiled loops apply them (`models.ChainModel.torque` is the
reference), and what they keep of a link meanwhile.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.models import SLIDING

# Records, not arrays: one address instead of twelve makes an episode around `mj_step` some 3 percent faster.
LINK = np.dtype(
    [
        ("angle", np.float64),  # absolute, in rad, as the law gets it
        ("speed", np.float64),  # absolute, in rad/s
        ("cosine", np.float64),  # of the angle
        ("sine", np.float64),
        ("pull_cosine", np.float64),  # its part in the sums of Eqs. 5 and 13, see `turn`
        ("pull_sine", np.float64),
        ("previous_angle", np.float64),  # of the joint, a step ago
        ("previous_speed", np.float64),
        ("side", np.float64),  # of the upright that the joint is on: −1, 0 before it has moved, 1
        ("first", np.float64),  # time of the joint's first crossing, in s, or −1 before it
        ("squares", np.float64),  # sum over steps of q̇² before and after
        ("jumps", np.float64),  # sum over steps of the square of what q̇ gained beyond −k q dt, see Eq. 14
    ]
)


@compiled
def turn(link, cosine, sine, stiffness):  # type: ignore[no-untyped-def]
    """Fills in what a link has in the sums over j of Eqs. 5 and 13.

    sin(φ_i − φ_j) and cos(φ_i − φ_j) are expanded, so that each angle needs one cosine and one sine.

    Args:
        link: of the type `LINK`, with its angle and speed.
        cosine: of its angle.
        sine: of its angle.
        stiffness: of the law, in 1/s².
    """
    squared = link.speed * link.speed
    link.cosine = cosine
    link.sine = sine
    link.pull_cosine = squared * cosine
    link.pull_sine = squared * sine
    if stiffness != 0.0:
        restoring = stiffness * link.angle
        link.pull_cosine -= restoring * sine
        link.pull_sine += restoring * cosine


@compiled
def place_links(position, speed, links):  # type: ignore[no-untyped-def]
    """Gives the `links` the absolute angles and speeds that follow from those of joints (njoint each)."""
    link_angle, link_speed = 0.0, 0.0
    for i in range(links.shape[0]):
        link_angle += position[i]
        link_speed += speed[i]
        links[i].angle = link_angle
        links[i].speed = link_speed


@compiled
def turn_to_angles(links, stiffness):  # type: ignore[no-untyped-def]
    """All `links` are turned to their angles."""
    for i in range(links.shape[0]):
        turn(links[i], np.cos(links[i].angle), np.sin(links[i].angle), stiffness)


@compiled
def compensate(law, links, qvel, torque):  # type: ignore[no-untyped-def]
    """Fills in the joint torque of a law.  Eqs. 5, 6, 12 and 13.

    Args:
        law: of one candidate; see `batch.Laws`.
        links: (njoint) of the type `LINK`, turned to their angles.
        qvel: joint speeds (njoint), in rad/s.
        torque: of the joints (njoint), in N m, filled in.
    """
    gravity, coriolis, damping, coulomb, inertia, stiffness = law
    n = links.shape[0]
    carried = 0.0
    for i in range(n - 1, -1, -1):
        link = links[i]
        cosines, sines = -gravity[i], 0.0
        for j in range(n):
            cosines += coriolis[i, j] * links[j].pull_cosine
            sines += coriolis[i, j] * links[j].pull_sine
        pull = link.sine * cosines - link.cosine * sines  # Eq. 5
        if stiffness != 0.0:
            pull -= stiffness * inertia[i] * link.angle  # Eq. 13
        carried += pull
        torque[i] = carried
        if damping[i] != 0.0:
            torque[i] += damping[i] * qvel[i]  # Eq. 6
        if coulomb[i] != 0.0:
            torque[i] += coulomb[i] * min(max(qvel[i] * (1.0 / SLIDING), -1.0), 1.0)  # Eq. 12


@compiled
def has_fallen(angle, speed, fastest, timestep, limit, turn):  # type: ignore[no-untyped-def]
    """Whether one link has fallen.  Eq. 8, with NaN as fallen; `episode.FallRule.has_fallen` is the reference.

    Args:
        angle: of the link, absolute, in rad.
        speed: of the link, absolute, in rad/s.
        fastest: the speed up to which a link past the limit coasts, in rad/s.
        timestep: between two torques, in s.
        limit: of the angle, in rad.
        turn: the largest that is allowed in a timestep, in rad; beyond it the link runs away.
    """
    # An angle that is not finite follows from a speed that is not, so the speed's own clause catches it.
    return not (abs(angle) <= limit or abs(speed) <= fastest) or not abs(speed) * timestep <= turn
