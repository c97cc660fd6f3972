"""What logs say of a robot: its possible model, how well that predicts what was left out, how sure its numbers are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from metaid.errors import RecordError, first_of
from metaid.models import Array, jackknife
from metaid.recorded.choosing import Choices, Chosen, choose, likely_delay, usual_still
from metaid.recorded.comparing import WORTH
from metaid.recorded.doubts.scales import scales_of, torque_scale
from metaid.recorded.doubts.suspects import examined, suspects
from metaid.recorded.gains import Gains
from metaid.recorded.held_out import HeldOut
from metaid.recorded.reading.readings import LogRun
from metaid.recorded.weak_form.equations import Equations, Solution, equations_of, first_equations
from metaid.recorded.weak_form.linear_model import BASE, LinearModel
from metaid.recorded.weak_form.nominal import arm_like
from metaid.recorded.weak_form.normal import FAR_ZERO, ZERO, pseudo_inverse, solved
from metaid.recorded.weak_form.possible import Possible, PossibleModel
from metaid.recorded.weak_form.smoothed import Smoothed, smoothed, smoothed_together

FEW_STARTS = 10  # of simulations a fold, of an arm in space
MANY_STARTS = 60  # of a pendulum
LONGER = (0.1, 0.2, 0.3, 0.5)  # s: of windows, the first that are longer than those that were chosen
TRIFLE = 1e-3  # rad: a zero below it changes torques by less than a thousandth
MOST_NAMED = 3  # joints that a suspect is named with


@dataclass(frozen=True)
class RecordedEstimate:
    """What logs say.

    Attributes:
        model: what is unknown.
        chosen: windows, terms, zeros and delay, and how they were chosen.
        possible: the model that can be, with the unknowns as they are handed over (nparam).
        simulator: the same with what a simulator has alone: viscous and Coulomb friction, and springs.
        covariance: of the unknowns, from repetition (nparam x nparam), in their units.
        systematic: standard deviations of what wrong zeros, scales or geometry would change (nparam).
        zeros: of the encoders of each log (nlog x njoint), in rad; added to what was read.
        scale: of all torques, by which they differ from what the nominal bodies need.
        carried: how many times that each joint carries of what the nominal bodies weigh (njoint); NaN where it does not
            tell, or is held.
        accelerated: the same of the torque that accelerates them (njoint).
        held_out: how well what was left out is predicted.
        simulator_held_out: the same of `simulator`.
        nominal_held_out: the same of the nominal bodies with fitted friction.
        misfit: what is left of the torques, in deviations of what the noise of the angles would leave.
        lacking: what the model has not, and would explain some of what is left.
        logs: on their grids.
        moved: how long the robot moved in all logs, in s.
        gains: of the drives, by which the logs' torques were multiplied; None where no payload tells them.
        turned: by how much the frames of an arm's joints are turned beforehand (njoint), in rad, where all logs say so.
    """

    model: LinearModel
    chosen: Chosen
    possible: PossibleModel
    simulator: PossibleModel
    covariance: Array
    systematic: Array
    zeros: Array
    scale: float
    carried: Array
    accelerated: Array
    held_out: HeldOut
    simulator_held_out: HeldOut
    nominal_held_out: HeldOut
    misfit: float
    lacking: tuple[str, ...]
    logs: tuple[Smoothed, ...]
    moved: float
    gains: Gains | None = None
    turned: Array | None = None

    @property
    def records(self) -> tuple[LogRun, ...]:
        """The logs as they were read."""
        return tuple(own.record for own in self.logs)

    @property
    def values(self) -> Array:
        """The unknowns (nparam): the posterior mean over what can be."""
        return self.possible.values

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns (nparam), from repetition."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def equations(self) -> Equations:
        return self.chosen.equations

    @property
    def delay(self) -> float:
        """By which torques act later than they are logged, in s."""
        return self.equations.delay


def estimate_records(
    records: Sequence[LogRun], model: LinearModel, choices: Choices | None = None, gains: Gains | None = None
) -> RecordedEstimate:
    """What logs say of a robot.

    The zeros of an arm's encoders that all logs share are no nuisance of a log but a property of the machine: a file
    must have them, or it predicts the next log worse. The frames of its joints are turned by them (Eq. 68).

    Args:
        records: the logs, each a run of its own.
        model: what is unknown; its terms of friction do not count.
        choices: what the user chose.
        gains: by which the torques of the logs were multiplied, where a payload tells them.

    Raises:
        RecordError: the logs have too little of it.
    """
    choices = choices or Choices()
    logs = smoothed_together(records, model)
    still = [own.record.name for own in logs if not own.judged.any()]
    if still:
        raise RecordError(f"{still[0]}: too short, or no joint moves (allowed: some seconds of motion)")
    model = _with_idle(model.with_still(usual_still(logs)), logs)
    first = first_equations(logs, model.with_friction(BASE))
    scale = 1.0 if first is None or gains else torque_scale(first)
    chosen = choose(logs, model, choices, scale)
    possible, solutions = _possible(chosen.equations)
    shared = _shared(_zeros(chosen.equations, possible.values), model)
    turned = shared if choices.zeros is None and shared.any() else None
    if turned is not None:
        chosen = chosen.turned(arm_like(chosen.equations.model, model.tree.turned(turned)))
        possible, solutions = _possible(chosen.equations)
    equations, yardstick = chosen.equations, chosen.yardstick
    starts = MANY_STARTS if model.is_pendulum else FEW_STARTS
    plain = equations.with_model(equations.model.plain)
    simulator, simulator_solutions = _possible(plain)
    covariance = _widened(_projected(equations, possible), np.array([each.values for each in solutions]))
    if gains is not None:
        covariance = covariance + _of_gains(equations, gains.relative)
    systematic, lacking = _systematic(equations, possible.values, gains)
    factors = scales_of(equations)
    return RecordedEstimate(
        model=equations.model,
        chosen=chosen,
        possible=possible,
        simulator=simulator,
        covariance=covariance,
        systematic=systematic,
        zeros=_zeros(equations, possible.values),
        scale=scale,
        carried=np.where(equations.held, np.nan, factors.by_weight / scale),
        accelerated=np.where(equations.held, np.nan, factors.by_motion / scale),
        held_out=yardstick.judged(equations, solutions, starts),
        simulator_held_out=yardstick.judged(plain, simulator_solutions),
        nominal_held_out=yardstick.judged(equations, _nominal(equations), starts),
        misfit=_misfit(equations, possible.values),
        lacking=lacking,
        logs=yardstick.logs,
        moved=float(sum(own.judged.sum() * own.period for own in logs)),
        gains=gains,
        turned=turned,
    )


def _shared(zeros: Array, model: LinearModel) -> Array:
    """What all logs share (njoint) of the `zeros` of an arm's encoders (nlog x njoint), in rad: their mean, where it is
    more than a trifle and more than by how much they differ.  A pendulum is zeroed where it hangs, anew for each log.
    """
    mean, differ = zeros.mean(axis=0), np.ptp(zeros, axis=0)
    size = np.abs(mean)
    are_shared = (size > np.maximum(differ, TRIFLE)) & (size < FAR_ZERO) & ~model.slides
    return np.where(are_shared & (not model.is_pendulum), mean, 0.0)


def _with_idle(model: LinearModel, logs: Sequence[Smoothed]) -> LinearModel:
    """The same with joints that have no torque in any log: one that moves has no motor, and of one that is held nothing
    is known. A pendulum may have none at all, and swings freely.
    """
    idle = ~np.any([own.record.torques.any(axis=0) for own in logs], axis=0)
    idle &= ~model.untrusted & (model.is_pendulum or not idle.all())
    held = model.held(np.max([np.ptp(own.coordinates, axis=0) for own in logs], axis=0))
    return replace(model, untrusted=model.untrusted | (idle & held), passive=idle & ~held)


def equations_like(found: RecordedEstimate, record: LogRun) -> Equations:
    """The equations of another log of the same robot, with the windows, terms and delay that were chosen.  Raises
    RecordError where it is too short.
    """
    chosen = found.equations
    equations = equations_of([smoothed(record)], chosen.model, chosen.span)
    if equations is None:
        raise RecordError(f"{record.name}: too short, or no joint moves (allowed: some seconds of motion)")
    return equations.with_choices_of(chosen)


def _zeros(equations: Equations, values: Array) -> Array:
    """The zeros (nlog x njoint) that follow from other values (nparam) than those of the free fit."""
    solution, blocks = equations.solution, equations.blocks
    zeros = solution.zeros.copy()
    if equations.zeros:
        shift = values - solution.values
        nparam = len(values)
        for log in range(equations.nlog):
            gram = blocks.grams[blocks.logs == log].sum(axis=0)
            inner = gram[nparam:, nparam:] + np.eye(zeros.shape[1]) / ZERO**2
            zeros[log] -= np.linalg.solve(inner, gram[nparam:, :nparam] @ shift)
    return zeros


def _possible(equations: Equations) -> tuple[PossibleModel, list[Solution]]:
    """The model that can be and that some equations tell, and what they tell of it without each fold (nfold)."""
    bodies = Possible(equations)
    return bodies.closest(equations.solution), [bodies.refined(each) for each in equations.apart]


def _nominal(equations: Equations) -> list[Solution]:
    """What predicts each fold (nfold) by the nominal bodies, with friction fitted to the rest."""
    stiff = 1e12 * np.diag(equations.solution.precision)
    stiff[equations.model.nbody :] = 0.0

    def fixed(solution: Solution) -> Solution:
        shift = stiff * (equations.prior_mean - solution.values)
        return replace(solution, values=solution.values + solved(solution.precision + np.diag(stiff), shift))

    return [fixed(each) for each in equations.apart]


def _projected(equations: Equations, possible: PossibleModel) -> Array:
    """The covariance of the unknowns (nparam x nparam), that of a chain by its fewer free parameters.  Eq. 70."""
    covariance = equations.covariance(equations.solution.values)
    if possible.jacobian is None:
        return covariance
    precision, jacobian = equations.solution.precision, possible.jacobian
    inverse = pseudo_inverse(jacobian.T @ precision @ jacobian, 1e-12)
    onto = jacobian @ inverse @ jacobian.T @ precision
    return np.asarray(onto @ covariance @ onto.T, dtype=np.float64)


def _widened(covariance: Array, repeated: Array) -> Array:
    """A covariance (nparam x nparam) that is at least as wide as the unknowns differ without each fold (nfold x
    nparam): the jackknife is its lower bound.  Eq. 71.
    """
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    growth = np.maximum(jackknife(repeated), deviations) / deviations
    return np.asarray(covariance * np.outer(growth, growth), dtype=np.float64)


def _of_gains(equations: Equations, relative: Array) -> Array:
    """What deviations of the gains, as shares of them (njoint), add to the covariance of the unknowns (nparam x
    nparam).  Eq. 75.
    """
    solution = equations.solution
    moments = np.zeros((len(solution.values), len(relative)))
    beside = equations.beside_zeros(equations.torques)
    for (columns, _), torques in zip(beside, equations.torques, strict=True):
        moments += np.einsum("wajp,jk,wak->pk", columns, solution.weight, torques, optimize=True)
    changes = solved(solution.precision, moments)
    return np.asarray((changes * relative**2) @ changes.T, dtype=np.float64)


def _systematic(equations: Equations, values: Array, gains: Gains | None) -> tuple[Array, tuple[str, ...]]:
    """Standard deviations of what the model may lack would change of the unknowns (nparam), and what the logs show of
    it; torques of joints may have scales of their own where no `gains` are told.  Eq. 71.
    """
    changes, lacking = [], []
    for suspect in suspects(equations, values, gains is None):
        change, joints = examined(equations, values, suspect)
        changes.append(change)
        names = [equations.model.joints[joint] for joint in joints]
        if names:
            lacking.append(f"{suspect.what} of joint{'s' * (len(names) > 1)} {first_of(names, MOST_NAMED)}")
    free = equations.solution.values
    late, _ = likely_delay(equations)
    prompt = replace(equations, delay=late)
    changes.append(prompt.solution.values - free)
    if _unexplained(prompt) < WORTH * _unexplained(equations):
        lacking.append(f"a delay of {1e3 * late:.2g} ms")
    for span in [span for span in LONGER if span > equations.span][:1]:
        other = equations_of([part.smoothed for part in equations.parts], equations.model, span)
        if other is not None:
            changes.append(other.with_choices_of(equations).solution.values - free)
    return np.sqrt(np.sum(np.square(changes), axis=0)), tuple(lacking)


def _unexplained(equations: Equations) -> float:
    """Root mean square of the averaged torques that the free fit leaves, in N m or N."""
    left = map(equations.model.trusted_alone, equations.left(equations.solution.values))
    return float(np.sqrt(np.mean(np.concatenate([each.ravel() for each in left]) ** 2)))


def _misfit(equations: Equations, values: Array) -> float:
    """What is left of the averaged torques in deviations of what the noise of the angles would leave of them: the
    largest of all joints.

    The noise is what polynomials leave of the angles. Its torque is that of the accelerations which it makes, by the
    mass matrix at the middle of each window.
    """
    model, n = equations.model, equations.model.njoint
    left, noise = np.zeros(n), np.zeros(n)
    for part, missed in zip(equations.parts, equations.left(values), strict=True):
        poses = part.coordinates[:, part.coordinates.shape[1] // 2]
        matrices, _ = model.dynamics(values[: model.nbody])(poses, np.zeros_like(poses))
        noise += ((matrices * part.acceleration_noise) ** 2).sum(axis=(0, 2))
        left += model.trusted_alone(missed[:, 0] ** 2).sum(axis=0)
    return float(np.sqrt((left / np.maximum(noise, 1e-300)).max()))
