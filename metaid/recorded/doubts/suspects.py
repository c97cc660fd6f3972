"""What a model may lack that no log of it shows for certain, and by how much its unknowns hang on that.

Springs, encoders that are off, friction that bends near rest, torques of a joint in a wrong scale, and joints of an arm
that are not where they are said to be. What each would change, were it as large as it may be, is the systematic part of
the deviations (Eq. 71); what the logs show of it is named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.models.tree import PARAMETERS, ArmPrior, Tree, friction_torque, misplaced, rigid_torque
from metaid.recorded.weak_form.equations import Equations
from metaid.recorded.weak_form.linear_model import RIGID
from metaid.recorded.weak_form.normal import eliminated_covariance, pseudo_inverse
from metaid.recorded.weak_form.windows import SHIFT, LogWindows

SIGNIFICANT = 4.0  # standard deviations from nothing: the verdict names it
WORTH = 0.001  # of the torque that it must explain to be named
BENDS = 10.0  # times the speed below which dry friction is a share of its whole: there friction bends
SCALE = 0.1  # how much the torques of a joint may be larger than they are said to be, a standard deviation
MISSING = {
    "viscous": "viscous friction",
    "coulomb": "dry friction",
    "offset": "a constant torque",
    "spring": "a spring",
}
OFF = 0.01  # rad: how far an encoder may be off that nobody has asked about


@dataclass(frozen=True)
class Suspect:
    """Something that the model has not.

    Attributes:
        what: it is, in words.
        columns: the averaged torque for a unit of it (nwindow x ntest x njoint x nother) of each log.
        joints: of which joint each column is (nother).
        deviations: how much of it there may be, standard deviations (nother); None where that may be anything.
        of_joints: how much of each column the joints in `joints` have (len(joints) x nother), where that is not one
            each.
    """

    what: str
    columns: list[Array]
    joints: tuple[int, ...]
    deviations: Array | None = None
    of_joints: Array | None = None


def examined(equations: Equations, values: Array, suspect: Suspect) -> tuple[Array, list[int]]:
    """What a suspect would change of the unknowns (nparam), and in which joints the logs show it.  Eq. 71.

    What the logs say of it changes them as they say. A size that is expected changes them as far as it is not told from
    them.
    """
    solution = equations.solution
    nparam, nother = len(values), suspect.columns[0].shape[-1]
    weight = solution.weight
    gram = np.zeros((nparam + nother, nparam + nother))
    moment = np.zeros(nparam + nother)
    squares, total = np.zeros(nother), 0.0
    wide, left = [], equations.left(values)
    logs = equations.columns, suspect.columns, left, equations.torques
    for own, columns, missed, torques in zip(*logs, strict=True):
        wide.append(np.concatenate([own, columns], axis=-1))
        weighed = np.einsum("ij,wajp->waip", weight, wide[-1])
        gram += np.einsum("waip,waiq->pq", weighed, wide[-1], optimize=True)
        moment += np.einsum("waip,wai->p", weighed, missed)
        squares += (columns**2).sum(axis=(0, 1, 2))
        total += float((torques**2).sum())
    gram[:nparam, :nparam] += solution.prior
    if suspect.deviations is None:
        mean_square = total / max(sum(each.size for each in left), 1)
        other = 1e-6 * (squares + squares.max()) / max(mean_square, 1e-300)
    else:
        other = suspect.deviations**-2.0
    at = np.arange(nparam, nparam + nother)
    gram[at, at] += other
    inverse = pseudo_inverse(gram, 1e-13)
    found = inverse @ moment
    scores = [
        np.einsum("waip,ij,waj->wp", own, weight, missed - own @ found, optimize=True)
        for own, missed in zip(wide, left, strict=True)
    ]
    covariance = eliminated_covariance(inverse, scores, equations.lags)
    shares = np.eye(nother) if suspect.of_joints is None else suspect.of_joints
    seen = shares @ found[nparam:]
    deviations = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", shares, covariance[nparam:, nparam:], shares), 1e-300))
    explained = np.sqrt(squares * found[nparam:] ** 2 / max(total, 1e-300))
    worth = (np.abs(shares) @ explained) > WORTH
    strong = (np.abs(seen) > SIGNIFICANT * deviations) & worth
    joints = sorted({suspect.joints[place] for place in np.flatnonzero(strong)})
    if suspect.deviations is None:
        change = np.abs(found[:nparam]) if joints else np.zeros(nparam)
    else:
        left_open = np.minimum(suspect.deviations, np.sqrt(np.diag(inverse)[nparam:]))
        across = np.linalg.solve(gram[:nparam, :nparam], gram[:nparam, nparam:])
        change = np.sqrt(found[:nparam] ** 2 + ((across * left_open) ** 2).sum(axis=1))
    return np.asarray(change, dtype=np.float64), joints


def suspects(equations: Equations, values: Array, scales: bool) -> Iterator[Suspect]:
    """What logs are asked about, with the unknowns as they were found (nparam); `scales` of torques where no payload
    tells them.
    """
    model, n = equations.model, equations.model.njoint
    every, parts = tuple(range(n)), equations.parts

    def of_each(part: LogWindows, at_nodes: Array) -> Array:
        """What each joint has by itself (nwindow x nnode x njoint), averaged, as columns."""
        return part.averaged(at_nodes)[..., None] * np.eye(n)

    def rubbing(part: LogWindows, term: str) -> Array:
        """The torque at nodes for a unit of a term of friction (nwindow x nnode x njoint), without a load."""
        return friction_torque(term, part.coordinates, part.speeds, part.sliding(model)[..., :n], part.speeds)

    for term, words in MISSING.items():
        lacking = np.flatnonzero(model.lacking(term)).tolist()
        if lacking:
            columns = [of_each(part, rubbing(part, term))[..., lacking] for part in parts]
            yield Suspect(words, columns, tuple(lacking))
    at_once = np.flatnonzero((model.sliding.presliding == 0.0) & (model.sliding.bent == 0.0)).tolist()
    if at_once and {"coulomb", "root"} & set(model.friction):
        bent = [part.speeds * np.exp(-np.abs(part.speeds) / (BENDS * model.sliding.still)) for part in parts]
        columns = [of_each(*each)[..., at_once] for each in zip(parts, bent, strict=True)]
        yield Suspect("friction that bends near rest", columns, tuple(at_once))
    if not equations.zeros:
        zeros = np.zeros(n)
        columns = [part.zero_columns(model, values, zeros) for part in parts]
        yield Suspect("an offset of the encoder", columns, every, np.full(n, OFF))
    driven = np.flatnonzero(~(model.passive | model.untrusted)).tolist()
    if scales and len(driven) > 1:  # of one joint, or of all, no log shows it
        against = np.linalg.svd(np.eye(len(driven)) - 1.0 / len(driven))[0][:, :-1]  # those of all together are 0
        columns = [(torques[..., None] * np.eye(n))[..., driven] @ against for torques in equations.torques]
        deviations = np.full(len(driven) - 1, SCALE)
        yield Suspect("another scale of the torques", columns, tuple(driven), deviations, against)
    if model.prior is not None:
        yield _misplaced(equations, model.prior, values[: model.nbody])


def _misplaced(equations: Equations, prior: ArmPrior, bodies: Array) -> Suspect:
    """Joints of an arm with these base parameters (nbody) that are not where they are said to be: six columns a joint.

    What the base parameters leave open of the links is as probable as can be.
    """
    tree, base = prior.nominal, np.zeros_like(prior.values)
    base[prior.base.columns % len(PARAMETERS) < RIGID] = bodies
    parameters = prior.parameters_at(base)
    windows = [part.thinned() for part in equations.parts]

    def needed(moved: Tree) -> list[Array]:
        return [
            each.averaged(rigid_torque(moved, parameters, each.coordinates, each.speeds, each.accelerations))
            for each in windows
        ]

    joints, moved, deviations = zip(*misplaced(tree, SHIFT), strict=True)
    of_logs = zip(needed(tree), *map(needed, moved), strict=True)
    columns = [np.stack([(after - usual) / SHIFT for after in others], axis=-1) for usual, *others in of_logs]
    return Suspect("another place", columns, joints, np.array(deviations))
