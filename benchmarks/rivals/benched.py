"""A chain of which no plant of metaid's is made: the bench of `soak.bench`, along a trajectory and pushed."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.chains import Links
from benchmarks.rivals.conditions import CONDITIONS, TIMESTEP, Condition
from benchmarks.rivals.judging import Found
from benchmarks.rivals.pushed import SEARCHED, Rig
from benchmarks.rivals.servo import Followed, Sensors, Servo, read_and_command, recorded
from metaid.estimation import ReadTrial
from metaid.models import Array
from metaid.results import Snapshot, judge, read_snapshot
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.bench import Bench, Imperfections, arm_of_links
from soak.bench.serving import bench

RATE = 4000.0  # Hz, of the bench's Runge-Kutta steps: they are wrong by 1e-10 of a turn
NUMBERS = "length", "mass", "com", "inertia"


def follow_on_bench(true: Links, condition: Condition, servo: Servo, weights: Array, seed: int) -> Followed:
    """A chain along a trajectory that begins, as it is read, where the servo's does, with its speeds.

    Args:
        true: its links.
        condition: what is wrong with it.
        servo: what drives it.
        weights: that make speeds of angles; see `Sensors`.
        seed: of all noise.
    """
    n, links = len(true), {"links": [_numbers(link) for link in true]}
    has = Imperfections(**_imperfections(condition, n), rate=RATE, seed=seed)
    body = Bench(arm_of_links(links), TIMESTEP, has, is_planar=True)
    steps = len(servo.angles)
    seen = Sensors(np.zeros((steps + 1, n)), np.zeros((steps, n)), weights).seen

    def run(angles: Array, speeds: Array, torques: Array) -> int:
        body.push([0.0] * n)
        body.state[0], body.state[1] = servo.angles[0] - has.encoder_offset, servo.speeds[0]
        for step in range(steps + 1):
            read = np.array(body.states()[0])
            if not read_and_command(step, read, body.state[1], servo.driven, seen, angles, speeds, torques):
                return step
            if step < steps:
                body.advance(torques[step])
        return steps

    return recorded(servo, run)


def output_error_on_bench(true: Links, nominal: Links, condition: Condition, seconds: float, seed: int) -> Found:
    """What a study finds by pushes, all by default but for what is searched, and what its verdict is.

    Args:
        true: links of the bench.
        nominal: links that are believed.
        condition: what is wrong with it.
        seconds: of motion, without what is measured when the study is created.
        seed: of the study, and of all chance.
    """
    pushed = Rig(true, nominal, CONDITIONS["fine"], "output-error", seconds, seed).spec.study  # for so much time
    trials, pushes = pushed.trials, pushed.episode.count
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "links.toml").write_text(_toml("links", true))
        chance = {"start_speeds": condition.settings.push_noise, "rate": RATE, "seed": float(seed)}
        with (
            bench(folder / "links.toml", TIMESTEP, **_imperfections(condition, len(true)), **chance) as address,
            closing(Store(f"{folder}/metaid.db", create=True)) as store,
        ):
            rig = f'socket = "{address}"\njoints = {len(true)}\ntimestep = {TIMESTEP}\nstep_timeout = 60.0\n'
            (folder / "rig.toml").write_text(rig)
            faults = [SEARCHED[each] for each in condition.searched]
            settings = f"[episode]\ncount = {pushes}\n" + (f"[estimate]\nfaults = {faults!r}\n" if faults else "")
            head = f'plant = "rig.toml"\nsampler = "output-error"\ntrials = {trials}\nseed = {seed}\n'
            (folder / "study.toml").write_text(head + settings + _toml("nominal.links", nominal))
            create_study(store, load_study(str(folder / "study.toml")), "study")
            run_study(store, "study")
            return _found(read_snapshot(store, "study"))


def _found(snapshot: Snapshot) -> Found:
    """What a study has found, and what its motion took."""
    problem, verdict = snapshot.problem, judge(snapshot)
    trials = [each for each in snapshot.trials if each.outcome.readings is not None]
    experiment = problem.experiment()
    assert experiment is not None
    seen = [experiment.trial(each.factors, each.outcome) for each in trials]
    read = [each for each in seen if isinstance(each, ReadTrial)]
    seconds = problem.timestep * float(sum(each.outcome.steps for each in snapshot.trials))
    torque = max((float(np.abs(each.torques).max()) for each in read), default=0.0)
    moved = max((float(np.ptp(each.readings, axis=(0, 1)).max()) for each in read), default=0.0)
    lumps = verdict.lumps if snapshot.estimate is None else snapshot.estimate.estimate.values
    return Found(np.asarray(lumps, dtype=np.float64), seconds, torque, moved, verdict.word)


def _imperfections(condition: Condition, n: int) -> dict[str, Any]:
    """What is wrong with the bench, but for how pushes differ."""
    faults = condition.settings
    return {
        "angle_noise": faults.angle_noise,
        "encoder_offset": float(faults.encoder_offsets(n)[0]),
        "torque_noise": faults.torque_noise,
        "delay": faults.delay * TIMESTEP,
        "tilt": float(faults.tilts(1)[0]),
        "viscous": (condition.friction,) * n,
    }


def _numbers(link: object) -> dict[str, float]:
    return {name: float(getattr(link, name)) for name in NUMBERS}


def _toml(key: str, links: Sequence[object]) -> str:
    each = ("\n".join(f"{name} = {value!r}" for name, value in _numbers(link).items()) for link in links)
    return "".join(f"[[{key}]]\n{text}\n" for text in each)
