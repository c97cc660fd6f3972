"""The pushes and the episode that a study's settings ask for."""

from __future__ import annotations

from typing import Literal

import numpy as np

from metaid.episode import (
    FALL_LIMIT,
    QUANTITIES,
    REACH,
    RICH_FALL_LIMIT,
    RICH_RUNAWAY,
    SHORTEST,
    WINDOWS,
    Episode,
    FallRule,
    NoiseFloor,
    even_ends,
    natural_time,
    noise_floor,
    pushes_for,
    rich_pushes,
    tip_push,
    window_ends,
)
from metaid.errors import EpisodeError, StudyError
from metaid.models import Array, Chain
from metaid.plant import FaultyPlant, MujocoPlant, Plant
from metaid.search import SAMPLERS, designed_speeds
from metaid.study.contradictions import RESTS, check_size, measure_of
from metaid.study.settings import LARGEST_STEPS
from metaid.study.spec import StudySpec

HORIZON = 1.5  # of a rich push, in units of √(l/g)
SLOWEST_PUSH = 1e-9  # rad/s of the fastest link after a push; what is slower is lost in rounding
# Horizons of a rich push that readings are kept for: LONGEST_READ of them with three links or fewer, one of them with
# LINKS_READ or more. What they say of a lump grows with the square of time. But a twin that is driven forgets where it
# began, sooner with each link, and then no fit finds the truth. Where they are matched, simulated pushes are as many
# times stronger, for the same reason; a rig has stops and cables, so its pushes are not unless its user says so.
LONGEST_READ, LINKS_READ = 2.0, 6.0
GROWTH = 2.0  # of a window over the one before, at most, up to MOST_WINDOWS
MOST_WINDOWS = 10
COUNTED_WINDOWS = 20  # of the same length, where counts are compared: as often are the counters read
LARGEST_WINDOWS = 1_000_000  # bytes of a trial
COUNTING_STEPS = 5000  # after a tip push, as in the paper
TIP_SPEED = 0.1  # rad/s of the fastest link after a tip push: small, so that the oscillation is


def make_episode(plant: Plant, spec: StudySpec, nominal: Chain) -> Episode:
    """What a study does to its `plant` in an episode, which is struck to find out how it answers. The natural time of
    the `nominal` chain sets the horizon, and by it designed pushes are designed.

    Raises EpisodeError where the settings contradict each other, or a push does not have one finite impulse for each
    link, and StudyError where a trial is too large to be computed.
    """
    measure = measure_of(spec.study.episode)
    wanted, timestep = spec.study.episode, spec.timestep
    kind = wanted.pushes or ("rich" if measure.sees_coriolis else "tip")
    count = len(kind) if isinstance(kind, list) else 1 if kind == "tip" else wanted.count or 2 * plant.njoint
    if kind == "tip" and measure.name == "smoothed":
        raise EpisodeError("pushes: 'smoothed' fits one curve to a push, so it must be short (allowed: rich pushes)")
    natural = natural_time(nominal, plant.gravity)
    read = _reading_steps(spec, natural)
    if kind == "rich" or kind == "designed":
        horizon = HORIZON * natural
        steps = wanted.steps or max(round(horizon / timestep), 2)
        if steps > LARGEST_STEPS:
            raise EpisodeError(
                f"steps of {timestep} s are too short for a horizon of {horizon:.3g} s: {steps} of them "
                f"(allowed: at most {LARGEST_STEPS}; name the steps, or make the timestep longer)"
            )
        pushed = steps * timestep
        if SAMPLERS[spec.study.sampler].by_estimate and wanted.steps is None:
            steps = max(steps, read)
        check_size(spec, count * wanted.repeats, steps)
        pushes = _strong_pushes(plant, kind, spec, nominal, pushed)
        # A link that is pushed past 180° on purpose has not fallen there.
        fall_limit = RICH_FALL_LIMIT * _strength(spec)
        runaway = np.inf if spec.is_simulated else RICH_RUNAWAY
    else:
        steps, fall_limit, runaway = wanted.steps or COUNTING_STEPS, FALL_LIMIT, np.inf
        check_size(spec, count * wanted.repeats, steps)
        pushes = tip_push(plant, wanted.peak_speed or TIP_SPEED) if kind == "tip" else _explicit(kind, plant.njoint)
    pushes = np.tile(pushes, (wanted.repeats, 1))
    rule = FallRule(wanted.fall_limit or fall_limit, wanted.fall_margin, wanted.fall_runaway or runaway)
    counted = spec.study.estimate.compare == "count"
    ends = () if spec.keeps_readings else _window_ends(pushes, steps, steps * timestep / natural, counted)
    return Episode(
        pushes, steps, rule, seed=spec.study.seed, lead=wanted.lead, window_ends=ends, readings_steps=min(steps, read)
    )


def _reading_steps(spec: StudySpec, natural: float) -> int:
    """For how many steps after a push the readings of a plant with noise are kept; `natural` time √(l/g) in s."""
    if not spec.keeps_readings or not spec.study.estimate.enabled:
        return 0
    return max(round(_horizons_read(spec) * HORIZON * natural / spec.timestep), 2)


def _horizons_read(spec: StudySpec) -> float:
    """For how many horizons of a rich push readings are kept."""
    return float(np.clip(LINKS_READ / len(spec.joints), 1.0, LONGEST_READ))


def _window_ends(pushes: Array, steps: int, horizon: float, counted: bool) -> tuple[int, ...]:
    """The windows of each push: the shortest as long as that of a rich push, however long the `horizon`, which is in
    natural times; or, where counts are compared, all ending equally long after one another. None where a trial's
    windows would be larger than LARGEST_WINDOWS.
    """
    longer = max(horizon / HORIZON, 1.0)
    count = min(WINDOWS + round(np.log(longer) / np.log(GROWTH)), MOST_WINDOWS)
    ends = even_ends(steps, COUNTED_WINDOWS) if counted else window_ends(steps, count, SHORTEST / longer)
    return ends if pushes.size * len(ends) * QUANTITIES * 8 <= LARGEST_WINDOWS else ()


def _strong_pushes(
    plant: Plant, kind: Literal["rich", "designed"], spec: StudySpec, nominal: Chain, horizon: float
) -> Array:
    wanted, seed = spec.study.episode, spec.study.seed
    peak_speed, count = wanted.peak_speed or REACH * _strength(spec) / horizon, wanted.count or 2 * plant.njoint
    if kind == "rich":
        return rich_pushes(plant, count, peak_speed, seed)
    kinds = spec.study.search.lumps
    return pushes_for(plant, designed_speeds(nominal, plant.gravity, count, peak_speed, horizon, seed, kinds))


def _strength(spec: StudySpec) -> float:
    """How many times stronger than a rich push a push is, if the study does not say."""
    is_matched = SAMPLERS[spec.study.sampler].by_estimate and spec.keeps_readings
    is_told = spec.study.episode.peak_speed is not None or not spec.is_simulated
    return _horizons_read(spec) if is_matched and not is_told else 1.0


def _explicit(pushes: list[list[float]], njoint: int) -> Array:
    if not pushes or any(len(push) != njoint for push in pushes):
        raise EpisodeError(f"pushes: every push needs {njoint} impulses, one per link, in N s")
    return np.array(pushes)


def rest_noise(plant: MujocoPlant, spec: StudySpec, episode: Episode, start_speeds: Array) -> NoiseFloor:
    """The noise floor, from a rest episode: the plant is held upright for RESTS horizons of a push, its sensors read.

    Args:
        plant: whose sensors are read.
        spec: the study's settings, with the seed of the noise.
        episode: of the study, which the floor is for.
        start_speeds: absolute link speeds (npush x nlink) right after the pushes, in rad/s.
    """
    joint_speeds = np.diff(start_speeds, axis=1, prepend=0.0)
    return noise_floor(_rest(plant, spec, episode), spec.timestep, joint_speeds)


def rest_deviations(plant: MujocoPlant, spec: StudySpec, episode: Episode) -> Array:
    """The standard deviation of each joint's readings (njoint), in rad, in the same rest episode."""
    return np.asarray(_rest(plant, spec, episode).reshape(-1, plant.njoint).std(axis=0))


def _rest(plant: MujocoPlant, spec: StudySpec, episode: Episode) -> Array:
    """Readings at rest (RESTS x nsteps + 1 x njoint), in rad."""
    count = episode.steps + 1
    return FaultyPlant(plant).rest(RESTS * count, spec.study.seed).reshape(RESTS, count, -1)


def refuse_unseen_pushes(start_speeds: Array, timestep: float) -> None:
    """Raises StudyError where a push is so weak or so strong that no episode after it means anything; `start_speeds`
    (npush x nlink) in rad/s, `timestep` in s.
    """
    fastest = np.abs(start_speeds).max(axis=1)
    for push in np.flatnonzero(~((fastest >= SLOWEST_PUSH) & (fastest * timestep <= 1.0)))[:1]:
        raise StudyError(
            f"episode: push {push + 1} gives the fastest link {fastest[push]:.3g} rad/s "
            f"(allowed: {SLOWEST_PUSH:g} to {1.0 / timestep:g} rad/s, a radian in a timestep)"
        )
