"""What one would write without metaid: `study.optimize` around a MuJoCo loop, with CMA-ES, two threads and SQLite.

Written with some care: a lean model, one MjData a thread, the law in a few numpy calls on arrays made beforehand, falls
pruned and told to the sampler. It shares no code with metaid; it is given the same chain, pushes and nominal lumps.
"""

from __future__ import annotations

import math
import threading
import warnings
from dataclasses import dataclass

import mujoco
import numpy as np
import optuna


@dataclass(frozen=True)
class Task:
    """Link parameters (n), nominal `mu` (n) and `a` (n x n), impulse-free starts: joint speeds (npush x n)."""

    length: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    gravity: float
    timestep: float
    mu: np.ndarray
    a: np.ndarray
    start: np.ndarray
    steps: int
    fall_limit: float
    first: float


def model_xml(task: Task) -> str:
    """The chain as MJCF."""
    bodies, height = "", 0.0
    links = (column.tolist() for column in (task.length, task.mass, task.com, task.inertia))
    for length, mass, com, inertia in zip(*links, strict=True):
        bodies += (
            f'<body pos="0 0 {height!r}"><joint type="hinge" axis="0 1 0"/>'
            f'<inertial pos="0 0 {com!r}" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
        )
        height = length
    off = " ".join(f'{flag}="disable"' for flag in ("constraint", "contact", "autoreset", "sensor", "actuation"))
    return (
        f'<mujoco><option timestep="{task.timestep!r}" gravity="0 0 {-task.gravity!r}" integrator="Euler">'
        f"<flag {off}/></option><worldbody>{bodies}{'</body>' * len(task.mass)}</worldbody></mujoco>"
    )


def names(n: int) -> list[str]:
    """Parameters of the search."""
    pairs = [f"coriolis_{i + 1}_{j + 1}" for i in range(n) for j in range(i + 1, n)]
    return [f"gravity_{i + 1}" for i in range(n)] + pairs


class Objective:
    """Frequency (Hz) of the pendulum under the candidate's compensation; a fall is a pruned trial."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.model = mujoco.MjModel.from_xml_string(model_xml(task))
        self.names = names(len(task.mass))
        self.pairs = np.triu_indices(len(task.mass), 1)
        self.local = threading.local()
        self.steps = 0

    def __call__(self, trial: optuna.Trial) -> float:
        factors = np.array([trial.suggest_float(name, 0.5, 2.0) for name in self.names])
        value, survived = self.episode(factors)
        self.steps += survived
        total = self.task.steps * len(self.task.start)
        if value is None:
            nyquist = 0.5 / self.task.timestep
            trial.report(nyquist * (2.0 - survived / total), step=survived)
            raise optuna.TrialPruned
        return value

    def episode(self, factors: np.ndarray) -> tuple[float | None, int]:
        """The spectral frequency, or None for a fall, and the steps that were run."""
        task, n = self.task, len(self.task.mass)
        mu = task.gravity * task.mu * factors[:n]
        a = np.zeros((n, n))
        a[self.pairs] = task.a[self.pairs] * factors[n:]
        a += a.T
        if not hasattr(self.local, "data"):
            self.local.data = mujoco.MjData(self.model)
        data, survived = self.local.data, 0
        qpos, qvel, torque = data.qpos, data.qvel, data.qfrc_applied
        ratios = []
        for start in task.start:
            mujoco.mj_resetData(self.model, data)
            qvel[:] = start
            fastest = 1.5 * np.abs(start.cumsum()).max()
            speeds = np.empty((task.steps + 1, n))
            speeds[0] = start
            phi, omega = qpos.cumsum(), qvel.cumsum()
            for step in range(1, task.steps + 1):
                sine = np.sin(phi[:, None] - phi)
                torque[:] = ((a * sine) @ omega**2 - mu * np.sin(phi))[::-1].cumsum()[::-1]
                mujoco.mj_step(self.model, data)
                speeds[step] = qvel
                phi, omega = qpos.cumsum(), qvel.cumsum()
                survived += 1
                inside = (np.abs(phi) <= task.fall_limit) | (np.abs(omega) <= fastest)
                if not inside.all():
                    return None, survived
            squared = speeds**2
            change = (np.diff(speeds, axis=0) ** 2).sum(axis=0) / task.timestep
            ratios.append((change, task.timestep * (squared.sum(axis=0) - 0.5 * (squared[0] + squared[-1]))))
        change, energy = (np.array(part) for part in zip(*ratios, strict=True))
        return float(np.sqrt(change.sum() / energy.sum()) / (2 * math.pi)), survived


def run(task: Task, trials: int, storage: str | None, seed: int = 1) -> tuple[optuna.Study, Objective]:
    """A study of that many trials; `storage` None keeps it in memory."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.simplefilter("ignore")  # x0 and sigma0 are deprecated, consider_pruned_trials is experimental
    objective = Objective(task)
    sampler = optuna.samplers.CmaEsSampler(
        x0=dict.fromkeys(objective.names, task.first),
        sigma0=0.2,
        seed=seed,
        consider_pruned_trials=True,
        warn_independent_sampling=False,
    )
    study = optuna.create_study(storage=storage, sampler=sampler, direction="minimize")
    study.optimize(objective, n_trials=trials, n_jobs=2)
    return study, objective
