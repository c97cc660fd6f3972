"""Chains to identify: random, heterogeneous, repeatable, each with a nominal model that is wrong.

| | true | nominal |
| --- | --- | --- |
| length | 0.4 m × U(0.5, 1.5) | the same: lengths are easily measured |
| mass | 1 kg × U(0.5, 1.5) | true × U(0.7, 1.3) |
| centre of mass, from the joint | length / 2 × U(0.5, 1.5) | true × U(0.85, 1.15) |
| inertia about it | mass length² / 12 × U(0.5, 1.5) | true × U(0.7, 1.3) |

Neither centre of mass can lie beyond its link: it is at most 0.75 and 0.8625 of the length.
"""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.plant import LinkSettings

Links = tuple[LinkSettings, ...]


def random_chain(nlink: int, seed: int) -> tuple[Links, Links]:
    """The true links and the nominal links, base first, of the chain of `nlink` links that `seed` means.

    numpy's default_rng([nlink, seed]) draws (nlink) numbers at a time, in the order of the table, the true chain first.
    """
    random = np.random.default_rng([nlink, seed])

    def within(share: float) -> Array:
        return random.uniform(1.0 - share, 1.0 + share, nlink)

    length, mass = 0.4 * within(0.5), within(0.5)
    com = length / 2 * within(0.5)
    inertia = mass * length**2 / 12 * within(0.5)
    return _links(length, mass, com, inertia), _links(
        length, mass * within(0.3), com * within(0.15), inertia * within(0.3)
    )


def _links(*columns: Array) -> Links:
    """`columns`: length, mass, com, inertia, each (nlink), in SI units."""
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return tuple(
        LinkSettings(length=length, mass=mass, com=com, inertia=inertia) for length, mass, com, inertia in rows
    )
