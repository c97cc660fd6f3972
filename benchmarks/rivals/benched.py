"""A chain or an arm of which no plant of metaid's is made: the bench of `soak.bench`, along a trajectory and pushed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arm_rigs import HORIZON
from benchmarks.chains import Links
from benchmarks.rivals.conditions import CONDITIONS, TIMESTEP, Condition
from benchmarks.rivals.judging import Found
from benchmarks.rivals.pushed import SEARCHED, Rig, trials_of
from benchmarks.rivals.servo import Followed, Sensors, Servo, read_and_command, recorded
from metaid.episode import rich_speeds
from metaid.errors import StudyError
from metaid.estimation import ArmEstimate, ReadTrial
from metaid.exporting.xml_files import mjcf
from metaid.models import Array
from metaid.models.tree import ArmPrior
from metaid.plant import ArmPlant
from metaid.results import Snapshot, judge, read_snapshot
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.bench import Arm, Bench, Imperfections, arm_of_links, arm_of_mjcf
from soak.bench.serving import bench

# Hz, of the bench's Runge-Kutta steps: those of a chain are wrong by 1e-10 of a turn; bristles of friction need more.
RATE, RATE_OF_BRISTLES = 4000.0, 20000.0
NUMBERS = "length", "mass", "com", "inertia"


@dataclass(frozen=True)
class Benched:
    """What stands on a bench, and what a study of it is told.

    Attributes:
        arm: its links and joints.
        is_planar: whether it is a chain, pushed at its tips.
        has: imperfections of the bench, by name.
        write: writes the files of the robot and of its nominal model into a folder; gives the first one's path, and
            what a study file says of the second.
        pushes_in: how many trials there are in so many seconds of motion, and what a study file says of the pushes.
        prior: of an arm, whose base parameters are told.
    """

    arm: Arm
    is_planar: bool
    has: dict[str, Any]
    write: Callable[[Path], tuple[Path, str]]
    pushes_in: Callable[[float], tuple[int, str]]
    prior: ArmPrior | None = None

    @property
    def njoint(self) -> int:
        return len(self.arm.masses)


def chain_on_bench(true: Links, nominal: Links, condition: Condition, seed: int) -> Benched:
    """A chain.

    Args:
        true: its links.
        nominal: links that are believed.
        condition: what is wrong with it.
        seed: of its study.
    """

    def pushes_in(seconds: float) -> tuple[int, str]:
        simulated = Rig(true, nominal, CONDITIONS["fine"], "output-error", seconds, seed)
        study, speeds = simulated.spec.study, simulated.problem.chain.start_speeds
        # A study spares the stops and cables that a rig may have; this one has none, and is pushed as when simulated.
        peak = np.abs(speeds).max() / np.abs(rich_speeds(len(true), len(speeds), seed)).max()
        return study.trials, f"count = {len(speeds)}\npeak_speed = {float(peak)!r}"

    def write(folder: Path) -> tuple[Path, str]:
        (folder / "links.toml").write_text(_toml("links", true))
        return folder / "links.toml", _toml("nominal.links", nominal)

    arm, n = arm_of_links({"links": [_numbers(link) for link in true]}), len(true)
    friction = {"viscous": (condition.friction,) * n}
    offset = float(condition.settings.encoder_offsets(n)[0])
    has = _imperfections(condition) | friction | {"encoder_offset": offset, "rate": RATE}
    return Benched(arm, True, has, write, pushes_in)


def arm_on_bench(plant: ArmPlant, prior: ArmPrior, condition: Condition) -> Benched:
    """An arm that ships, with its friction; dry friction is by bristles, no larger at rest.

    Args:
        plant: as it ships.
        prior: what is believed of it.
        condition: what is wrong with it.
    """
    assert plant.settings.mjcf is not None
    file, home = Path(plant.settings.mjcf), plant.settings.home

    def pushes_in(seconds: float) -> tuple[int, str]:
        pushes = max(round(seconds / HORIZON), 1)
        trials = trials_of(pushes, plant.njoint)
        count = pushes // trials
        return trials, f"coasts = {count - count // 3}\nsprings = {count // 3}"  # one on springs for two that coast

    def write(folder: Path) -> tuple[Path, str]:
        (folder / "nominal.xml").write_text(mjcf(prior.nominal, "nominal", plant.timestep, ()))
        places = ", ".join(f"{joint} = {angle!r}" for joint, angle in home.items())
        (folder / "nominal.toml").write_text(f'mjcf = "nominal.xml"\nhome = {{ {places} }}\n')
        return file, '[nominal]\nplant = "nominal.toml"\n'

    friction = {"viscous": tuple(plant.tree.damping.tolist()), "dry": tuple(plant.tree.coulomb.tolist())}
    has = _imperfections(condition) | friction | {"stiction": 1.0, "rate": RATE_OF_BRISTLES}
    return Benched(arm_of_mjcf(file), False, has, write, pushes_in, prior)


def follow_on_bench(benched: Benched, servo: Servo, weights: Array, seed: int) -> Followed:
    """It along a trajectory that begins, as it is read, where the servo's does, with its speeds.

    Args:
        benched: what moves.
        servo: what drives it.
        weights: that make speeds of angles; see `Sensors`.
        seed: of all noise.
    """
    has = Imperfections(**benched.has, seed=seed)
    body = Bench(benched.arm, TIMESTEP, has, benched.is_planar)
    steps, n = len(servo.angles), benched.njoint
    seen = Sensors(np.zeros((steps + 1, n)), np.zeros((steps, n)), weights).seen

    def run(angles: Array, speeds: Array, torques: Array) -> int:
        body.push(*([0.0] * n for _ in body.needs))
        body.state[0], body.state[1] = servo.angles[0] - has.encoder_offset, servo.speeds[0]
        for step in range(steps + 1):
            read = np.array(body.states()[0])
            if not read_and_command(step, read, body.state[1], servo.driven, seen, angles, speeds, torques):
                return step
            if step < steps:
                body.advance(torques[step])
        return steps

    return recorded(servo, run)


def output_error_on_bench(benched: Benched, condition: Condition, seconds: float, seed: int) -> Found:
    """What a study finds by pushes, all by default but for their speed and what is searched, and what its verdict is.

    Args:
        benched: what is pushed.
        condition: what is wrong with it.
        seconds: of motion, without what is measured when the study is created.
        seed: of the study, and of all chance.
    """
    trials, pushes = benched.pushes_in(seconds)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plant, nominal = benched.write(folder)
        chance = {"start_speeds": condition.settings.push_noise, "seed": float(seed)}
        with (
            bench(plant, TIMESTEP, **benched.has, **chance) as address,
            closing(Store(f"{folder}/metaid.db", create=True)) as store,
        ):
            rig = f'socket = "{address}"\njoints = {benched.njoint}\ntimestep = {TIMESTEP}\nstep_timeout = 60.0\n'
            (folder / "rig.toml").write_text(rig)
            faults = [SEARCHED[each] for each in condition.searched]
            settings = f"[episode]\n{pushes}\n" + (f"[estimate]\nfaults = {faults!r}\n" if faults else "")
            head = f'plant = "rig.toml"\nsampler = "output-error"\ntrials = {trials}\nseed = {seed}\n'
            (folder / "study.toml").write_text(head + settings + nominal)
            create_study(store, load_study(str(folder / "study.toml")), "study")
            run_study(store, "study")
            return _found(read_snapshot(store, "study"), benched.prior)


def _found(snapshot: Snapshot, prior: ArmPrior | None) -> Found:
    """What a study has found, of an arm in the base parameters of a `prior`, and what its motion took."""
    problem, verdict, experiment = snapshot.problem, judge(snapshot), snapshot.problem.experiment()
    if snapshot.estimate is None or experiment is None:
        raise StudyError(f"the study has no estimate: {verdict.word}")
    trials = [each for each in snapshot.trials if each.outcome.readings is not None]
    seen = [experiment.trial(each.factors, each.outcome) for each in trials]
    read = [each for each in seen if isinstance(each, ReadTrial)]
    seconds = problem.timestep * float(sum(each.outcome.steps for each in snapshot.trials))
    torque = max((float(np.abs(each.torques).max()) for each in read), default=0.0)
    moved = max((float(np.ptp(each.readings, axis=(0, 1)).max()) for each in read), default=0.0)
    estimate = snapshot.estimate.estimate
    values = np.asarray(estimate.values, dtype=np.float64)
    if prior is not None:
        assert isinstance(estimate, ArmEstimate)
        values = prior.base.of(estimate.searched.prior.parameters_at(values))
    return Found(values, seconds, torque, moved, verdict.word)


def _imperfections(condition: Condition) -> dict[str, Any]:
    """What is wrong with the bench, but for friction, encoder offsets, and how pushes differ."""
    faults = condition.settings
    return {
        "angle_noise": faults.angle_noise,
        "torque_noise": faults.torque_noise,
        "delay": faults.delay * TIMESTEP,
        "tilt": float(faults.tilts(1)[0]),
    }


def _numbers(link: object) -> dict[str, float]:
    return {name: float(getattr(link, name)) for name in NUMBERS}


def _toml(key: str, links: Sequence[object]) -> str:
    each = ("\n".join(f"{name} = {value!r}" for name, value in _numbers(link).items()) for link in links)
    return "".join(f"[[{key}]]\n{text}\n" for text in each)
