"""What the torque of an arm can tell of its parameters: the combinations that it depends on.

Of ten parameters a link most show in the torque only together with others: a link's mass, for one, with the first
moments of the links that carry it. A base parameter is such a combination.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from metaid.models.lumps import Array
from metaid.models.tree.regressor import torque_regressor
from metaid.models.tree.tree import PARAMETERS, Tree, tilted_gravity

STATES = 200  # random ones, of which torques are compared
TILTS = 0.3 * np.eye(2)  # rad, about the x and the y axis of a base
FAST = 10.0  # rad/s² or m/s², of random accelerations
NOTHING = 1e-9  # of the largest singular value: what rounding leaves of a combination that no torque shows
RARELY_FIRST = 1e-3  # by which masses are chosen after what they can be added to
EARLIER = 0.99  # of the size of the first column, of the last: what is as large and comes earlier is taken first
_KINDS = {"m": "kg", "rotor": "kg m²", "damping": "N m s", "coulomb": "N m"}
_ON_SLIDES = {"rotor": "kg", "damping": "N s/m", "coulomb": "N"}


@dataclass(frozen=True)
class BaseParameters:
    """The combinations of an arm's parameters that its torque depends on.

    Attributes:
        names: of the parameters that each is counted by (nbase): `m4x` is the first moment of link 4 along x.
        units: of them (nbase).
        expressions: what each is made of (nbase): `m4x + 0.4 m5`.
        columns: where the parameters they are counted by are among all of them (nbase).
        matrix: the combinations (nbase x 13 njoint), of the parameters in the order of the tree's.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    expressions: tuple[str, ...]
    columns: NDArray[np.intp]
    matrix: Array

    def of(self, parameters: Array) -> Array:
        """The base parameters (... x nbase) of arms with these `parameters` (... x njoint x 13)."""
        flat = parameters.reshape(*parameters.shape[:-2], -1)
        return np.asarray(flat @ self.matrix.T, dtype=np.float64)


def parameter_names(njoint: int) -> list[str]:
    """The names of all parameters of an arm (13 njoint): `m4`, `m4x`, `xx4`, `rotor4`, …"""
    return [
        f"m{joint}{kind[1:]}" if kind.startswith("m") else f"{kind}{joint}"
        for joint in range(1, njoint + 1)
        for kind in PARAMETERS
    ]


def parameter_unit(kind: str, is_slide: bool) -> str:
    """The unit of a parameter of a kind in PARAMETERS."""
    if is_slide and kind in _ON_SLIDES:
        return _ON_SLIDES[kind]
    return _KINDS.get(kind, "kg m" if kind.startswith("m") else "kg m²")


def random_states(tree: Tree, seed: int, count: int = STATES) -> tuple[Array, Array, Array]:
    """Joint coordinates in their ranges, speeds and accelerations (count x njoint each)."""
    random = np.random.default_rng(seed)
    low, high = tree.ranges(np.pi, 1.0)
    speeds, accelerations = random.standard_normal((2, count, tree.njoint))
    return random.uniform(low, np.maximum(low, high), (count, tree.njoint)), speeds, FAST * accelerations


def base_parameters(tree: Tree, counted_by: Sequence[str] | None = None, tilts: bool = False) -> BaseParameters:
    """Those of an arm, from its kinematics alone.  Eq. 53.

    Args:
        tree: the arm.
        counted_by: the parameters that they are counted by (nbase). By default independent ones are looked for.
        tilts: whether its base may be tilted, which lets gravity show what it does not show of an upright one.
    """
    states = random_states(tree, 0)
    leaning = [tree, *(replace(tree, gravity=tilted_gravity(tree.gravity, tilt)) for tilt in TILTS)]
    rows = _reduced(np.concatenate([torque_regressor(each, *states) for each in (leaning if tilts else [tree])]))
    kinds, names = list(PARAMETERS) * tree.njoint, parameter_names(tree.njoint)
    if counted_by is None:
        columns = _independent(rows, kinds)
    else:
        columns = np.array([names.index(name) for name in counted_by], dtype=np.intp)
    others = np.setdiff1d(np.arange(rows.shape[1]), columns)
    matrix = np.zeros((len(columns), rows.shape[1]))
    matrix[:, columns] = np.eye(len(columns))
    added = np.linalg.lstsq(rows[:, columns], rows[:, others], rcond=None)[0]
    matrix[:, others] = np.where(np.abs(added) > NOTHING, added, 0.0)
    return BaseParameters(
        names=tuple(names[column] for column in columns),
        units=tuple(parameter_unit(kinds[column], bool(tree.slides[column // len(PARAMETERS)])) for column in columns),
        expressions=tuple(_expression(row, int(column), names) for row, column in zip(matrix, columns, strict=True)),
        columns=columns,
        matrix=matrix,
    )


def shown_by(tree: Tree, columns: NDArray[np.intp]) -> Array:
    """What torques in random states have for a unit of each of these `columns` of an arm's parameters, as fewer rows
    (13 njoint x ncolumn) between whose columns all is the same.
    """
    return _reduced(torque_regressor(tree, *random_states(tree, 0)))[:, columns]


def _reduced(regressor: Array) -> Array:
    """A regressor in many states (nstate x njoint x njoint x 13) as fewer rows (13 njoint x 13 njoint) between whose
    columns all is the same.
    """
    states, njoint = regressor.shape[:2]
    with threadpool_limits(1):  # on a busy machine BLAS threads wait for each other a hundred times as long
        return np.asarray(np.linalg.qr(regressor.reshape(states * njoint, -1), mode="r"), dtype=np.float64)


def _independent(rows: Array, kinds: list[str]) -> NDArray[np.intp]:
    """As many columns of these `rows` as are independent of each other (nbase), by parameters of these `kinds`."""
    from scipy.linalg import qr  # slow to load, and only arms need it

    singular = np.linalg.svd(rows, compute_uv=False)
    rank = int((singular > NOTHING * singular[0]).sum())
    weights = np.array([RARELY_FIRST if kind == "m" else 1.0 for kind in kinds])
    weights *= np.linspace(1.0, EARLIER, len(kinds))  # of equal columns the first, however a processor rounds
    order = qr(rows * weights, mode="r", pivoting=True)[1]
    return np.sort(order[:rank])


def seen_by_bias(tree: Tree, base: BaseParameters) -> NDArray[np.bool_]:
    """Which base parameters (nbase) the torque shows of an arm that nothing accelerates, the others in the mass matrix
    alone: those that no combination hides that leaves this torque as it is.
    """
    coordinates, speeds, _ = random_states(tree, 0)
    rows = _reduced(torque_regressor(tree, coordinates, speeds, np.zeros_like(speeds)))
    _, singular, right = np.linalg.svd(rows[:, base.columns], full_matrices=False)
    hidden = right[singular <= NOTHING * singular[0]]
    return np.asarray(np.abs(hidden).max(axis=0, initial=0.0) < np.sqrt(NOTHING))


def _expression(row: Array, column: int, names: list[str]) -> str:
    """A combination of parameters as text, the one that it is counted by first."""
    terms = [names[column]]
    for other in np.flatnonzero(row):
        if other != column:
            size = f"{abs(row[other]):.4g}"
            terms.append(
                ("− " if row[other] < 0.0 else "+ ") + (names[other] if size == "1" else f"{size} {names[other]}")
            )
    return " ".join(terms)
