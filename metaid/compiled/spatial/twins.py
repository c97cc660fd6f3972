"""Twins of an arm: candidates that are simulated under the laws or the torques that the plant was sent.

All candidates of a call have the same pushes, and are shared among threads. A twin takes the plant's own steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.decorator import compiled
from metaid.compiled.sharing import share_out
from metaid.compiled.spatial.dynamics import Frames, fill_law, fill_mass_matrix, joint_torques, move_links, new_space
from metaid.compiled.spatial.friction import (
    accelerate_freely,
    accelerate_with_friction,
    new_motion,
    slip_back,
    slipped,
    soften,
)
from metaid.models import Array

MULTIPLICATIONS = 500  # of a step, for each joint
EULER, MIDPOINT, RUNGE_KUTTA = 1, 2, 4  # orders of steps, and how often they ask for accelerations
TOO_FAST = 1e3  # rad/s or m/s: no arm that is simulated gets there


class Times(NamedTuple):
    """How a twin moves from one reading to the next: its `timesteps` (npush x nstep) in s, and how many of these there
    are in a step; and of which `order` its steps are: EULER's, as a simulated plant takes, or those of a plant that
    moves continuously, MIDPOINT's or RUNGE_KUTTA's.
    """

    timesteps: Array
    substeps: int = 1
    order: int = EULER


@dataclass(frozen=True)
class Followed:
    """Twins that followed the pushes: `values` (ncandidate x npush x nvalue x njoint), and which of them did
    (ncandidate x npush).
    """

    values: Array
    arrived: NDArray[np.bool_]


def follow_laws(
    frames: Frames,
    law: Array,
    candidates: Array,
    pushes: tuple[Array, Array],
    windows: tuple[NDArray[np.int64], NDArray[np.int64]],
    timestep: float,
) -> Followed:
    """Joint speeds at the ends of windows (ncandidate x npush x nwindow x njoint) of twins under the law that was sent.

    Args:
        frames: of the arm.
        law: parameters of the candidate that was sent (njoint x 13).
        candidates: parameters of the twins (ncandidate x njoint x 13).
        pushes: joint coordinates and speeds at the starts (npush x 2 x njoint), and k (npush), in 1/s².
        windows: the steps at which they end (nwindow), and how many of them are wanted of each push (npush).
        timestep: in s.
    """
    shape = len(candidates), len(pushes[0]), len(windows[0]), law.shape[0]

    def share(*rest: Any) -> None:
        _follow_law(frames, law, candidates, pushes, windows, timestep, *rest)

    return shared(share, shape, len(pushes[0]) * int(windows[0][-1]))


def follow_torques(
    frames: Frames,
    candidates: Array,
    starts: Array,
    torques: Array,
    seen: tuple[Array, NDArray[np.int64], NDArray[np.int64]],
    times: Times,
    by_angle: Array | None = None,
) -> Followed:
    """Coefficients of the joint coordinates (ncandidate x npush x ncoefficient x njoint) of twins that are driven by
    the torques that were commanded.  Eq. 33.

    Args:
        frames: of the arm.
        candidates: parameters of the twins (ncandidate x njoint x 13).
        starts: joint coordinates and speeds at the starts (ncandidate x npush x 2 x njoint).
        torques: as they were commanded (npush x nstep x njoint), in N m or N.
        seen: polynomials at every reading (nbasis x nstep + 1 x ncoefficient), which of them is for each push (npush),
            and for how many steps it is followed (npush).
        times: how the twins move between two readings.
        by_angle: what acts by the coordinate of a joint (5 x njoint), see `push_by_torque`; None for nothing.
    """
    pulled = np.zeros((5, torques.shape[2])) if by_angle is None else by_angle
    shape = len(candidates), len(torques), seen[0].shape[2], torques.shape[2]

    def share(*rest: Any) -> None:
        _follow_torque(frames, candidates, starts, torques, pulled, seen, times, *rest)

    return shared(share, shape, int(seen[2].sum()) * times.substeps)


def shared(fill: Callable[..., None], shape: tuple[int, int, int, int], steps: int) -> Followed:
    """What `fill` fills in, values of this `shape`: on several threads, each with a share of the candidates, where all
    `steps` of one are worth it.
    """
    values, arrived = np.zeros(shape), np.zeros(shape[:2], dtype=np.bool_)

    def run(first: int, stride: int) -> None:
        work = np.zeros((shape[3], 13)), new_motion(shape[3]), new_space(shape[3])
        fill((first, stride), work, values, arrived)

    share_out(run, shape[0], shape[0] * steps * MULTIPLICATIONS * shape[3])
    return Followed(values, arrived)


@compiled
def _follow_law(frames, law, candidates, pushes, windows, timestep, share, work, speeds, arrived):  # type: ignore[no-untyped-def]
    """Runs a `share` of the candidates: the first, and the stride from one to the next."""
    (starts, stiffness), (ends, wanted), (first, stride), (difference, motion, space) = pushes, windows, share, work
    n = law.shape[0]
    for candidate in range(first, candidates.shape[0], stride):
        parameters = candidates[candidate]
        for i in range(n):
            for j in range(13):
                difference[i, j] = law[i, j] - parameters[i, j]
            difference[i, 12] = law[i, 12]  # dry friction of the arm is apart
        for push in range(starts.shape[0]):
            start, step = starts[push], 0
            follows = set_off(frames, parameters, start, motion, space)
            for window in range(wanted[push]):
                while follows and step < ends[window]:
                    # The force that the law leaves, dry friction of the arm apart: that of the difference.  Eq. 58
                    position, speed, pull, force = motion.position, motion.speed, motion.pull, motion.force
                    fill_law(frames, difference, start, stiffness[push], position, speed, pull, space, force)
                    follows = advance(frames, parameters, timestep, motion, space)
                    step += 1
                for i in range(n):
                    speeds[candidate, push, window, i] = motion.speed[i]
            arrived[candidate, push] = follows


@compiled
def _follow_torque(frames, candidates, starts, torques, by_angle, seen, times, share, work, coefficients, arrived):  # type: ignore[no-untyped-def]
    """The same, driven."""
    (basis, chosen, steps), (first, stride), (_, motion, space) = seen, share, work
    timesteps, substeps, order = times
    for candidate in range(first, candidates.shape[0], stride):
        parameters = candidates[candidate]
        for push in range(torques.shape[0]):
            follows = set_off(frames, parameters, starts[candidate, push], motion, space)
            step, polynomials, filled = 0, basis[chosen[push]], coefficients[candidate, push]
            if steps[push] > 0:
                _add_reading(polynomials[0], motion, filled)
            while follows and step < steps[push]:
                moving = timesteps[push, step], substeps, order
                follows = move_on(frames, parameters, torques[push, step], by_angle, moving, motion, space)
                step += 1
                _add_reading(polynomials[step], motion, filled)
            arrived[candidate, push] = follows


@compiled
def move_on(frames, parameters, torque, by_angle, times, motion, space):  # type: ignore[no-untyped-def]
    """From one reading to the next; whether the twin could.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        torque: that is held (njoint), in N m or N.
        by_angle: what acts by the coordinate of a joint (5 x njoint), see `push_by_torque`.
        times: the timestep in s; how many there are to the next reading; the order of its steps.
        motion: that moves on.
        space: of the dynamics.
    """
    timestep, substeps, order = times
    for _ in range(substeps):
        if order > EULER:
            follows = flow(frames, parameters, torque, by_angle, (timestep, order), motion, space)
        else:
            push_by_torque(frames, parameters, torque, by_angle, motion, space)
            follows = advance(frames, parameters, timestep, motion, space)
        if not follows:
            return False
    return True


@compiled
def _add_reading(polynomials, motion, coefficients):  # type: ignore[no-untyped-def]
    """Adds what the reading at a step has of the coefficients."""
    for k in range(coefficients.shape[0]):
        for i in range(coefficients.shape[1]):
            coefficients[k, i] += polynomials[k] * motion.position[i]


@compiled
def set_off(frames, parameters, start, motion, space):  # type: ignore[no-untyped-def]
    """Begins a push; whether a twin with these parameters can.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        start: joint coordinates and speeds (2 x njoint).
        motion: of the twin, set to the start.
        space: of the dynamics.
    """
    is_dry = False
    for i in range(motion.position.shape[0]):
        motion.position[i], motion.speed[i] = start[0, i], start[1, i]
        motion.pull[i] = 0.0
        motion.side[i] = motion.slip[0, i] = np.sign(start[1, i])
        is_dry = is_dry or parameters[i, 12] != 0.0
    return not is_dry or soften(frames, parameters, motion, space)


@compiled
def push_by_torque(frames, parameters, torque, by_angle, motion, space):  # type: ignore[no-untyped-def]
    """The force that a torque leaves beside the bias, dry friction apart.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        torque: that acts (njoint), in N m or N.
        by_angle: what acts by the coordinate of a joint (5 x njoint): the stiffness of a spring, in N m/rad or N/m;
            cogging's amplitudes of the cosine and of the sine, in N m, and how many times a turn it repeats (Eq. 42);
            over what way dry friction builds up, in rad or m, 0 where it is a constraint, as MuJoCo has it.
        motion: whose force is filled in.
        space: of the dynamics.
    """
    force = motion.force
    move_links(frames, motion.position, motion.speed, motion.zero, space)
    joint_torques(frames, parameters, space, force)
    for i in range(force.shape[0]):
        force[i] = torque[i] - force[i] - parameters[i, 11] * motion.speed[i] - by_angle[0, i] * motion.position[i]
        if by_angle[3, i] != 0.0:
            phase = by_angle[3, i] * motion.position[i]
            force[i] += by_angle[1, i] * np.cos(phase) + by_angle[2, i] * np.sin(phase)


@compiled
def accelerate(frames, parameters, motion, space):  # type: ignore[no-untyped-def]
    """Fills in what the force makes of the arm, with dry friction; whether its mass matrix is one.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        motion: with the force; `beyond` is filled in.
        space: of the dynamics, which the links have been moved in.
    """
    fill_mass_matrix(frames, parameters, space)
    is_dry = False
    for i in range(motion.force.shape[0]):
        is_dry = is_dry or parameters[i, 12] != 0.0
    return accelerate_with_friction(parameters, motion, space) if is_dry else accelerate_freely(motion, space)


@compiled
def flow(frames, parameters, torque, by_angle, step, motion, space):  # type: ignore[no-untyped-def]
    """One step of an arm that moves continuously, by the Runge-Kutta method of that order; whether the twin could.

    Eq. 46.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        torque: that is held (njoint), in N m or N.
        by_angle: what acts by the coordinate of a joint (5 x njoint), see `push_by_torque`.
        step: the timestep in s, and the order, which is the number of stages.
        motion: that moves on.
        space: of the dynamics.
    """
    timestep, order = step
    position, speed, stages = motion.position, motion.speed, motion.stages
    n = position.shape[0]
    for i in range(n):
        stages[0, i], stages[1, i] = position[i], speed[i]
        stages[2, i] = stages[3, i] = 0.0
        motion.slip[1, i] = position[i]
    for stage in range(order):
        push_by_torque(frames, parameters, torque, by_angle, motion, space)
        if by_angle[4, 0] > 0.0:
            slip_back(parameters, by_angle[4], motion)
            fill_mass_matrix(frames, parameters, space)
            follows = accelerate_freely(motion, space)
        else:
            follows = accelerate(frames, parameters, motion, space)
        if not follows:
            return False
        if order == MIDPOINT:
            weight, ahead = timestep * stage, 0.5 * timestep
        else:
            weight = timestep / 6.0 if stage == 0 or stage == 3 else timestep / 3.0
            ahead = timestep if stage == 2 else 0.5 * timestep
        for i in range(n):
            rate, change = speed[i], motion.beyond[i]
            stages[2, i] += weight * rate
            stages[3, i] += weight * change
            if stage < order - 1:
                position[i], speed[i] = stages[0, i] + ahead * rate, stages[1, i] + ahead * change
    for i in range(n):
        position[i], speed[i] = stages[0, i] + stages[2, i], stages[1, i] + stages[3, i]
        if not abs(speed[i]) <= TOO_FAST:
            return False
        if by_angle[4, i] > 0.0:
            motion.slip[0, i] = slipped(i, by_angle[4, i], motion)
    return True


@compiled
def advance(frames, parameters, timestep, motion, space):  # type: ignore[no-untyped-def]
    """One step of Euler's, as MuJoCo takes it; whether the twin could.

    Args:
        frames: of the arm.
        parameters: of the twin (njoint x 13).
        timestep: in s.
        motion: that moves on.
        space: of the dynamics.
    """
    if not accelerate(frames, parameters, motion, space):
        return False
    for i in range(motion.force.shape[0]):
        motion.speed[i] += timestep * (motion.beyond[i] + motion.pull[i])
        motion.position[i] += timestep * motion.speed[i]
        if not abs(motion.speed[i]) <= TOO_FAST:
            return False
    return True
