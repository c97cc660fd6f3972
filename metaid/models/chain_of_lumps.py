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
from metaid.models.lumps import Array, Lumps, link_pairs
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
    """The chain with these `lumps`. Its friction is that of the lumps, and it has no springs.  Eqs. 19 and 77.

    Args:
        lumps: `searched` are gravity, Coriolis and, unless the inertias of the links are free, inertia lumps.
        nominal: the chain whose bodies it is to be close to. A length that no lump tells is as its.
        known: which of the lumps (nlump) count.
    """
    if not (lumps.vector > 0.0).all():
        return ChainOfLumps(None, np.zeros(len(lumps.vector)))
    n, logs = lumps.nlink, np.log(lumps.vector)
    first, second = link_pairs(n)
    pairs = n + np.arange(len(first))
    told = np.isin(np.arange(n), first[known[pairs]])  # lengths that a Coriolis lump tells
    others = np.delete(np.arange(len(logs)), pairs)
    design = np.zeros((len(logs), n + len(others)))  # logs of lumps by those of l, μ and d
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
    moments J_i about the joints are linear (Eq. 19).

    Args:
        length: of the links (nlink), in m.
        gravity: μ (nlink), in kg m.
        inertia: d (nlink), in kg m², or None where they are free.
        lumps: of its friction.
        nominal: the chain that it is to be close to.
    """
    if inertia is not None and not np.less_equal(*masses_beyond(gravity, inertia, length)).all():
        return None
    from scipy.linalg import null_space  # slow to load

    n = len(length)
    outboard = np.triu(np.ones((n, n)), 1)  # the masses that each link carries
    nominal_moment, least = nominal.mass * nominal.com, (LEAST_GYRATION * length) ** 2  # least of I_i / m_i
    floor = FLOOR * nominal.mass * nominal.length
    beyond_least = np.maximum(nominal.inertia - least * nominal.mass, floor * FLOOR * nominal.length)
    about_joint = beyond_least + nominal.mass * nominal.com**2

    def moments(mass: Array, about: Array) -> tuple[Array, Array]:
        """s and J of links with these masses; J is `about` where no lump has it."""
        carried = outboard @ mass
        return gravity - length * carried, about if inertia is None else inertia - length**2 * carried

    mass, first, second = np.eye(3 * n).reshape(3, n, 3 * n)
    lumps_of = [first + length[:, None] * outboard @ mass]
    if inertia is not None:
        lumps_of.append(second + (length**2)[:, None] * outboard @ mass)
    links = np.stack([mass, first, first, second - least[:, None] * mass], axis=1).reshape(n, 2, 2, 3 * n)
    usual = np.stack([nominal.mass, nominal_moment, nominal_moment, about_joint], axis=1).reshape(n, 2, 2)
    # A centre of mass is on its link, as a plant file has it: s_i > 0 and l_i m_i > s_i.
    ends = (first, nominal_moment), (length[:, None] * mass - first, nominal.length * nominal.mass - nominal_moment)
    groups = [
        Matrices(links, usual),
        *(Matrices(slope[:, None, None], np.maximum(size, floor)[:, None, None]) for slope, size in ends),
    ]
    start = np.concatenate([nominal.mass, *moments(nominal.mass, about_joint)])
    found = closest(groups, start, null_space(np.vstack(lumps_of)))
    if found is None:
        return None
    masses, about = np.split(found, 3)[::2]
    s, about = moments(masses, about)
    return Chain(
        length=length,
        mass=masses,
        com=s / masses,
        inertia=about - s**2 / masses,
        damping=lumps.of("damping"),
        coulomb=lumps.of("coulomb"),
        stiffness=np.zeros(n),
    )
