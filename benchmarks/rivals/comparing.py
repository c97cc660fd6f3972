"""One method on one rig for so many seconds of motion: the cells of the comparison."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial

import numpy as np

from benchmarks.chains import random_chain
from benchmarks.rivals.closed_loop import closed_loop
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.judging import Found, judge
from benchmarks.rivals.logs import Log, record
from benchmarks.rivals.pushed import best_trial, output_error
from benchmarks.rivals.regression import Columns, ordinary, regress, robust, weighted
from benchmarks.rivals.simulated import didim, instrumental
from benchmarks.rivals.toolbox import closed_loop as closed_loop_toolbox
from benchmarks.rivals.toolbox import open_loop
from metaid.episode import natural_time
from metaid.errors import MetaidError
from metaid.plant import PlantSettings, chain_of

BUDGETS = (5, 15, 60, 300)  # s of motion
GRAVITY: float = PlantSettings.model_fields["gravity"].default

PUSHED = {"metaid output-error": output_error, "metaid cmaes": best_trial}
LOGGED: dict[str, Callable[[Log], list[Columns]]] = {
    "least squares": partial(regress, solve=ordinary),
    "weighted": partial(regress, solve=weighted),
    "robust": partial(regress, solve=robust),
    "instrumental variables": instrumental,
    "DIDIM": didim,
    "closed-loop output error": closed_loop,
    "mujoco.sysid, open loop": open_loop,
}
DRIVEN = {"mujoco.sysid, closed loop": closed_loop_toolbox}
METHODS = (*PUSHED, *LOGGED, *DRIVEN)
SLOW = {
    "mujoco.sysid, open loop": (5, 60),
    "mujoco.sysid, closed loop": (5, 60),
}  # the budgets that a method is run for, where these are not all
UNEXPLAINED, MOST_UNEXPLAINED = ("torque noise", "late", "tilted", "friction"), 60  # metaid refuses these soon enough
ALONE = "metaid cmaes"  # searches nothing beside the lumps


@dataclass(frozen=True)
class Cell:
    """What a `method` found of the chain of so many `links` that a `seed` means, on a rig in this `condition`, in at
    most `budget` seconds of motion.

    Attributes:
        errors: with each setting of the method's filter (nsetting), as `judging.Error` has them; infinite where it
            found nothing.
        motion: seconds that it took.
        torque: the largest of any joint, in N m.
        angle: the largest of any joint, in rad.
        cpu: seconds of computing on one thread, all settings together.
        verdict: what the method itself says of its result.
    """

    condition: str
    method: str
    links: int
    seed: int
    budget: int
    errors: list[dict[str, float]]
    motion: float
    torque: float
    angle: float
    cpu: float
    verdict: str

    @property
    def sampler(self) -> str:
        """What `benchmarks.common.resumed` knows the run by, beside links and seed."""
        return key(self.condition, self.method, self.budget)


def key(condition: str, method: str, budget: int) -> str:
    """What a run is known by, beside links and seed."""
    return f"{condition} / {method} / {budget}"


def wanted(
    conditions: Sequence[str],
    methods: Sequence[str],
    links: Sequence[int],
    seeds: Sequence[int],
    budgets: Sequence[int],
) -> list[tuple[str, int, int]]:
    """Every run, those of one recording one after the other."""
    return [
        (key(condition, method, budget), nlink, seed)
        for seed in seeds
        for nlink in links
        for condition in conditions
        for budget in budgets
        for method in methods
        if _is_worth_it(condition, method, budget)
    ]


def _is_worth_it(condition: str, method: str, budget: int) -> bool:
    """Whether a method has something to say in such a condition, and says it in the time that a run may take."""
    searched = CONDITIONS[condition].searched
    if method == ALONE and searched:
        return False
    if method in PUSHED and condition in UNEXPLAINED:
        return budget <= MOST_UNEXPLAINED
    return budget in SLOW.get(method, BUDGETS)


def measure(named: str, nlink: int, seed: int) -> Cell:
    """One run."""
    condition, method, text = named.split(" / ")
    budget = int(text)
    true, nominal = random_chain(nlink, seed)
    began = time.process_time()
    try:
        if method in PUSHED:
            results = [PUSHED[method](true, nominal, CONDITIONS[condition], float(budget), seed)]
        else:
            by_drives = method in DRIVEN
            log = recorded(condition, nlink, seed, budget if by_drives else max(BUDGETS), by_drives).first(
                float(budget)
            )
            began = time.process_time()
            results = list(_found(log, (LOGGED | DRIVEN)[method](log)))
    except (MetaidError, np.linalg.LinAlgError) as problem:
        nothing = np.full(nlink * (nlink + 1) // 2, np.inf), np.full(nlink, np.inf)
        results = [Found(*nothing, 0.0, 0.0, 0.0, str(problem))]
    cpu = time.process_time() - began
    chain, natural = chain_of(true), natural_time(chain_of(nominal), GRAVITY)
    errors = [asdict(judge(found, chain, GRAVITY, natural)) for found in results]
    first = results[0]
    took = first.seconds, first.torque, first.angle, cpu
    return Cell(condition, method, nlink, seed, budget, errors, *took, first.verdict)


@lru_cache(maxsize=1)
def recorded(condition: str, nlink: int, seed: int, seconds: int, by_drives: bool) -> Log:
    """The rig along exciting trajectories; see `logs.record`."""
    true, nominal = random_chain(nlink, seed)
    return record(true, nominal, CONDITIONS[condition], float(seconds), seed, by_drives)


def _found(log: Log, results: list[Columns]) -> Iterator[Found]:
    """Each result of a method on a log, with what the log took."""
    strain = float(np.abs(log.seen.torques).max()), float(np.abs(log.seen.angles).max())
    for columns in results:
        yield Found(columns.lumps, columns.inertia, log.seconds, *strain)
