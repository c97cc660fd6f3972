"""What a model may lack, and how much what is found hangs on that: what the log itself is asked about.

Springs, encoders that are off, friction that bends near rest or in terms that the model has not, torques of a joint in
a wrong scale, and joints of an arm that are not where they are said to be. What is left of the torques is asked whether
one of them would explain some of it, and what is found is no surer than it changes with that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array
from metaid.models.tree import PARAMETERS, Belief, Tree, body_torque
from metaid.recorded.linear_model import RIGID, LinearModel, friction_torque
from metaid.recorded.windows import Windows

NOTICED, SIGNIFICANT = 1.0, 4.0  # standard deviations from nothing: intervals hold it; the verdict names it
WORTH = 1e-4  # of the torque that it must explain to be named: the averages are no more exact
SHIFT = 1e-5  # rad or m, for the derivative by an angle, and by where a joint is
THINNED = 4  # nodes: what is suspected need not be known as exactly as what is found
BENDS = 10.0  # times the speed below which dry friction is a share of its whole: there friction bends
SCALE = 0.1  # how much the torques of a joint may be larger than they are said to be, a standard deviation
MISSING = {"viscous": "viscous friction", "coulomb": "dry friction", "offset": "a constant torque"}
MISPLACED, TURNED = 0.005, 0.01  # m, rad: how far a joint may be from where it is said to be, a standard deviation


@dataclass(frozen=True)
class Suspect:
    """Something that the model has not.

    Attributes:
        what: it is, in words.
        columns: the averaged torque for a unit of it in each joint (nwindow x ntest x njoint x nother).
        joints: of which joint each column is (nother).
        deviations: how much of it there may be, standard deviations (nother); None where that may be anything.
        of_joints: how much of each column the joints in `joints` have (len(joints) x nother), where that is not one
            each.
    """

    what: str
    columns: Array
    joints: tuple[int, ...]
    deviations: Array | None = None
    of_joints: Array | None = None


def suspects(windows: Windows, rows: Array, model: LinearModel, values: Array) -> Iterator[Suspect]:
    """What a log is asked about.

    Args:
        windows: of the log.
        rows: of them (nwindow x ntest x njoint x nparam).
        model: what is unknown.
        values: the unknowns as they were found (nparam).
    """
    n = model.njoint
    joints = np.arange(n)
    every = tuple(range(n))

    def of_each(at_nodes: Array) -> Array:
        """What each joint has by itself (nwindow x nnode x njoint), averaged, as columns."""
        columns = np.zeros((len(windows), rows.shape[1], n, n))
        columns[..., joints, joints] = windows.averaged(at_nodes)
        return columns

    yield Suspect("a spring", of_each(windows.coordinates), every)
    for term, words in MISSING.items():
        if term not in model.friction:
            yield Suspect(
                words, of_each(friction_torque(term, windows.speeds, windows.accelerations, model.still)), every
            )
    if "coulomb" in model.friction or "root" in model.friction:
        near_rest = windows.speeds * np.exp(-np.abs(windows.speeds) / (BENDS * model.still))
        yield Suspect("friction that bends near rest", of_each(near_rest), every)
    thinned = windows.thinned(THINNED)
    needed = thinned.rows(model) @ values
    offsets = np.empty((*needed.shape, n))
    for joint in joints:
        moved = thinned.coordinates + SHIFT * (joints == joint)
        offsets[..., joint] = (replace(thinned, coordinates=moved).rows(model) @ values - needed) / SHIFT
    yield Suspect("an offset of the encoder", offsets, every)
    if n > 1:  # of one joint, or of all, no log shows it
        one_each = np.zeros((*rows.shape[:-1], n))
        one_each[..., joints, joints] = rows @ values
        against = np.linalg.svd(np.eye(n) - 1.0 / n)[0][:, :-1]  # those of all joints together are 0
        yield Suspect("another scale of the torques", one_each @ against, every, np.full(n - 1, SCALE), against)
    if isinstance(model.source, Belief):
        yield _misplaced(thinned, model.source, values[: model.nbody])


def _misplaced(windows: Windows, belief: Belief, bodies: Array) -> Suspect:
    """Joints of an arm with these base parameters (nbody) that are not where they are said to be: six columns a joint.

    What the base parameters leave open of the links is as probable as can be.
    """
    tree, base = belief.nominal, np.zeros_like(belief.values)
    base[belief.base.columns % len(PARAMETERS) < RIGID] = bodies
    parameters = belief.parameters_at(base)

    def needed(moved: Tree) -> Array:
        motion = windows.coordinates, windows.speeds, windows.accelerations
        return windows.averaged(body_torque(moved, parameters, *motion))

    usual = needed(tree)
    columns, joints, deviations = [], [], []
    for joint in range(tree.njoint):
        for axis in range(3):
            place = tree.position.copy()
            place[joint, axis] += SHIFT
            columns.append((needed(replace(tree, position=place)) - usual) / SHIFT)
            turn = np.zeros((3, 3))
            turn[(axis + 2) % 3, (axis + 1) % 3], turn[(axis + 1) % 3, (axis + 2) % 3] = SHIFT, -SHIFT
            rotation = tree.rotation.copy()
            rotation[joint] = rotation[joint] @ (np.eye(3) + turn)
            columns.append((needed(replace(tree, rotation=rotation)) - usual) / SHIFT)
            joints += [joint, joint]
            deviations += [MISPLACED, TURNED]
    return Suspect("another place", np.stack(columns, axis=-1), tuple(joints), np.array(deviations))
