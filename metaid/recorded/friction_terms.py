"""Which terms of friction and which springs are taken up, in which joints, by the error on parts left out.  Eq. 72."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.models.tree import COLUMNS
from metaid.recorded.comparing import WORTH, Missed, Search
from metaid.recorded.weak_form.equations import Equations
from metaid.recorded.weak_form.linear_model import LinearModel

PRESLIDING = (1e-4, 3e-4, 1e-3, 3e-3)  # rad or m, of all joints alike
BENT = (2.0, 7.0, 20.0)  # times the speed below which dry friction is cut short, of all joints alike, and the most
FINER = (0.3, 0.55, 1.0, 1.8, 3.3, 6.0, 10.0)  # times either, of each joint by itself
SPRING, SPRUNG = "spring", 0.95  # of the error that springs leave at most: beyond what a log reaches they grow
Further = tuple[str, NDArray[np.bool_], Callable[[NDArray[np.bool_]], LinearModel]]


def with_friction(
    search: Search, present: Equations, missed: Missed, asked: tuple[str, ...] | None
) -> tuple[Equations, Missed]:
    """Equations with the terms of friction that are worth their while, one after the other, the best first, and what
    these leave.

    Args:
        search: what is compared.
        present: what is chosen.
        missed: what that leaves.
        asked: the terms that the user chose, of hysteresis and bent friction the better one; None where all are tried.
    """
    model, every = present.model, np.ones(present.model.njoint)
    states = [model.with_presliding(size * every) for size in PRESLIDING if "hysteresis" in (asked or ())]
    states += [model.with_bent(factor * model.sliding.still) for factor in BENT if "bent" in (asked or ())]
    if states:
        others = [present.with_model(each) for each in states]
        missed, present = min(zip(search.missed(others), others, strict=True), key=lambda each: each[0].whole)
    while asked is None:
        worth = _worth(search, present, missed, list(_further(present.model)))
        if not worth:
            break
        missed, present = min(worth, key=lambda each: float(np.prod(each[0].shares(missed))))
    sliding = present.model.sliding
    if sliding.builds_up:
        present, missed = _finer(search, present, missed, sliding.presliding, present.model.with_presliding, np.inf)
    if sliding.bent.any():
        most = BENT[-1] * sliding.still  # beyond it dry friction is hardly told from viscous, and grows without bound
        present, missed = _finer(search, present, missed, sliding.bent, present.model.with_bent, most)
    return present, missed


def with_springs(search: Search, present: Equations, missed: Missed) -> tuple[Equations, Missed]:
    """Equations with springs, each slack somewhere, where all joints together are far better predicted by them, and
    folds agree in that: in the joints without whose own spring what is left out would be predicted worse. Where a
    joint is 0 has to mean something. Friction is plain then, to be chosen anew. And what these leave.

    Args:
        search: what is compared.
        present: what is chosen.
        missed: what that leaves.
    """
    model, joints = present.model, present.model.placed
    if not joints.any():
        return present, missed
    found = search.missed([present.with_model(model.with_springs(joints))])[0]
    search.tried.append((SPRING, found.shares(missed)[0]))
    if found.shares(missed)[0] > SPRUNG:
        return present, missed
    own, needed = np.diag(joints)[joints], joints.copy()
    without = search.missed([present.with_model(model.with_springs(joints & ~each)) for each in own])
    for each, less in zip(own, without, strict=True):
        needed &= ~each | found.is_worth(less, each)
    other = present.with_model(model.with_springs(needed))
    found = search.missed([other])[0]
    search.tried.append((f"spring of {', '.join(np.array(model.joints)[needed])}", found.shares(missed)[0]))
    if found.shares(missed)[0] > SPRUNG or not found.is_agreed(missed):
        return present, missed
    plain = other.with_model(other.model.plain)  # what was taken up may have stood for them
    return plain, search.missed([plain])[0]


def _further(model: LinearModel) -> Iterator[Further]:
    """What may be added to the friction of a model: its name, the joints that lack it (njoint), and the model with it
    in some of them.
    """
    presliding = model.sliding.presliding
    for term in COLUMNS:
        lacks = model.lacking(term)
        if lacks.any() and term != SPRING:
            yield term, lacks, partial(model.with_term, term)
    for size in PRESLIDING if (presliding == 0.0).any() else ():
        more = partial(_with_presliding, model, size)
        yield f"hysteresis, δ = {size:g}", presliding == 0.0, more
    at_once = (presliding == 0.0) & (model.sliding.bent == 0.0)
    for factor in BENT if at_once.any() and {"coulomb", "root"} & set(model.friction) else ():
        bent = partial(_with_bent, model, factor * model.sliding.still)
        yield f"dry friction bent, v = {factor:.0f} % of usual speeds", at_once, bent


def _with_presliding(model: LinearModel, size: float, joints: NDArray[np.bool_]) -> LinearModel:
    return model.with_presliding(np.where(joints, size, model.sliding.presliding))


def _with_bent(model: LinearModel, bent: Array, joints: NDArray[np.bool_]) -> LinearModel:
    return model.with_bent(np.where(joints, bent, model.sliding.bent))


def _worth(
    search: Search, present: Equations, missed: Missed, further: Sequence[Further]
) -> list[tuple[Missed, Equations]]:
    """What may be added that is worth its while: to the friction of all joints, or where that is not, of those whose
    own torque is then predicted better by WORTH.

    Args:
        search: what is compared.
        present: what is chosen.
        missed: what that leaves.
        further: what may be added.
    """
    model = present.model
    others = [present.with_model(widened(lacks)) for _, lacks, widened in further]
    found = search.missed(others)
    gaining = [lacks & each.gains(missed) for (_, lacks, _), each in zip(further, found, strict=True)]
    names, in_some = [what for what, _, _ in further], []
    for number, ((_, lacks, widened), gains) in enumerate(zip(further, gaining, strict=True)):
        for pair in map(list, model.sliding.coupled):  # one motor
            gains[pair] = gains[pair].any()
        gains &= lacks
        if gains.any() and not gains[lacks].all() and not found[number].is_worth(missed):
            names[number] += f" of {', '.join(np.array(model.joints)[gains])}"
            others[number] = present.with_model(widened(gains))
            in_some.append(number)
    for number, each in zip(in_some, search.missed([others[number] for number in in_some]), strict=True):
        found[number] = each
    search.tried += [(what, each.shares(missed)[0]) for what, each in zip(names, found, strict=True)]
    return [
        (each, other)
        for each, other, gains in zip(found, others, gaining, strict=True)
        if each.is_worth(missed) or each.is_worth(missed, gains)
    ]


def _finer(
    search: Search,
    present: Equations,
    missed: Missed,
    common: Array,
    changed: Callable[[Array], LinearModel],
    most: Array | float,
) -> tuple[Equations, Missed]:
    """With the displacement over which the friction of each joint builds up, or the speed below which it bends: of
    those that predict its own torque as well, to WORTH, the largest, which is the gentlest to simulate.

    Args:
        search: what is compared.
        present: what is chosen.
        missed: what that leaves.
        common: of the joints (njoint), all alike; 0 of those that have it not.
        changed: the model with others (njoint).
        most: that they may be (njoint, or of all).
    """
    tried = np.minimum(np.outer(FINER, common), most)
    every = search.missed([present.with_model(changed(each)) for each in tried])
    by_joint = np.array([each.by_joint for each in every])
    is_as_good = WORTH * by_joint <= by_joint.min(axis=0)
    other = present.with_model(changed(np.where(is_as_good, tried, 0.0).max(axis=0)))
    found = search.missed([other])[0]
    return (other, found) if WORTH * found.whole <= missed.whole else (present, missed)
