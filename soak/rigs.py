"""Rigs that lie in every way of `soak.lies`, and rigs that do not: what is not true never becomes a COMPLETE or PRUNED
trial, and nobody honest is called a liar.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import chdir, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from metaid.store import Store
from metaid.study import create_study, load_study
from soak.common import SoakResult, soaked
from soak.judge import Answer, BrokenPromiseError, command
from soak.lies import LIES, PUSHES_A_TRIAL, Liar, Lie, listening

STEPS = 150  # after a push
HONEST_TRIALS = 1  # before a lie
TRIALS = 8
NOISE: dict[str, dict[str, Any]] = {"exact": {}, "noisy": {"angle_noise": 1e-3, "push_noise": 0.02}}
HONEST_RIGS = 20
WITHIN_NOISE = {"exact": (), "noisy": ("pushes are a tenth too weak",)}  # a push that noise could have made

STUDY = f"""plant = "rig.toml"
sampler = "random"
trials = {TRIALS}
search.low = 0.7
search.high = 1.4
episode.steps = {STEPS}
[[nominal.links]]
length = 0.42
mass = 0.9
com = 0.21
inertia = 0.0125
[[nominal.links]]
length = 0.35
mass = 1.0
com = 0.175
inertia = 0.0096
"""


class Told(NamedTuple):
    """What a run on a rig came to: what the command said, the state and the reason of each trial, and every torque that
    the rig was sent (nstep x njoint).
    """

    answer: Answer
    states: list[str]
    reasons: list[str | None]
    torques: list[list[float]]


@contextmanager
def created(liar: Liar, seed: int = 0, motion: str = "stepped") -> Iterator[None]:
    """A folder with a study of the rig, which is the current one meanwhile; the rig is honest while it is created."""
    with listening(liar) as address, tempfile.TemporaryDirectory(prefix="metaid-rigs-") as folder, chdir(folder):
        Path("rig.toml").write_text(f'socket = "{address}"\njoints = 2\nstep_timeout = 30.0\nmotion = "{motion}"\n')
        Path("study.toml").write_text(STUDY)
        with closing(Store("template.db", create=True)) as store:
            create_study(store, load_study("study.toml", {"seed": seed}), "study")
        yield


def told(liar: Liar, lie: Lie | None) -> Told:
    """What a run of the study that is `created` comes to where the rig tells a `lie` after HONEST_TRIALS."""
    Path("run.db").write_bytes(Path("template.db").read_bytes())
    liar.arm(lie, HONEST_TRIALS * PUSHES_A_TRIAL)
    answer = command(["study", "run", "study", "--storage", "run.db", "--quiet"])
    with closing(Store("run.db")) as store:
        trials = store.trials("study", load_study("study.toml").names)
    return Told(
        answer, [trial.state.name for trial in trials], [trial.outcome.failure for trial in trials], liar.sent_torques()
    )


def broken(found: Told) -> str | None:
    """Which promise was broken where a rig lied from the trial HONEST_TRIALS on."""
    if not all(math.isfinite(torque) for sent in found.torques for torque in sent):
        return "a torque that is not finite was sent"
    if found.states[HONEST_TRIALS:] != ["FAIL", "FAIL"] or "FAIL" in found.states[:HONEST_TRIALS]:
        return f"trials are {', '.join(found.states)}: {found.reasons}"
    if not all(found.reasons[HONEST_TRIALS:]):
        return "a trial failed without a reason"
    if found.answer.status != 2 or "the last 2 trials on the rig 'rig' failed" not in found.answer.err:
        return f"exit status {found.answer.status}: {found.answer.err}"
    return None


def lies(kind: str) -> dict[str, Lie]:
    """The lies that a rig of this `kind` of NOISE can be caught at, by name."""
    return {name: lie for name, lie in LIES.items() if name not in WITHIN_NOISE[kind]}


def _liars(kind: str) -> tuple[int, Sequence[str]]:
    liar, failures, tried = Liar(STEPS, **NOISE[kind]), [], lies(kind)
    with created(liar):
        for name, lie in tried.items():
            try:
                failure = broken(told(liar, lie))
            except BrokenPromiseError as problem:
                failure = str(problem)
            if failure is not None:
                failures.append(f"{name}: {failure}")
    return len(tried), failures


def _honest(count: int) -> tuple[int, Sequence[str]]:
    failures = []
    for seed in range(count):
        liar = Liar(STEPS, **NOISE["noisy" if seed % 2 else "exact"], seed=seed)
        with created(liar, seed):
            found = told(liar, None)
        if "FAIL" in found.states or len(found.states) != TRIALS:
            failures.append(f"seed {seed}: {found.states}, {found.reasons}")
    return count, failures


def run(scale: float) -> list[SoakResult]:
    """A result for each kind of liar, and one for honest rigs. All lies are tried at any scale."""
    count = max(round(scale * HONEST_RIGS), 2)
    return [
        *(soaked(f"rigs that lie, {kind}", len(lies(kind)), partial(_liars, kind)) for kind in NOISE),
        soaked("honest rigs that are believed", count, lambda: _honest(count)),
    ]
