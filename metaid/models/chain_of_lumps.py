"""A chain that has given lumps: its lengths follow from them, its bodies are the possible ones closest to a nominal
chain's.

Lumps that a sampler found one by one are no chain's exactly, for a_ij / μ_j is the length of link i whatever j is
(Eq. 2). Then it is the chain whose lumps are closest to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models.chain import Chain
from metaid.models.closest_bodies import Matrices, closest
from metaid.models.lumps import Array, Lumps
from metaid.models.possible import LEAST_GYRATION
from metaid.models.possible_bodies import masses_beyond

FLOOR = 1e-3  # of a link: a nominal quantity that is smaller counts as this share of the link


@dataclass(frozen=True)
class ChainOfLumps:
    """A `chain`; None where no possible bodies have the lumps. `excess` (nlump): by how much the lumps that it was made
    of are larger than the chain's, as a share.
    """

    chain: Chain | None
    excess: Array


def chain_of_lumps(lumps: Lumps, nominal: Chain, known: NDArray[np.bool_]) -> ChainOfLumps:
    """The chain with these `lumps`. Its friction is that of the lumps, and it has no springs.  Eqs. 48 and 54.

    Args:
        lumps: `searched` are gravity, Coriolis and, unless the inertias of the links are free, inertia lumps.
        nominal: the chain whose bodies it is to be close to. A length that no lump tells is as its.
        known: which of the lumps (nlump) count.
    """
    if not (lumps.vector > 0.0).all():
        return ChainOfLumps(None, np.zeros(len(lumps.vector)))
    n, logs = lumps.nlink, np.log(lumps.vector)
    first, second = np.triu_indices(n, 1)
    pairs = n + np.arange(len(first))
    told = np.isin(np.arange(n), first[known[pairs]])  # lengths that a Coriolis lump tells
    design = np.zeros((len(logs), 2 * n + len(logs) - n - len(first)))  # logs of lumps by those of l, μ and d
    others = np.delete(np.arange(len(logs)), pairs)
    design[others, n + np.arange(len(others))] = 1.0
    design[pairs, first] = design[pairs, n + second] = 1.0
    unknowns = np.concatenate([np.log(nominal.length), logs[others]])
    used = known.copy()
    used[pairs] &= told[first]
    free = design[used].any(axis=0)
    unexplained = (logs - design @ unknowns)[used]
    unknowns[free] += np.linalg.lstsq(design[np.ix_(used, free)], unexplained, rcond=None)[0]
    values, fitted = np.exp(unknowns), design @ unknowns
    inertia = values[2 * n :] if "inertia" in lumps.searched else None
    return ChainOfLumps(_closest(values[:n], values[n : 2 * n], inertia, lumps, nominal), np.expm1(logs - fitted))


def _closest(length: Array, gravity: Array, inertia: Array | None, lumps: Lumps, nominal: Chain) -> Chain | None:
    """The chain with these `length`s and lumps, closest to the nominal one; None if there is no possible one.

    Masses are free, and moments of inertia unless `inertia` has the lumps d_i. With them first moments s_i and second
    moments J_i about the joints are linear (Eq. 48).

    Args:
        length: of the links (nlink), in m.
        gravity: μ (nlink), in kg m.
        inertia: d (nlink), in kg m², or None where they are free.
        lumps: of its friction.
        nominal: the chain that it is to be close to.
    """
    if inertia is not None and not np.less_equal(*masses_beyond(gravity, inertia, length)).all():
        return None
    n, nfree = len(length), len(length) * (1 if inertia is not None else 2)
    own, outboard = np.eye(n, nfree), np.triu(np.ones((n, nfree)), 1)
    outboard[:, n:] = 0.0
    # Offset and slope of s_i and J_i by the free parameters: all m_i, then, where they are free, all J_i.
    moment = gravity, -length[:, None] * outboard
    second = np.zeros(n), np.eye(n, nfree, k=n)
    if inertia is not None:
        second = inertia, -(length**2)[:, None] * outboard
    least = (LEAST_GYRATION * length) ** 2  # of I_i / m_i
    matrices = [np.zeros((n, 2, 2)), np.zeros((n, 2, 2, nfree)), np.zeros((n, 2, 2))]
    nominal_moment = nominal.mass * nominal.com
    floor = FLOOR * nominal.mass * nominal.length
    beyond_least = np.maximum(nominal.inertia - least * nominal.mass, floor * FLOOR * nominal.length)
    about_joint = beyond_least + nominal.mass * nominal.com**2
    entries = (
        ((0, 0), np.zeros(n), own, nominal.mass),
        ((0, 1), *moment, nominal_moment),
        ((1, 1), second[0], second[1] - least[:, None] * own, about_joint),
    )
    for (row, column), *parts in entries:
        for matrix, part in zip(matrices, parts, strict=True):
            matrix[:, row, column] = matrix[:, column, row] = part
    # A centre of mass is on its link, as a plant file has it: s_i > 0 and l_i m_i > s_i.
    rest = -moment[0], length[:, None] * own - moment[1]
    nominal_rest = nominal.length * nominal.mass - nominal_moment
    ends = [
        Matrices(offset[:, None, None], slope[:, None, None], np.maximum(usual, floor)[:, None, None])
        for (offset, slope), usual in ((moment, nominal_moment), (rest, nominal_rest))
    ]
    start = np.concatenate([nominal.mass, about_joint])[:nfree]
    found = closest([Matrices(*matrices), *ends], start)
    if not found.is_possible:
        return None
    mass, (s, about) = found.x[:n], (offset + slope @ found.x for offset, slope in (moment, second))
    return Chain(
        length=length,
        mass=mass,
        com=s / mass,
        inertia=about - s**2 / mass,
        damping=lumps.of("damping"),
        coulomb=lumps.of("coulomb"),
        stiffness=np.zeros(n),
    )
