"""One method on one rig for so many seconds of motion: the cells of the comparison."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial

import numpy as np

from benchmarks.rivals.closed_loop import closed_loop
from benchmarks.rivals.judging import Found
from benchmarks.rivals.logs import Log
from benchmarks.rivals.regression import ordinary, regress, robust, weighted
from benchmarks.rivals.simulated import didim, instrumental
from benchmarks.rivals.subjects import ARMS, subject_of
from benchmarks.rivals.toolbox import TimeIsUpError, open_loop
from benchmarks.rivals.toolbox import closed_loop as closed_loop_toolbox
from metaid.errors import MetaidError
from metaid.models import Array

BUDGETS, LONGEST_OF_ARMS = (5, 15, 60), 5  # s of motion

OURS = "metaid output-error"
OPEN, DRIVES = "mujoco.sysid, open loop", "mujoco.sysid, closed loop"
LOGGED: dict[str, Callable[[Log], list[Array]]] = {
    "least squares": partial(regress, solve=ordinary),
    "weighted": partial(regress, solve=weighted),
    "robust": partial(regress, solve=robust),
    "instrumental variables": instrumental,
    "DIDIM": didim,
    "closed-loop output error": closed_loop,
    OPEN: open_loop,
}
DRIVEN = {DRIVES: closed_loop_toolbox}
METHODS = (OURS, *LOGGED, *DRIVEN)
UNEXPLAINED = ("late", "tilted", "friction", "kinematics")  # nobody knows what is wrong
OF_ARMS, OF_TOOLBOX = ("none", "fine", "kinematics"), ("none", "coarse", "fine", "torque noise")
SEEDS = (0, 1, 2)


@dataclass(frozen=True)
class Cell:
    """What a `method` found of the chain of so many `links` that a `seed` means, or of an arm of so many joints, on a
    rig in this `condition`, in at most `budget` seconds of motion.

    Attributes:
        errors: with each setting of the method's filter (nsetting), as `judging.Error` has them; infinite where it
            found nothing.
        motion: seconds that it took.
        torque: the largest of any joint, in N m.
        range: the largest of any joint's angle, in rad.
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
    range: float
    cpu: float
    verdict: str

    @property
    def sampler(self) -> str:
        """What a file of results knows the run by, beside links and seed."""
        return key(self.condition, self.method, self.budget)


def key(condition: str, method: str, budget: int) -> str:
    """What a run is known by, beside links and seed."""
    return f"{condition} / {method} / {budget}"


Run = tuple[str, int, int]  # key, links, seed


def wanted(
    conditions: Sequence[str],
    methods: Sequence[str],
    budgets: Mapping[int, Sequence[int]],
    seeds: Sequence[int],
) -> list[Run]:
    """Every run that is worth it, those of one recording one after the other.

    Args:
        conditions: of the rigs.
        methods: by name.
        budgets: seconds of motion of each number of links.
        seeds: of the chains.
    """
    return [
        (key(condition, method, budget), nlink, seed)
        for seed in seeds
        for nlink in budgets
        for condition in conditions
        for method in methods
        for budget in budgets[nlink]
        if _is_worth_it(condition, method, nlink, seed, budget)
    ]


def _is_worth_it(condition: str, method: str, links: int, seed: int, budget: int) -> bool:
    """Whether a method has something to say of it, and says it in the time that the whole comparison may take."""
    if links in ARMS and (condition not in OF_ARMS or method in (OPEN, DRIVES) or budget > LONGEST_OF_ARMS):
        return False
    if links in ARMS and method == OURS and condition == "kinematics":
        return seed == 0  # what explains nothing takes minutes of computing to refuse
    if method in (OPEN, DRIVES):
        most = 60 if method == OPEN and links < 5 else 5
        return condition in OF_TOOLBOX and seed == 0 and budget in (5, most)
    return True


def measure(named: str, nlink: int, seed: int) -> Cell:
    """One run."""
    condition, method, text = named.split(" / ")
    budget, subject = int(text), subject_of(condition, nlink, seed)
    began = time.process_time()
    try:
        if method == OURS:
            results = [subject.pushed(float(budget))]
        else:
            by_drives = method in DRIVEN
            longest = budget if by_drives else max(BUDGETS)
            log = recorded(condition, nlink, seed, longest, by_drives).first(float(budget))
            began = time.process_time()
            results = _found(log, (LOGGED | DRIVEN)[method])
    except (MetaidError, np.linalg.LinAlgError) as problem:
        results = [Found(np.full(subject.count, np.inf), 0.0, 0.0, 0.0, str(problem))]
    cpu = time.process_time() - began
    errors = [asdict(subject.judge(found.parameters)) for found in results]
    first = results[0]
    took = first.seconds, first.torque, first.range, cpu
    return Cell(condition, method, nlink, seed, budget, errors, *took, first.verdict)


def measure_all(runs: Sequence[Run]) -> list[Cell]:
    """Several runs, one after the other."""
    return [measure(*run) for run in runs]


@lru_cache(maxsize=1)
def recorded(condition: str, nlink: int, seed: int, seconds: int, by_drives: bool) -> Log:
    """The rig along exciting trajectories; see `logs.record`."""
    return subject_of(condition, nlink, seed).record(float(seconds), by_drives)


def _found(log: Log, method: Callable[[Log], list[Array]]) -> list[Found]:
    """Each result of a method on a log, with what the log took."""
    strain = float(np.abs(log.seen.torques).max()), float(np.ptp(log.seen.angles, axis=0).max())
    try:
        results, verdict = method(log), ""
    except TimeIsUpError as end:
        results, verdict = [end.best], str(end)
    return [Found(parameters, log.seconds, *strain, verdict) for parameters in results]
