"""Links that can be, with given base parameters, closest to the nominal arm's.

The masses among them are not identified: any other bodies with these base parameters move alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models.closest_bodies import Matrices, closest
from metaid.models.lumps import Array
from metaid.models.nearest_bodies import Nearest
from metaid.models.tree.arm_prior import LEAST_LEVER, ArmPrior
from metaid.models.tree.regressor import BODY
from metaid.models.tree.tree import PARAMETERS, Tree, inertia_matrices

FLAT = 1e-3  # of a body's size: a nominal body that is thinner counts as this thick
SMALL = 0.1  # of the deviation of a rotor's inertia: a nominal rotor of 0 counts as this
ROTOR = BODY
_INERTIA = np.moveaxis(inertia_matrices(np.eye(BODY)), 0, -1)
_PSEUDO = np.zeros((4, 4, BODY))
_PSEUDO[3, 3, 0] = 1.0
_PSEUDO[:3, 3, 1:4] = _PSEUDO[3, :3, 1:4] = np.eye(3)
_PSEUDO[:3, :3] = 0.5 * np.eye(3)[..., None] * np.trace(_INERTIA) - _INERTIA
USED = 1e-9  # of a direction that leaves the base parameters alone: what a parameter has at least, to be free in it


@dataclass(frozen=True)
class PossibleBodies:
    """A `tree` whose links can be, and what of its friction and rotors is not as identified: `cut` (njoint x 3), the
    negative values of rotors, viscous and dry friction that are 0 in the tree, and 0 elsewhere.
    """

    tree: Tree
    cut: Array


def possible_bodies(prior: ArmPrior, values: Array) -> PossibleBodies | None:
    """The possible bodies with base parameters `values` (nbase) that are closest to the nominal arm's.  Eq. 77.

    Rotors and friction that no other parameter can make up for are as identified, unless that is negative.

    Returns:
        The arm; None where no possible bodies have these base parameters.
    """
    nominal, base = prior.nominal, prior.base
    njoint, size = nominal.njoint, len(PARAMETERS)
    groups, directions = _cones(prior)
    found = closest(groups, prior.parameters_at(values).ravel(), directions)
    if found is None:
        return None
    parameters = found[None].copy()
    parameters[:, base.columns] += values - parameters @ base.matrix.T  # what rounding left
    parameters = parameters.reshape(njoint, size)
    cut = np.minimum(parameters[:, BODY:], 0.0)
    parameters[:, BODY:] -= cut
    return PossibleBodies(nominal.with_parameters(parameters), cut)


def nearest_possible(prior: ArmPrior, values: Array, precision: Array) -> Array:
    """The base parameters (nbase) that possible bodies have and that cost least.  Eq. 69.

    Args:
        prior: of the arm.
        values: base parameters that were fitted freely (nbase).
        precision: of these (nbase x nbase).
    """
    (links, rotors), _ = _cones(prior)
    start = prior.parameters_at(values)
    start[:, :BODY] = thick_links(prior.nominal)
    x = start.ravel()
    free = rotors.slope.reshape(-1, x.size).argmax(axis=1)
    x[free] = rotors.nominal.ravel()
    matrix = prior.base.matrix
    found = Nearest((links, rotors), lambda x: matrix @ x, lambda _: matrix, values, precision).found(x)
    return np.asarray(matrix @ found, dtype=np.float64)


def _cones(prior: ArmPrior) -> tuple[tuple[Matrices, Matrices], Array]:
    """What is to be positive definite, pseudo-inertias and the rotors that others may make up for, by the parameters of
    all joints (13 njoint), and the directions in which these leave the base parameters alone (13 njoint x nfree).
    """
    from scipy.linalg import null_space  # which a command that only reads a DB does without

    nominal, base = prior.nominal, prior.base
    njoint, size = nominal.njoint, len(PARAMETERS)
    spread = np.sqrt(np.diag(prior.parameter_covariance))
    scale = np.where(spread > 0.0, spread, 1.0)
    directions = scale[:, None] * null_space(base.matrix * scale)
    each = np.eye(njoint * size).reshape(njoint, size, -1)
    free = np.flatnonzero((np.abs(directions / scale[:, None]).reshape(njoint, size, -1)[:, ROTOR] > USED).any(axis=1))
    usual = np.where(nominal.rotor > 0.0, nominal.rotor, SMALL * spread.reshape(njoint, size)[:, ROTOR])
    links = Matrices(np.moveaxis(pseudo_inertia(each.swapaxes(1, 2)), 1, -1), nominal_pseudo_inertias(nominal))
    return (links, Matrices(each[free, ROTOR, None, None], usual[free, None, None])), directions


def pseudo_inertia(parameters: Array) -> Array:
    """[[Σ, s], [sᵀ, m]] (... x 4 x 4) of links, linear in their `parameters` (... x 10 or more).  Eq. 76."""
    return np.asarray(np.einsum("ijp,...p->...ij", _PSEUDO, parameters[..., :BODY]), dtype=np.float64)


def nominal_pseudo_inertias(tree: Tree) -> Array:
    """Those of the links of a nominal arm (njoint x 4 x 4), positive definite: what is thin has a thickness."""
    return np.array([_thick(each) for each in pseudo_inertia(tree.parameters)])


def thick_links(tree: Tree) -> Array:
    """The parameters (njoint x 10) of a nominal arm's links, whose pseudo-inertias are `nominal_pseudo_inertias`."""
    matrices = nominal_pseudo_inertias(tree).reshape(-1, 16)
    return np.asarray(np.linalg.lstsq(_PSEUDO.reshape(-1, BODY), matrices.T, rcond=None)[0].T, dtype=np.float64)


def _thick(pseudo_inertia: Array) -> Array:
    """A nominal `pseudo_inertia` (4 x 4) that is positive definite: rods, plates and points are given a thickness."""
    mass, moment = pseudo_inertia[3, 3], pseudo_inertia[:3, 3]
    offset = np.outer(moment, moment) / mass
    extents, axes = np.linalg.eigh(pseudo_inertia[:3, :3] - offset)
    size = max(float(extents.max()), mass * LEAST_LEVER**2)
    thick = pseudo_inertia.copy()
    thick[:3, :3] = (axes * np.maximum(extents, FLAT * size)) @ axes.T + offset
    return thick
