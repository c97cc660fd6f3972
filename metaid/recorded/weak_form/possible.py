"""The fit over bodies that can be: unknowns that a robot with possible links, rotors and friction has.

Links are possible where their pseudo-inertia is positive definite (Eq. 76), rotors and friction where they are not
negative.  Eq. 69.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array, Matrices, Nearest
from metaid.models.tree import PARAMETERS, Tree, nominal_pseudo_inertias, pseudo_inertia, thick_links
from metaid.recorded.weak_form.equations import Equations, Solution
from metaid.recorded.weak_form.linear_model import RIGID, ROTOR
from metaid.recorded.weak_form.normal import solved

SMALL = 1e-3  # of a friction's deviation: what is not above 0 is kept so near to it
THIN = 0.1  # of what a rotor may be beforehand: a nominal rotor of 0 counts as this
COMPLEX_STEP = 1e-30  # of a derivative, which is exact to rounding
CURVE = ("coulomb", "root", "viscous")  # of friction over speed, which is not negative where there is a root
NOT_NEGATIVE = (*CURVE, "load", "rotor")
SPEEDS = (0.0, 0.1, 0.3, 1.0)  # shares of a joint's fastest speed, at which friction is not negative
BEYOND = 2.0  # of it, up to which friction that bends does not fall: it would drive a joint that is faster


@dataclass(frozen=True)
class PossibleModel:
    """A robot that can be.

    Attributes:
        values: the unknowns (nparam).
        tree: its links and rotors, without friction.
        jacobian: how the unknowns (nparam) of a chain change with its free parameters (nparam x nfree), for Coriolis
            lumps follow from lengths; None of an arm.
    """

    values: Array
    tree: Tree
    jacobian: Array | None


class Possible:
    """What can be of a model: how unknowns follow from free parameters, and which of these are possible.

    The free parameters are, of each link, ten (of a chain three: mass, first and second moment) and its rotor, then the
    unknowns of friction, then the logarithms of a chain's lengths.
    """

    def __init__(self, equations: Equations) -> None:
        """Of what equations tell."""
        model, scale = equations.model, equations.scale
        self._model, self._scale, self._fastest = model, scale, equations.fastest
        self._friction = np.arange(model.nbody, len(model.names))
        self._tree = model.tree
        prior, chain = model.prior, model.chain
        if chain is None:
            assert prior is not None
            self._links = scale * np.column_stack([thick_links(self._tree), self._tree.rotor]).ravel()
            self._lengths = np.zeros(0)
            kept = prior.base.columns % len(PARAMETERS) < RIGID
            matrix = prior.base.matrix[kept].reshape(model.nbody, -1, len(PARAMETERS))[..., :RIGID]
            self._linear = np.zeros((len(model.names), self._nfree))
            self._linear[: model.nbody, : len(self._links)] = matrix.reshape(model.nbody, -1)
            self._linear[model.nbody :, len(self._links) :] = np.eye(len(self._friction))
            spread = np.sqrt(np.diag(prior.parameter_covariance)).reshape(-1, len(PARAMETERS))[:, ROTOR]
            self._usual_rotor = scale * np.maximum(self._tree.rotor, THIN * spread)
        else:
            own = np.stack([chain.mass, chain.mass * chain.com, chain.inertia + chain.mass * chain.com**2], axis=1)
            self._links = scale * np.column_stack([own, np.zeros(chain.nlink)]).ravel()
            self._lengths = np.log(chain.length[:-1])
            self._usual_rotor = scale * THIN * chain.lumps_of(("inertia",)).vector
        self._pairs = np.triu_indices(self._tree.njoint, 1)
        self._links.reshape(self._tree.njoint, -1)[:, -1] = self._usual_rotor

    @property
    def _nfree(self) -> int:
        return len(self._links) + len(self._friction) + len(self._lengths)

    def lumps(self, x: Array) -> Array:
        """The unknowns (nparam) of free parameters (nfree)."""
        return np.asarray(self._of_chain(x) if self._model.is_chain else self._linear @ x)

    def slopes(self, x: Array) -> Array:
        """Their Jacobian (nparam x nfree) there; of an arm it is the same everywhere."""
        if not self._model.is_chain:
            return self._linear
        return np.asarray(self._of_chain(x + COMPLEX_STEP * 1j * np.eye(self._nfree)).imag.T / COMPLEX_STEP)

    def _of_chain(self, x: NDArray[Any]) -> NDArray[Any]:
        """The unknowns of a chain (... x nparam) of free parameters (... x nfree), which may be complex.  Eqs. 1 to
        3.
        """
        nlinks, last = len(self._links), len(x.T) - len(self._lengths)
        mass, first, second, rotor = (x[..., kind:nlinks:4] for kind in range(4))
        length = np.zeros_like(mass)
        length[..., :-1] = np.exp(x[..., last:])
        beyond = np.cumsum(mass[..., ::-1], axis=-1)[..., ::-1] - mass  # the mass that each link carries
        gravity, inertia = first + length * beyond, second + length**2 * beyond
        one, other = self._pairs
        coriolis = length[..., one] * gravity[..., other]
        return np.concatenate([gravity, coriolis, inertia, rotor[..., 1:], x[..., nlinks:last]], axis=-1)

    def _cones(self, rows: Array, sizes: Array) -> list[Matrices]:
        """What is to be positive definite, with `rows` of unknowns of friction (nrow x nfriction) of these `sizes`
        (nrow).
        """
        model, n, nlinks = self._model, self._tree.njoint, len(self._links)
        each = np.eye(self._nfree)[:nlinks].reshape(n, -1, self._nfree)
        if model.is_chain:
            own, moments = self._links.reshape(n, -1), np.array([[2, 1], [1, 0]])
            of_links, nominal = each[:, moments], own[:, moments]
            nominal[:, 0, 0] = np.maximum(nominal[:, 0, 0], 1.001 * own[:, 1] ** 2 / own[:, 0])  # it has a thickness
        else:
            of_links = np.moveaxis(pseudo_inertia(each.swapaxes(1, 2)), 1, -1)
            nominal = self._scale * nominal_pseudo_inertias(self._tree)
        of_friction = np.zeros((len(rows), self._nfree))
        of_friction[:, nlinks : nlinks + len(self._friction)] = rows
        numbers, usual = np.concatenate([each[:, -1], of_friction]), np.concatenate([self._usual_rotor, sizes])
        return [Matrices(of_links, nominal), Matrices(numbers[:, None, None, :], usual[:, None, None])]

    def _friction_rows(self, values: Array, deviations: Array) -> tuple[Array, Array]:
        """Combinations of the unknowns of friction (nrow x nfriction) that are not negative, and their usual sizes
        (nrow): where there is a root, the curve at some speeds and how it grows, else each term by itself. Unknowns and
        their deviations (nparam each) are those of the free fit.
        """
        model, nbody = self._model, self._model.nbody
        rows: list[Array] = []
        for motor, joints in enumerate(model.sliding.motors):
            columns = {term: model.columns[term, motor] for term in NOT_NEGATIVE if (term, motor) in model.columns}
            fastest = float(self._fastest[list(joints)].max())
            shapes = [
                {"coulomb": 1.0, "root": share**0.5 * fastest**0.5, "viscous": share * fastest} for share in SPEEDS
            ]
            shapes.append({"root": 0.5 / BEYOND**0.5, "viscous": fastest**0.5})
            if "root" not in columns:
                shapes = []
            for shape in (*shapes, *({term: 1.0} for term in columns if not (shapes and term in CURVE))):
                row = np.zeros(len(values))
                for term in columns.keys() & shape.keys():
                    row[columns[term]] = shape[term]
                rows.append(row)
        stacked = np.array(rows).reshape(-1, len(values))
        least = SMALL * np.abs(stacked) @ deviations
        sizes = np.maximum(stacked @ values, np.maximum(least, 1e-12))
        return stacked[:, nbody:], sizes

    def closest(self, solution: Solution) -> PossibleModel:
        """The possible model that costs least, from a solution that was fitted freely.  Eq. 69."""
        values, precision = solution.values, solution.precision
        deviations = np.sqrt(np.maximum(np.diag(solved(precision, np.eye(len(values)))), 0.0))
        rows, sizes = self._friction_rows(values, deviations)
        friction = values[self._friction]
        if (rows @ friction < 0.5 * sizes).any():  # as near as can be to what was fitted, and inside
            inside = np.maximum(friction, SMALL * deviations[self._friction])
            friction = np.where(rows.any(axis=0), inside, friction)
        nearest = Nearest(self._cones(rows, sizes), self.lumps, self.slopes, values, precision, len(self._lengths))
        x = nearest.found(np.concatenate([self._links, friction, self._lengths]))
        nlinks = len(self._links)
        links = x[:nlinks].reshape(self._tree.njoint, -1)
        length = np.exp(x[nlinks + len(self._friction) :])
        slopes = self.slopes(x) if self._model.is_chain else None
        return PossibleModel(self.lumps(x), self._tree_of(links, length), slopes)

    def refined(self, solution: Solution) -> Solution:
        """The solution that can be, closest to one that was fitted freely."""
        return replace(solution, values=self.closest(solution).values)

    def _tree_of(self, links: Array, length: Array) -> Tree:
        """The arm that has these links (njoint x nlink)."""
        parameters = np.zeros((self._tree.njoint, len(PARAMETERS)))
        if not self._model.is_chain:
            parameters[:, :RIGID] = links
            return self._tree.with_parameters(parameters)
        mass, first, second, rotor = links.T
        rotor = np.append(0.0, rotor[1:])  # that of the first joint is part of its link
        columns = [PARAMETERS.index(name) for name in ("m", "mz", "xx", "yy", "zz", "rotor")]
        parameters[:, columns] = np.stack([mass, first, second, second, second - first**2 / mass, rotor], axis=1)
        position = np.concatenate([[0.0], length])[:, None] * np.array([0.0, 0.0, 1.0])
        return replace(self._tree.with_parameters(parameters), position=position)
