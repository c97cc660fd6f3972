"""Episodes in Python: one push, or one candidate of a study, without a DB."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from metaid.episode import Episode, Outcome, tip_push
from metaid.errors import EpisodeError
from metaid.models import LARGEST_FACTOR, Array, Lumps, factors_from_names
from metaid.models.tree import ArmPrior
from metaid.plant import ArmPlant, MujocoPlant, load_plant
from metaid.study import COUNTING_STEPS, TIP_SPEED, EstimateSettings, StudySpec, drawn_nominal, load_study, problem_of

if TYPE_CHECKING:
    from metaid.compiled import ArmPush, Objective  # loads MuJoCo and numba, which a reader of a DB does without


ARM_STEPS = 150  # after a push of an arm: as long as those of a study


def episode_objective(plant: MujocoPlant, steps: int | None = None) -> Objective:
    """An objective of one small push at the tip, in factors of the plant's own lumps, with the usual number of `steps`
    where none is stated.
    """
    from metaid.compiled import Objective

    lumps = plant.true_lumps()
    if lumps is None:
        raise EpisodeError(
            f"plant {plant.name} does not report its lumps, so there are no factors of them: "
            "make a study with a nominal model"
        )
    episode = Episode(tip_push(plant, TIP_SPEED), COUNTING_STEPS if steps is None else steps)
    return Objective(plant, lumps, episode, "crossing")


def check_factors(factors: Mapping[str, float], lumps: Lumps) -> Array:
    """Factors by lump name → (nlump) of those that `lumps` searches, 1 for those not named.  Raises EpisodeError on
    unknown names and on numbers that are no factors.
    """
    _refuse_no_factors(factors)
    return factors_from_names(dict(factors), lumps.nlink, kinds=lumps.searched)


def _refuse_no_factors(factors: Mapping[str, float]) -> None:
    """Raises EpisodeError for a number that is no factor."""
    for name, factor in factors.items():
        if not isinstance(factor, Real) or not 0.0 <= factor <= LARGEST_FACTOR:
            raise EpisodeError(f"factor {name}={factor} (allowed: 0 to {LARGEST_FACTOR:g})")


def perturb(
    plant: str | Path | Mapping[str, Any] | MujocoPlant | ArmPlant,
    factors: Mapping[str, float] | None = None,
    steps: int | None = None,
    seed: int = 0,
    nominal: int | None = None,
) -> dict[str, Any]:
    """One episode, without any study: of a chain a small push at the tip, with `factors` of the plant's own lumps by
    name; of an arm a push from a pose and speeds in its joint ranges, with `factors` of its base parameters.

    Args:
        plant: a shipped name, a path, a dict with the keys of a plant file, or the plant.
        factors: by name; of an arm `all` is that of all base parameters. Default: 1.
        steps: after the push; default: 5000, of an arm 150.
        seed: of where an arm begins.
        nominal: of an arm: the law is that of an arm like it, drawn with this seed as `[nominal]` in a study draws it.

    Returns:
        What `metaid episode --json` prints.

    Raises:
        PlantError: there is no such plant.
        EpisodeError: it has no such lump, or does not report what it is.

    Example:
        >>> metaid.perturb("one-link", {"gravity_1": 1.05})["periods"]
        [2]
        >>> metaid.perturb("one-link", {"gravity_1": 0.95})["fell"]
        True
    """
    loaded = load_plant(plant) if isinstance(plant, str | Path | Mapping) else plant
    if isinstance(loaded, MujocoPlant):
        objective = episode_objective(loaded, steps)
        return objective.summary(check_factors(factors or {}, objective.nominal))
    return arm_push(loaded, factors or {}, steps, seed, nominal).summary()


def arm_push(
    plant: ArmPlant, factors: Mapping[str, float], steps: int | None = None, seed: int = 0, nominal: int | None = None
) -> ArmPush:
    """One push of an arm, with its motion.

    Args:
        plant: the arm.
        factors: of the base parameters by name, or of `all`.
        steps: after the push; default: 150.
        seed: of where it begins.
        nominal: the law is that of an arm like it, drawn with this seed.

    Raises:
        EpisodeError: it has no such base parameter, or does not report what it is.
    """
    from metaid.compiled import push_arm

    if plant.true_parameters() is None:
        raise EpisodeError(
            f"plant {plant.name} does not report its parameters, so there are no factors of them: "
            "make a study with a nominal arm"
        )
    _refuse_no_factors(factors)
    prior = EstimateSettings().prior
    law = plant.tree if nominal is None else drawn_nominal(plant.tree, nominal, prior)
    known = ArmPrior(law, prior)
    return push_arm(plant, known.parameters_at(known.scaled(dict(factors))), steps or ARM_STEPS, seed)


def evaluate(study: str | Path | StudySpec, factors: Mapping[str, float] | None = None) -> Outcome:
    """One candidate of a study, `factors` of its nominal lumps or base parameters by name, without any DB.  Raises
    StudyError, PlantError, EpisodeError.

    Example:
        >>> metaid.evaluate("one-link-count", {"gravity_1": 1.5})
        Outcome(value=7.0, fell=False, steps=5000, periods=(7,), failure=None)
    """
    given, problem = dict(factors or {}), problem_of(spec_of(study))
    _refuse_no_factors(given)
    with closing(problem.make_objective()) as objective:
        outcome: Outcome = objective.evaluate(problem.robot.candidate(given))
        return outcome


def spec_of(study: str | Path | StudySpec) -> StudySpec:
    """The settings of a study: those given, or of that name or path."""
    return load_study(study) if isinstance(study, str | Path) else study
