"""A quasi-Newton searcher for measures that are smooth: few trials where nothing is noisy.

In the nominal model's metric the squared spectral measure is nearly κ |z − z*|², with κ known before any trial. So the
measure gives the distance to the truth, and only the direction is missing. Two kinds of generation alternate:
`slope`, one candidate along each of nlump random directions about the best one, for the gradient; and `step`, the
quasi-Newton step at several lengths, within a trust region. The curvature starts at κ and is updated by damped BFGS
(Nocedal and Wright, Numerical Optimization, 2nd ed., procedure 18.2). As long as nothing has survived, candidates are
drawn about the one that survived longest.

A long curved valley can hold it up, as of a chain whose tip weighs little or whose links are of very different lengths.
Then it looks at what its trials showed besides the measure: it tries the chain of the estimate, which is at the other
end of the valley where the twin explains the motion. Where it does not, the curvature is forgotten.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from metaid.episode import Outcome
from metaid.errors import StudyError
from metaid.models import Array
from metaid.search.coordinates import Coordinates
from metaid.search.output_error import Matching
from metaid.search.searcher import StepOptions

if TYPE_CHECKING:
    from scipy.optimize import BFGS


STEP_LENGTHS = (1.0, 0.5, 0.25, 0.1)
SLOPE_REACH = 0.05  # of the distance to the truth: how far candidates for the gradient are from the best one
FEWEST_BLIND = 6  # candidates of a generation as long as nothing has survived, which is called blind
BLIND_GROWTH = 1.3  # of the spread, from one generation without a survivor to the next
DAMPING = 0.1  # of the expected change of the slope along a step: an update with less is damped
FLATTEST = 0.02  # of κ: no direction is taken for flatter than that
MOST_ROOM = 0.1  # of the way between the bounds
CONVERGED = 1e-6  # distance to the truth, in factors of the least determined lump
COASTING = 0.1  # of what the measure can tell from none: to go on would narrow ranges by a tenth
STALLED_ROUNDS, STALLED = 6, 0.25  # a round is a slope with its steps: in so many the squared value fell by less
MOST_SEEN = 8  # trials that an estimate is made of


class Newton:
    """Quasi-Newton steps in the nominal model's metric.

    Args:
        coordinates: that it moves in, with the curvature of the measure.
        seed: of the directions of slopes.
        options: the first step.
        find_experiment: gives what an estimate needs to know of the study, None where none can be made.

    Raises:
        StudyError: the curvature is not known.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        seed: int,
        options: StepOptions,
        find_experiment: Callable[[], Matching | None] = lambda: None,
    ) -> None:
        if coordinates.curvature is None:
            raise StudyError("sampler 'newton' needs measure = 'spectral' and coordinates = 'nominal-metric'")
        if options.generation is not None:
            raise StudyError("sampler 'newton' sizes its own generations; leave out search.generation")
        self._coordinates = coordinates
        self._curvature: float = coordinates.curvature
        self._random = np.random.default_rng(seed)
        nlump = len(coordinates.origin)
        self._shape = _known_shape(nlump)
        self._blind_spread = options.sigma
        self._phase = "start"
        self._proposed: list[Array] = [np.zeros(nlump)]
        self._best, self._best_value = np.zeros(nlump), np.inf
        self._centre, self._centre_value = self._best, np.inf
        self._gradient: Array | None = None
        self._gradient_at = self._best
        self._step = self._best
        self._directions = np.eye(nlump)
        self._slope_reach = SLOPE_REACH
        self._rounds: list[float] = []
        self._find_experiment = find_experiment
        self._has_estimated = False
        self._seen: list[tuple[Array, Outcome]] = []

    @property
    def spread(self) -> float | None:
        """The distance to the truth that the measure implies, in factors of the least determined lump."""
        return float(np.sqrt(self._best_value / self._curvature)) if np.isfinite(self._best_value) else None

    def finished(self) -> bool:
        """Whether the truth is as near as matters, or as can be told."""
        if self._phase == "blind" or self.spread is None:
            return False
        return self.spread < CONVERGED or self._best_value < (COASTING * self._coordinates.resolution) ** 2

    def ask(self) -> Array:
        if self._phase == "blind":
            count = max(len(self._best) + 1, FEWEST_BLIND)
            self._proposed = [
                self._best + self._blind_spread * self._random.normal(size=len(self._best)) for _ in range(count)
            ]
            self._blind_spread *= BLIND_GROWTH
        elif self._phase == "slope":
            self._proposed = [self._centre + offset for offset in self._slope_offsets()]
        elif self._phase == "step":
            self._proposed = [self._centre + length * self._step for length in STEP_LENGTHS]
        return np.array([self._coordinates.factors(z) for z in self._proposed])

    def widen(self, coordinates: Coordinates) -> None:
        self._coordinates = coordinates
        self._has_estimated = False  # an estimate beyond the bounds may not have been tried
        self._rounds = []

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        self._remember(outcomes)
        values = np.array([outcome.value**2 for outcome in outcomes])
        survived = np.array([not outcome.fell for outcome in outcomes])
        best = int(values.argmin())
        if values[best] < self._best_value:
            self._best, self._best_value = self._proposed[best], float(values[best])
        if self._phase in ("start", "blind"):
            self._phase = "slope" if survived[best] else "blind"
            self._centre, self._centre_value = self._best, self._best_value
        elif self._phase == "slope":
            self._learn_slope(values, survived)
            self._aim(radius=2.0 * float(np.sqrt(self._centre_value / self._curvature)))
            self._phase = "step"
        elif self._phase == "estimate":
            self._begin_anew()
        else:
            self._judge_step()
            if self._phase == "slope" and self._has_stalled():
                self._leave_valley()

    def _remember(self, outcomes: Sequence[Outcome]) -> None:
        """Keeps the first survivors that show their motion."""
        for z, outcome in zip(self._proposed, outcomes, strict=True):
            shows = outcome.windows is not None or outcome.readings is not None
            if shows and not outcome.fell and len(self._seen) < MOST_SEEN:
                self._seen.append((self._coordinates.factors(z), outcome))

    def _has_stalled(self) -> bool:
        """Whether the last rounds hardly helped; called once a round."""
        self._rounds.append(self._centre_value)
        return len(self._rounds) > STALLED_ROUNDS and self._rounds[-1] > STALLED * self._rounds[-1 - STALLED_ROUNDS]

    def _leave_valley(self) -> None:
        """Tries the chain of the estimate next; where there is none, begins anew from the best candidate."""
        self._rounds = []
        factors = None if self._has_estimated else self._estimated()
        self._has_estimated = True
        if factors is None:
            self._begin_anew()
        else:
            self._proposed = [self._coordinates.z(factors)]
            self._phase = "estimate"

    def _estimated(self) -> Array | None:
        """The factors (nlump) of the chain that explains what the trials showed, None where there is none."""
        experiment = self._find_experiment() if self._seen else None
        if experiment is None:
            return None
        trials = [experiment.trial(factors, outcome) for factors, outcome in self._seen]
        estimate = experiment.estimate([trial for trial in trials if trial is not None])
        if estimate is None or not estimate.is_explained:
            return None
        return np.clip(experiment.factors(estimate), self._coordinates.low, self._coordinates.high)

    def _begin_anew(self) -> None:
        """Goes on from the best candidate with the curvature that was known before any trial."""
        self._centre, self._centre_value = self._best, self._best_value
        self._shape = _known_shape(len(self._centre))
        self._gradient = None
        self._slope_reach = SLOPE_REACH
        self._phase = "slope"

    def _slope_offsets(self) -> Array:
        """Random orthogonal offsets (nlump x nlump), each turned to the side that is within the bounds."""
        nlump = len(self._centre)
        self._directions = np.linalg.qr(self._random.normal(size=(nlump, nlump)))[0].T
        reach = self._slope_reach * float(np.sqrt(self._centre_value / self._curvature))
        for i, direction in enumerate(self._directions):
            if not self._coordinates.inside(self._centre + reach * direction):
                self._directions[i] = -direction
        return reach * self._directions

    def _learn_slope(self, values: Array, survived: Array) -> None:
        """Gradient by forward differences, less the Hessian's part; then the Hessian from the gradient's change."""
        reach = float(np.linalg.norm(self._proposed[0] - self._centre))
        bend = 0.5 * reach * np.einsum("ij,jk,ik->i", self._directions, self._hessian(), self._directions)
        slopes = np.where(survived, (values - self._centre_value) / reach - bend, 0.0)
        gradient = self._directions.T @ slopes
        if self._gradient is not None:
            self._shape.update(self._centre - self._gradient_at, (gradient - self._gradient) / (2.0 * self._curvature))
        self._gradient, self._gradient_at = gradient, self._centre

    def _hessian(self) -> Array:
        """Of the squared measure in z (nlump x nlump)."""
        hessian: Array = 2.0 * self._curvature * self._shape.get_matrix()
        return hessian

    def _aim(self, radius: float) -> None:
        """The minimiser of the quadratic model within `radius` of the centre and within the bounds."""
        assert self._gradient is not None
        curvatures, axes = np.linalg.eigh(self._hessian())
        curvatures = np.maximum(curvatures, FLATTEST * self._curvature)
        slopes = axes.T @ self._gradient
        low, high = 0.0, float(np.linalg.norm(slopes)) / radius
        if np.linalg.norm(slopes / curvatures) <= radius:
            high = 0.0
        while high - low > 1e-6 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.linalg.norm(slopes / (curvatures + middle)) > radius else (low, middle)
        self._step = -axes @ (slopes / (curvatures + high))
        if not self._coordinates.inside(self._centre + self._step):
            root = np.sqrt(curvatures + high)[:, None] * axes.T
            self._step = self._within_bounds(root, slopes / np.sqrt(curvatures + high))

    def _within_bounds(self, root: Array, target: Array) -> Array:
        """The step that minimises |root step + target|² within the bounds, less the room that slopes need.

        A lump at its bound stays there while the others move: to shorten the step instead would be the end of them.
        """
        from scipy.optimize import lsq_linear  # slow to load, and only a run needs it

        coordinates = self._coordinates
        inverse = np.linalg.inv(coordinates.spread)
        matrix = root @ inverse
        reach = self._slope_reach * float(np.sqrt(self._centre_value / self._curvature))
        room = np.linalg.norm(coordinates.spread, axis=1) * reach
        room = np.minimum(room, MOST_ROOM * (coordinates.high - coordinates.low))
        offset = root @ (inverse @ coordinates.origin + self._centre)
        found = lsq_linear(matrix, offset - target, (coordinates.low + room, coordinates.high - room), "bvls")
        step: Array = coordinates.z(found.x) - self._centre
        return step

    def _judge_step(self) -> None:
        """Goes on from the best candidate; if no step helped, tries a tenth of it, and at last forgets the Hessian."""
        if self._best_value < self._centre_value:
            self._centre, self._centre_value = self._best, self._best_value
            self._phase = "slope"
            return
        self._slope_reach = max(0.5 * self._slope_reach, 0.2 * SLOPE_REACH)
        shorter = 0.1 * float(np.linalg.norm(self._step))
        if shorter > 1e-3 * float(np.sqrt(self._centre_value / self._curvature)):
            self._aim(shorter)
            return
        self._shape = _known_shape(len(self._centre))
        self._gradient = None
        self._phase = "slope"


def _known_shape(nlump: int) -> BFGS:
    """The Hessian (nlump x nlump) in units of the known 2κ: the identity before the first update.

    Damped updates keep it positive definite whatever the landscape does. In this unit scipy starts with the right
    matrix: of an initial scale it knows nothing before the first update.
    """
    from scipy.optimize import BFGS  # slow to load, and only a run needs it

    shape = BFGS(exception_strategy="damp_update", min_curvature=DAMPING, init_scale=1.0)
    shape.initialize(nlump, "hess")
    return shape
