"""Which terms of friction and which springs are taken up, in which joints, by the error on parts left out.  Eq. 72."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.models.tree import COLUMNS
from metaid.recorded.comparing import WORTH, Candidate, Search
from metaid.recorded.weak_form.linear_model import BASE, How, LinearModel

PRESLIDING = (1e-4, 3e-4, 1e-3, 3e-3)  # rad or m, of all joints alike
BENT = (2.0, 7.0, 20.0)  # times the speed below which dry friction is cut short, of all joints alike, and the most
FINER = (0.3, 0.55, 1.0, 1.8, 3.3, 6.0, 10.0)  # times either, of each joint by itself
SPRING, SPRUNG = "spring", 0.95  # of the error that springs leave at most: beyond what a log reaches they grow
Further = tuple[str, NDArray[np.bool_], Callable[[NDArray[np.bool_]], LinearModel]]


def with_friction(search: Search, best: Candidate, asked: tuple[str, ...] | None) -> Candidate:
    """The best with the terms of friction that are worth their while, one after the other, the best first; or with
    those that the user `asked` for, of hysteresis and bent friction the better one.
    """
    model = best.model
    states = [model.with_sliding("presliding", size) for size in PRESLIDING if "hysteresis" in (asked or ())]
    states += [model.with_sliding("bent", factor * model.sliding.still) for factor in BENT if "bent" in (asked or ())]
    if states:
        best = min(search.models(best, states), key=lambda each: each.whole)
    while asked is None:
        worth = _worth(search, best, list(_further(best.model)))
        if not worth:
            break
        best = min(worth, key=lambda each: float(np.prod(each.shares(best))))
    sliding = best.model.sliding
    if sliding.builds_up:
        best = _finer(search, best, "presliding", np.inf)
    if sliding.bent.any():
        most = BENT[-1] * sliding.still  # beyond it dry friction is hardly told from viscous, and grows without bound
        best = _finer(search, best, "bent", most)
    return best


def with_springs(search: Search, best: Candidate) -> Candidate:
    """The best with springs, each slack somewhere, where all joints together are far better predicted by them, and
    folds agree in that: in the joints without whose own spring what is left out would be predicted worse. Where a
    joint is 0 has to mean something. Friction is plain then, to be chosen anew.
    """
    model, joints = best.model, best.model.placed
    if not joints.any():
        return best
    found = search.noted(SPRING, search.model(best, model.with_springs(joints)), best)
    if found.shares(best)[0] > SPRUNG:
        return best
    own, needed = np.diag(joints)[joints], joints.copy()
    without = search.models(best, [model.with_springs(joints & ~each) for each in own])
    for each, less in zip(own, without, strict=True):
        needed &= ~each | found.is_worth(less, each)
    where = f"spring of {', '.join(model.named(needed))}"
    found = search.noted(where, search.model(best, model.with_springs(needed)), best)
    if found.shares(best)[0] > SPRUNG or not found.is_agreed(best):
        return best
    return search.model(best, found.model.plain)  # what was taken up may have stood for them


def without_needless(search: Search, best: Candidate) -> Candidate:
    """The best without the terms of friction, one after the other, without which what is left out is predicted better:
    what was taken up early may have stood for something that came later.
    """
    fewer = list(_fewer(best.model))
    found = search.models(best, [best.model.with_rubbing(best.model.rubbing - gone) for _, gone in fewer])
    needless = [(each, *of) for each, of in zip(found, fewer, strict=True) if each.is_cleared(best)]
    for _, what, gone in sorted(needless, key=lambda each: float(np.prod(each[0].shares(best)))):
        if gone <= best.model.rubbing:
            less = search.model(best, best.model.with_rubbing(best.model.rubbing - gone))
            best = search.noted(f"without {what}", less, best) if less.is_cleared(best) else best
    return best


def _fewer(model: LinearModel) -> Iterator[tuple[str, frozenset[tuple[str, int]]]]:
    """What may be left out of the friction of a model: its name, and the terms of joints that it is. Viscous and
    Coulomb friction stay, and an offset where a spring is slack.
    """
    coupled = [set(pair) for pair in model.sliding.coupled]  # one motor
    sprung = set(model.having(SPRING))
    for term in model.friction:
        joints = set() if term in (*BASE, SPRING) else set(model.having(term))
        joints -= sprung if term == "offset" else set()
        motors = [*(pair for pair in coupled if pair <= joints), *({each} for each in joints - set().union(*coupled))]
        for some in [joints, *motors] if len(motors) > 1 else motors:
            which = np.isin(np.arange(model.njoint), list(some))
            yield f"{term} of {', '.join(model.named(which))}", frozenset((term, joint) for joint in some)


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
        yield f"hysteresis, δ = {size:g}", presliding == 0.0, partial(model.with_sliding, "presliding", size)
    at_once = (presliding == 0.0) & (model.sliding.bent == 0.0)
    for factor in BENT if at_once.any() and {"coulomb", "root"} & set(model.friction) else ():
        bent = partial(model.with_sliding, "bent", factor * model.sliding.still)
        yield f"dry friction bent, v = {factor:.0f} % of usual speeds", at_once, bent


def _worth(search: Search, best: Candidate, further: Sequence[Further]) -> list[Candidate]:
    """The best with what may be added `further` and is worth its while: to the friction of all joints, or where that is
    not, of those whose own torque is then predicted better by WORTH.
    """
    model = best.model
    found = search.models(best, [widened(lacks) for _, lacks, widened in further])
    gaining = [lacks & each.gains(best) for (_, lacks, _), each in zip(further, found, strict=True)]
    names, in_some = [what for what, _, _ in further], {}
    for number, ((_, lacks, widened), gains) in enumerate(zip(further, gaining, strict=True)):
        for pair in map(list, model.sliding.coupled):  # one motor
            gains[pair] = gains[pair].any()
        gains &= lacks
        if gains.any() and not gains[lacks].all() and not found[number].is_worth(best):
            names[number] += f" of {', '.join(model.named(gains))}"
            in_some[number] = widened(gains)
    for number, each in zip(in_some, search.models(best, in_some.values()), strict=True):
        found[number] = each
    for what, each in zip(names, found, strict=True):
        search.noted(what, each, best)
    every = zip(found, gaining, strict=True)
    return [each for each, gains in every if each.is_worth(best) or each.is_worth(best, gains)]


def _finer(search: Search, best: Candidate, how: How, most: Array | float) -> Candidate:
    """With the displacement over which the friction of each joint builds up, or the speed below which it bends: of
    those that predict its own torque as well, to WORTH, the largest, which is the gentlest to simulate.

    Args:
        search: what is compared.
        best: what is chosen.
        how: dry friction follows the motion; its sizes are alike now, and 0 in joints where it is there at once.
        most: that they may be (njoint, or of all).
    """
    changed = partial(best.model.with_sliding, how)
    tried = np.minimum(np.outer(FINER, getattr(best.model.sliding, how)), most)
    by_joint = np.array([each.by_joint for each in search.models(best, map(changed, tried))])
    is_as_good = WORTH * by_joint <= by_joint.min(axis=0)
    found = search.model(best, changed(np.where(is_as_good, tried, 0.0).max(axis=0)))
    return found if WORTH * found.whole <= best.whole else best
