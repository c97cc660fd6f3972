"""Settings of a study that are fine one by one and contradict each other, or make more than can be computed; and
factors that name what is not there.
"""

from __future__ import annotations

import numpy as np

from metaid.episode import Measure, get_measure
from metaid.errors import EpisodeError, StudyError, unknown
from metaid.models import FRICTION, IDEAL, Array, Chain, factors_from_names
from metaid.plant import FAULT_UNITS
from metaid.search import SAMPLERS, SAMPLES
from metaid.study.settings import EpisodeSettings, EstimateSettings, Factors, SearchSettings
from metaid.study.spec import StudySpec

MOST_STEPS = 100_000_000  # of a trial: some ten seconds of a core at two links, minutes at ten
MOST_MEMORY = 8 * 2**30  # bytes
AT_ONCE = 32  # trials of a generation whose angles are kept until their measure is known
RESTS = 200  # horizons of a push for which the readings of a noisy plant at rest are watched
NUMBER = 8  # bytes
OF_JOINTS = ("viscous", "dry", "rotor")  # faults that are among the base parameters of an arm
HIGH = 2.0  # upper bound of a factor by default
ROUGH_HIGH = 8.0  # the same of gravity lumps where torques are noisy, for there laws over-compensate much


def check_settings(spec: StudySpec) -> None:
    """Raises StudyError where settings contradict each other, of a study of any robot."""
    study, estimate, njoint = spec.study, spec.study.estimate, len(spec.joints)
    if study.sampler not in SAMPLERS:
        raise StudyError(f"sampler: {unknown('sampler', study.sampler, SAMPLERS)}")
    if not spec.is_simulated and study.workers != 1:
        raise StudyError(f"plant {spec.plant_name} is one rig: workers is {study.workers} (allowed: 1)")
    if (wrong := spec.faults.misfits(njoint, 2 if spec.is_arm else 1)) is not None:
        raise StudyError(f"plant {spec.plant_name}: {wrong}")
    if (wrong := _wrong_faults(estimate, spec)) is not None:
        raise StudyError(f"estimate: faults: {wrong}")
    limit = estimate.torque_limit
    if limit is not None and not (estimate.enabled and spec.keeps_readings):
        raise StudyError(
            "estimate: torque_limit: only an estimate from readings knows of it (allowed: on a rig or a plant with "
            "[faults], with enabled = true)"
        )
    if isinstance(limit, tuple) and len(limit) != njoint:
        raise StudyError(f"estimate: torque_limit has {len(limit)} numbers (allowed: one, or {njoint})")


def _wrong_faults(estimate: EstimateSettings, spec: StudySpec) -> str | None:
    """What is wrong with the faults that are searched, and what is allowed; None where nothing is."""
    searched = set(estimate.searched_faults)
    if estimate.faults and not estimate.enabled:
        return "only an estimate finds them (allowed: enabled = true)"
    if "cogging" in searched and not estimate.teeth:
        return "'cogging' needs to know how often it repeats (allowed: with teeth, times a turn)"
    if "gain" in searched and len(spec.joints) == 1:
        return (
            "'gain' of one motor cannot be told from the lumps, which it multiplies "
            "(allowed: with two joints or more, where gains are those relative to the first motor)"
        )
    if spec.is_arm and searched & set(OF_JOINTS):
        return (
            "friction and rotors of an arm's joints are among its base parameters, and always searched "
            f"(allowed: {', '.join(kind for kind in FAULT_UNITS if kind not in OF_JOINTS)})"
        )
    if not spec.is_arm and "presliding" in searched and "dry" not in searched:
        return "presliding is of dry friction (allowed: with 'dry')"
    if not spec.is_arm and {"tilt", "offset"} <= searched:
        return (
            "a tilt of the base and an offset of the first encoder move alike (allowed: tilt, or offset, which "
            "then has the tilt in that of joint 1)"
        )
    if estimate.faults and estimate.compare == "count":
        return "counts do not show them (allowed: leave out compare)"
    lumps = {*spec.study.search.lumps, *(estimate.lumps or ())}
    for fault, kind in zip(("viscous", "dry"), FRICTION, strict=True):
        if fault in searched and kind in lumps:
            return f"'{fault}' friction is already searched, as the lumps '{kind}' (allowed: one of them)"
    return None


def check_chain(spec: StudySpec, nominal: Chain) -> None:
    """Raises StudyError where what is searched of a chain contradicts its `nominal` model, measure or plant."""
    study = spec.study
    if study.episode.measure == "smoothed" and study.search.lumps != IDEAL:
        raise StudyError("search: lumps: 'smoothed' does not see friction (allowed: gravity and coriolis)")
    if study.estimate.compare == "count" and spec.keeps_readings:
        raise StudyError(
            "estimate: compare: 'count' needs a plant without noise, and this is a rig, or has faults or a lead "
            "(allowed: leave it out, readings are compared there)"
        )
    for kind, key in zip(FRICTION, ("damping", "frictionloss"), strict=True):
        missing = np.flatnonzero(nominal.lumps_of((kind,)).of(kind) == 0.0) + 1
        if kind in study.search.lumps and len(missing):
            raise StudyError(
                f"search: lumps: {key} of link {missing[0]} is 0 in the nominal model, so there are no factors of it "
                f"(allowed: above 0 where {kind} is searched)"
            )


def search_bounds(spec: StudySpec) -> tuple[Array, Array, Array]:
    """Where the search begins, and the least and the largest that each factor may be (nlump each), as `[search]` says.
    Raises StudyError where that names a lump that is not there, a start is not within its bounds, or bounds leave
    nothing between them.
    """
    search = spec.study.search
    given = {"start": search.start, "low": search.low, "high": upper_bounds(spec)}
    starts, lows, highs = (_lump_factors(spec, key, value) for key, value in given.items())
    for name, start, low, high in zip(spec.names, starts, lows, highs, strict=True):
        if not low < high or not low <= start <= high:
            raise StudyError(
                f"search: the start {start:g} of {name} is not within its bounds {low:g} to {high:g} "
                "(allowed: low <= start <= high, low < high)"
            )
    return starts, lows, highs


def check_size(spec: StudySpec, pushes: int, steps: int) -> None:
    """Refuses a study of so many `pushes`, repeats included, and `steps` after each before anything is allocated for
    it.  Raises StudyError where a trial has too many steps, or what is kept of them does not fit into any memory.
    """
    measure = measure_of(spec.study.episode)
    njoint, what = len(spec.joints), f"episode: {pushes:,} pushes of {steps:,} steps"
    hint = "fewer of episode.steps, episode.count or episode.repeats"
    if pushes * steps > MOST_STEPS:
        raise StudyError(f"{what} are too many for a trial (allowed: at most {MOST_STEPS:,} steps in all; {hint})")
    faulty = spec.is_simulated and bool(spec.faults.named or spec.study.episode.lead)
    copies = RESTS / pushes if measure.is_noisy else 0.0  # readings of a plant at rest
    copies += (5 if faulty else 0) * spec.study.workers  # noise of three kinds, angles and speeds
    copies += AT_ONCE if measure.keeps_angles and not faulty else 0
    coasting = pushes * SAMPLES * njoint * (njoint + len(spec.names)) * NUMBER  # Eq. 15
    needed = copies * pushes * (steps + 1) * njoint * NUMBER + coasting
    if needed > MOST_MEMORY:
        raise StudyError(
            f"{what} with {njoint} joints need {needed / 2**30:,.0f} GiB of memory "
            f"(allowed: at most {MOST_MEMORY / 2**30:.0f} GiB; {hint})"
        )


def upper_bounds(spec: StudySpec) -> Factors:
    """The `high` of `[search]`, or what it is by default."""
    study, faults = spec.study, spec.faults
    if study.search.high is not None:
        return study.search.high
    if (
        faults.torque_noise
        and not (study.estimate.torque_limit or faults.torque_limit)
        and SAMPLERS[study.sampler].by_estimate
    ):
        return {f"gravity_{link + 1}": ROUGH_HIGH for link in range(len(spec.joints))}
    return HIGH


def _lump_factors(spec: StudySpec, key: str, given: Factors) -> Array:
    """What is `given` by a key of `[search]` for its lumps (nlump)."""
    default = HIGH if key == "high" else float(SearchSettings.model_fields[key].default)
    one, table = (default, given) if isinstance(given, dict) else (given, {})
    try:
        return factors_from_names(table, len(spec.joints), one, spec.study.search.lumps)
    except EpisodeError as problem:
        raise StudyError(f"search: {key}: {problem}") from None


def measure_of(episode: EpisodeSettings) -> Measure:
    """The measure of an `episode`.  Raises StudyError where its settings contradict each other."""
    try:
        return get_measure(episode.measure, episode.rule)
    except EpisodeError as problem:
        raise StudyError(f"episode: measure: {problem}") from None
