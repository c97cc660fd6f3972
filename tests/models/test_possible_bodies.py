"""The set of all possible bodies with given lumps: it holds the truth, and no body is beyond its ends."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from conftest import random_plant
from threadpoolctl import threadpool_limits

from metaid.models import Array, Chain, KnownLumps, body_extents, known_lumps, lump_names

pytestmark = pytest.mark.slow

LENGTHS_GIVEN = ("gravity", "inertia")
LENGTHS_FREE = ("gravity", "inertia", "length")


def known(chain: Chain, spread: float, kinds: tuple[str, ...] = LENGTHS_GIVEN, reach: float = 1.96) -> KnownLumps:
    """The parameters of a chain, as an estimate knows them whose relative errors are correlated and about `spread`."""
    names, values = lump_names(chain.nlink, LENGTHS_GIVEN), chain.lumps_of(LENGTHS_GIVEN).vector
    if kinds != LENGTHS_GIVEN:
        names = [*names, *(f"length_{i + 1}" for i in range(chain.nlink - 1))]
        values = np.append(values, chain.length[:-1])
    mixed = np.random.default_rng(len(names)).normal(size=(len(names), len(names)))
    covariance = spread**2 * (mixed @ mixed.T) / len(names)
    length = chain.length if kinds == LENGTHS_GIVEN else None
    return known_lumps(names, values, covariance, reach, length)


def extents_of(lumps: KnownLumps) -> Array:
    """The extents (2 x nparameter) of bodies that there are."""
    with threadpool_limits(1):  # as results have it: at this size threads of BLAS cost far more than they give
        found = body_extents(lumps)
    assert found is not None
    return found


def drawn_bodies(gravity: Array, inertia: Array, length: Array, random: np.random.Generator) -> Array:
    """Masses, centres of mass and inertias (... x 3 nlink) of random links with these lumps (... x nlink), without
    impossible ones. Masses are drawn, and all else follows from Eqs. 1 and 3.
    """
    largest = gravity[..., :-1] / length[..., :-1]
    outer = largest * random.uniform(size=largest.shape)
    mass = np.concatenate([10.0 ** random.uniform(-2.0, 6.0, outer[..., :1].shape), outer], axis=-1)
    if mass.shape[-1] < gravity.shape[-1]:  # a single link
        mass = 10.0 ** random.uniform(-2.0, 6.0, gravity.shape)
    outboard = np.cumsum(mass[..., ::-1], axis=-1)[..., ::-1] - mass
    com = (gravity - length * outboard) / mass
    own = inertia - mass * com**2 - length**2 * outboard
    possible = ((com >= 0.0) & (com <= length) & (own >= 0.0)).all(axis=-1)
    return np.concatenate([mass, com, own], axis=-1)[possible]


@pytest.mark.parametrize("kinds", [LENGTHS_GIVEN, LENGTHS_FREE], ids=["lengths given", "lengths free"])
@pytest.mark.parametrize("nlink", [1, 2, 5])
def test_true_links_are_among_the_bodies_that_their_lumps_leave_possible(nlink: int, kinds: tuple[str, ...]) -> None:
    """Whether the lumps are known exactly or to a percent, and whether lengths are given or follow from the lumps."""
    for seed in range(2):
        chain = random_plant(nlink, seed).chain
        true = np.concatenate([chain.mass, chain.com, chain.inertia, chain.length])
        for spread in (1e-12, 0.01):
            lumps = known(chain, spread, kinds)
            low, high = extents_of(lumps)
            within = (low <= true[: len(low)]) & (true[: len(low)] <= high)
            assert within.all(), [name for name, inside in zip(lumps.names, within, strict=True) if not inside]


@pytest.mark.parametrize(("nlink", "near"), [(1, 0.001), (2, 0.02), (3, 0.1)])
def test_drawn_bodies_with_the_same_lumps_reach_to_the_ends_and_not_beyond(nlink: int, near: float) -> None:
    """No possible body of 200,000 is outside, and some come near every end that there is."""
    chain = random_plant(nlink).chain
    lumps = known(chain, 1e-12)
    low, high = extents_of(lumps)
    size = (200_000, nlink)
    drawn = drawn_bodies(
        *(np.broadcast_to(each, size) for each in (lumps.gravity, lumps.inertia, lumps.length)),
        np.random.default_rng(1),
    )
    assert len(drawn) > 100
    bounded = np.isfinite(high)
    assert np.flatnonzero(~bounded).tolist() == [0]  # the mass of the first link
    width = np.where(bounded, high, 2.0 * low) - low
    assert (drawn.min(axis=0) >= low - 1e-9 * width).all()
    assert (drawn.max(axis=0) <= high + 1e-9 * width).all()
    assert (drawn.min(axis=0) <= low + near * width).all()
    assert (drawn.max(axis=0) >= np.where(bounded, high - near * width, 1e5)).all()


@pytest.mark.parametrize("nlink", [2, 3])
def test_no_body_whose_lumps_are_within_the_ellipsoid_is_beyond_the_ends(nlink: int) -> None:
    """Lumps are drawn on the ellipsoid of what is known to a percent, and for each of them bodies."""
    chain, random = random_plant(nlink).chain, np.random.default_rng(2)
    lumps = known(chain, 0.01)
    low, high = extents_of(lumps)
    direction = random.normal(size=(200_000, 2 * nlink))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    factors = np.exp(direction @ lumps.root.T)
    gravity, inertia = lumps.gravity * factors[:, :nlink], lumps.inertia * factors[:, nlink:]
    drawn = drawn_bodies(gravity, inertia, np.broadcast_to(lumps.length, gravity.shape), random)
    assert len(drawn) > 100
    width = np.where(np.isfinite(high), high, 2.0 * low) - low
    assert (drawn.min(axis=0) >= low - 1e-6 * width).all()
    assert (drawn.max(axis=0) <= high + 1e-6 * width).all()


def test_ends_come_nearer_as_lumps_are_known_better() -> None:
    """Each set of bodies is within the one of wider intervals, and the last one is that of exact lumps."""
    chain = random_plant(3).chain
    widths = [extents_of(known(chain, 0.01, reach=reach)) for reach in (2.0, 1.0, 0.1, 1e-9)]
    for wider, narrower in itertools.pairwise(widths):
        assert (wider[0] <= narrower[0] + 1e-9).all()
        assert (wider[1] >= narrower[1] - 1e-9).all()
    assert (widths[0] != widths[-1]).sum() > 10


def test_lengths_that_are_not_given_follow_from_the_lumps_but_for_the_last() -> None:
    """l_i = a_ij / μ_j: the first ones are as well known as the lumps, the last is only longer than its centre of mass
    is far out.
    """
    chain = random_plant(3).chain
    lumps = known(chain, 1e-6, LENGTHS_FREE)
    low, high = extents_of(lumps)
    assert lumps.names[-3:] == ["length_1", "length_2", "length_3"]
    assert lumps.units[-3:] == ["m"] * 3
    assert low[-3:-1] == pytest.approx(chain.length[:-1], rel=1e-5)
    assert high[-3:-1] == pytest.approx(chain.length[:-1], rel=1e-5)
    assert (low[-3:-1] < high[-3:-1]).all()
    assert np.isinf(high[-1])
    assert low[-1] == low[lumps.names.index("com_3")]


def test_lumps_that_no_links_have_leave_no_body() -> None:
    """A second moment that is too small for the first one, on links of these lengths."""
    chain = random_plant(2).chain
    lumps = known(chain, 1e-6)
    impossible = KnownLumps(lumps.gravity, lumps.inertia * [0.3, 1.0], lumps.length, lumps.root)
    assert body_extents(impossible) is None
