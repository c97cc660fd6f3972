"""The rig: a chain or an arm on the bench of `soak.bench`, along a trajectory, and pushed by metaid."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arm_rigs import HORIZON
from benchmarks.chain_on_bench import of_faults
from benchmarks.chains import Links
from benchmarks.rivals.conditions import CONDITIONS, TIMESTEP, Condition
from benchmarks.rivals.judging import Found
from benchmarks.rivals.servo import Followed, Servo, read_and_command, recorded
from metaid.compiled import compiled
from metaid.episode import rich_speeds
from metaid.errors import StudyError
from metaid.estimation import ArmEstimate, ReadTrial
from metaid.exporting.xml_files import mjcf
from metaid.models import Array
from metaid.models.tree import ArmPrior
from metaid.plant import ArmPlant
from metaid.results import Snapshot, read_snapshot
from metaid.store import Store
from metaid.study import Problem, StudySettings, StudySpec, create_study, load_study, run_study
from soak.bench import Arm, Bench, Imperfections, arm_of_links, arm_of_mjcf
from soak.bench.dynamics import advance
from soak.bench.serving import bench

# Hz, of the bench's Runge-Kutta steps: those of a chain are wrong by 1e-10 of a turn; bristles of friction need more.
RATE, RATE_OF_BRISTLES = 4000.0, 20000.0
NUMBERS = "length", "mass", "com", "inertia"
SEARCHED = {"friction": "viscous", "tilt": "tilt", "delay": "delay", "offset": "offset"}  # as a study has them
# Of `output-error`: there are more pushes in a trial where there is more time, and fewer where there is little. One law
# alone says little of what it compensates, so two trials of a push each say more than one of two.
FEWEST_TRIALS, MOST_TRIALS = 2, 4
# Of a bench that has none of these sensors read what is, and drives do at once what they are told.
INEXACT = (
    *("encoder_step", "angle_noise", "encoder_offset", "tick_jitter", "delay"),
    *("torque_noise", "torque_limit", "gains", "start_angles", "start_speeds"),
)


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
        one = _simulated(true, nominal, seed, 1)
        pushes = max(round(seconds / TIMESTEP) // one.episode.steps, 1)
        trials = trials_of(pushes, len(nominal))
        speeds = _simulated(true, nominal, seed, pushes // trials).chain.start_speeds
        # A study spares the stops and cables that a rig may have; this one has none, and is pushed as when simulated.
        peak = np.abs(speeds).max() / np.abs(rich_speeds(len(true), len(speeds), seed)).max()
        return trials, f"count = {len(speeds)}\npeak_speed = {float(peak)!r}"

    def write(folder: Path) -> tuple[Path, str]:
        (folder / "links.toml").write_text(_toml("links", true))
        return folder / "links.toml", _toml("nominal.links", nominal)

    arm, n = arm_of_links({"links": [_numbers(link) for link in true]}), len(true)
    has = of_faults(condition.settings, TIMESTEP, n) | {"viscous": (condition.friction,) * n, "rate": RATE}
    return Benched(arm, True, has, write, pushes_in)


def _simulated(true: Links, nominal: Links, seed: int, pushes: int) -> Problem:
    """A study of the same chain, simulated, of so many `pushes`: what its episode is by default."""
    study = StudySettings.model_validate(
        {
            "plant": "rig",
            "nominal": "believed",
            "sampler": "output-error",
            "seed": seed,
            "episode": {"measure": "smoothed", "count": pushes},
        }
    )
    plant = CONDITIONS["fine"].plant(true)
    return Problem(StudySpec(name="rig", plant_name="rig", plant=plant, nominal=nominal, study=study))


def trials_of(pushes: int, nlink: int) -> int:
    """How many trials of `output-error` so many pushes are: two for each link in each, or two trials of fewer."""
    return min(int(np.clip(pushes // (2 * nlink), FEWEST_TRIALS, MOST_TRIALS)), pushes)


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
    # Where a chain's encoders are offset, an arm's joints are misplaced.
    has = of_faults(condition.settings, TIMESTEP, plant.njoint) | friction
    has |= {"encoder_offset": 0.0, "stiction": 1.0, "rate": RATE_OF_BRISTLES}
    return Benched(arm_of_mjcf(file), False, has, write, pushes_in, prior)


def follow_on_bench(benched: Benched, servo: Servo, weights: Array, seed: int, loops: int = 1) -> Followed:
    """It along a trajectory that begins, as it is read, where the servo's does, with its speeds.

    Args:
        benched: what moves.
        servo: what drives it.
        weights: that make speeds of angles; see `Sensors`.
        seed: of all noise.
        loops: how often feedback is read and sent in a timestep.
    """
    has, often = Imperfections(**benched.has, seed=seed), servo.held(loops)
    has = replace(has, torque_noise=has.torque_noise * np.sqrt(loops))  # which moves the rig as much
    body = Bench(benched.arm, TIMESTEP / loops, has, benched.is_planar)
    steps, n = len(often.angles), benched.njoint
    nothing = np.zeros(n)  # the bench itself reads too much, where an encoder does
    is_exact = not any(np.any(getattr(has, each)) for each in INEXACT)

    def run(angles: Array, speeds: Array, torques: Array) -> int:
        body.push(*([0.0] * n for _ in body.needs))
        body.state[0], body.state[1] = servo.angles[0] - has.encoder_offset, servo.speeds[0]
        if is_exact:
            substeps = max(round(has.rate * body.timestep), 1)
            drive = has.torque_lag, has.speed_filter, substeps, body.timestep / substeps
            moved = body.arm, body.joints, drive, body.state, body.shown
            work = np.zeros(1), np.zeros((1, n)), body.room
            return int(_follow(moved, often.driven, (nothing, weights), work, angles, speeds, torques))
        for step in range(steps + 1):
            read = np.array(body.states()[0])
            if not read_and_command(step, read, body.state[1], often.driven, nothing, weights, angles, speeds, torques):
                return step
            if step < steps:
                body.advance(torques[step])
        return steps

    seen = recorded(often, run)
    whole = len(seen.torques) // loops
    return Followed(seen.angles[::loops][: whole + 1], seen.speeds[::loops][: whole + 1], seen.torques[::loops][:whole])


@compiled
def _follow(moved, driven, sensors, work, angles, speeds, torques):  # type: ignore[no-untyped-def]
    """What `follow_on_bench` does step by step, of a bench that is exact; returns the steps before it was lost."""
    (arm, joints, drive, state, shown), (nothing, weights), (now, acting, room) = moved, sensors, work
    steps, n = torques.shape
    for step in range(steps + 1):
        if not read_and_command(step, state[0], state[1], driven, nothing, weights, angles, speeds, torques):
            return step
        if step < steps:
            for i in range(n):
                acting[0, i] = torques[step, i]
            advance(arm, joints, drive, state, shown, now, acting, room)
    return steps


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
        with (
            bench(plant, TIMESTEP, **benched.has, seed=float(seed)) as address,
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
    problem, verdict, experiment = snapshot.problem, snapshot.verdict, snapshot.problem.experiment()
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


def _numbers(link: object) -> dict[str, float]:
    return {name: float(getattr(link, name)) for name in NUMBERS}


def _toml(key: str, links: Sequence[object]) -> str:
    each = ("\n".join(f"{name} = {value!r}" for name, value in _numbers(link).items()) for link in links)
    return "".join(f"[[{key}]]\n{text}\n" for text in each)
