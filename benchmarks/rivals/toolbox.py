"""MuJoCo's own toolbox, `mujoco.sysid`, in open loop and in closed loop.

Open loop: short windows of a log are simulated from the states read there. Closed loop: model and rig have the same
position servos, as MuJoCo actuators, and the whole log is simulated, from rest on.

It searches the mass, centre of mass and inertia of every link, and friction and tilt where these are searched; lengths
are known. The upright chain is unstable, so no simulation without a servo can follow a log for long. Models are built
once per candidate, not once per window as the toolbox would.
"""

from __future__ import annotations

import io
import time
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import mujoco
import numpy as np
from mujoco import sysid

from benchmarks.recording import Recording, filtered
from benchmarks.rivals.logs import Log
from benchmarks.rivals.models import ChainModel
from benchmarks.rivals.regression import SPANS, delayed, search_beforehand
from metaid.models import Array, Chain
from metaid.plant.description import build_spec

WINDOW = 2.0  # natural times that are simulated from a state that was read
WINDOWS = 24  # at most, evenly out of the log: each costs as much as the others
LEAST_FACTOR, LARGEST_FACTOR = 0.3, 3.0  # allowed of each nominal mass, centre of mass and inertia
MOST_FRICTION, MOST_TILT = 1.0, 0.3  # N m s, rad
ITERATIONS, TOLERANCE = 50, 1e-5  # the latter of a step in the factors
ALLOWED = 20.0  # s of computing, after which the best so far is the result
TIME_IS_UP = f"ended after {ALLOWED:g} s"


class TimeIsUpError(Exception):
    """The toolbox had computed for ALLOWED seconds; the `best` parameters so far."""

    def __init__(self, best: Array) -> None:
        super().__init__(TIME_IS_UP)
        self.best = best


@dataclass(frozen=True)
class _Body:
    """What the toolbox searches of one link of the `nominal` chain."""

    nominal: Chain
    link: int

    def scaled(self, factors: Array) -> tuple[float, float, float]:
        """Mass, centre of mass and inertia."""
        chain, i = self.nominal, self.link
        mass, com, inertia = (float(part) for part in factors * (chain.mass[i], chain.com[i], chain.inertia[i]))
        return mass, com, inertia

    def write(self, spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
        """Writes them into the body of the link."""
        mass, com, inertia = self.scaled(parameter.value)
        body = spec.body(f"link_{self.link + 1}")
        body.mass, body.ipos, body.inertia = mass, [0.0, 0.0, com], [inertia] * 3


def open_loop(log: Log) -> list[Array]:
    """The lumps that the toolbox finds of a log.

    Raises:
        TimeIsUpError: it did not end.
    """
    seen, n = _motion(log), log.model.njoint
    steps = min(round(WINDOW * log.natural / log.timestep), len(seen.torques))
    starts = np.linspace(0, len(seen.torques) - steps, min(WINDOWS, len(seen.torques) // steps), dtype=int)
    spec = _spec(_model(log), np.zeros(n), np.zeros(n))
    return _search(log, spec, _windows(spec, seen, starts.tolist(), steps))


def closed_loop(log: Log) -> list[Array]:
    """The lumps that the toolbox finds of a log that was made by the servos of drives.

    Raises:
        TimeIsUpError: it did not end.
    """
    servo, seen, delay = log.servo, log.seen, search_beforehand(log).delay
    damping = 2.0 * servo.bandwidth * np.diag(servo.gains[0])
    stiffness = servo.bandwidth**2 * np.diag(servo.gains[0])
    sent = servo.forward + servo.angles * stiffness + servo.speeds * damping
    sent = np.concatenate([np.zeros((delay, sent.shape[1])), sent[: len(sent) - delay]])
    motion = Recording(seen.angles[:-1].copy(), np.zeros_like(sent), np.zeros_like(sent), sent, log.timestep)
    motion.angles[0] = 0.0  # where the trajectory begins
    spec = _spec(_model(log), stiffness, damping)
    return _search(log, spec, _windows(spec, motion, [0], len(sent)))


def _model(log: Log) -> ChainModel:
    """What is believed of a chain."""
    assert isinstance(log.model, ChainModel)
    return log.model


def _search(log: Log, spec: mujoco.MjSpec, windows: sysid.ModelSequences) -> list[Array]:
    """What explains the `windows` best."""
    model = _model(log)
    nominal, searched, n = model.nominal, log.condition.searched, model.njoint
    factors = sysid.ParameterDict()
    for i in range(n):
        limits = np.full(3, LEAST_FACTOR), np.full(3, LARGEST_FACTOR)
        factors.add(sysid.Parameter(f"link_{i + 1}", np.ones(3), *limits, modifier=_Body(nominal, i).write))
    if "friction" in searched:
        limits = np.zeros(n), np.full(n, MOST_FRICTION)
        factors.add(sysid.Parameter("friction", np.full(n, 0.02), *limits, modifier=_write_friction))
    if "tilt" in searched:
        limits = np.full(1, -MOST_TILT), np.full(1, MOST_TILT)
        factors.add(sysid.Parameter("tilt", np.zeros(1), *limits, modifier=_tilting(model.gravity)))
    residual = sysid.build_residual_fn(
        models_sequences=[windows],
        build_model=_remembered_models(),
        resample_true=False,
        enabled_observations=[(f"joint_{i + 1}_qpos", sysid.SignalType.MjStateQPos) for i in range(n)],
        n_threads=1,
    )
    ends, best = time.process_time() + ALLOWED, (np.inf, factors.as_vector())

    def lumps(found: Array) -> Array:
        factors.update_from_vector(found)
        bodies = np.array([_Body(nominal, i).scaled(factors[f"link_{i + 1}"].value) for i in range(n)])
        chain = replace(nominal, mass=bodies[:, 0], com=bodies[:, 1], inertia=bodies[:, 2])
        return np.append(chain.lumps.vector, chain.inertia_lumps)

    def in_time(point: Array, named: sysid.ParameterDict) -> Any:
        nonlocal best
        if time.process_time() > ends:
            raise TimeIsUpError(lumps(best[1]))
        values = residual(point, named)
        single = np.asarray(point).reshape(len(best[1]), -1)
        if single.shape[1] == 1:  # differences come many at once
            best = min(
                best, (float(sum((part**2).sum() for part in values[0])), single[:, 0].copy()), key=itemgetter(0)
            )
        return values

    found, _ = sysid.optimize(
        factors,
        in_time,
        optimizer="mujoco",
        verbose=False,
        max_iters=ITERATIONS,
        xtol=TOLERANCE,
        output=io.StringIO(),
    )
    return [lumps(found.as_vector())]


def _motion(log: Log) -> Recording:
    """Angles, speeds and torques of a log (nstep x njoint), filtered where they are noisy."""
    angles, speeds, torques = log.seen.angles[:-1], log.seen.speeds[:-1], delayed(log, search_beforehand(log).delay)
    if log.condition.is_exact:
        return Recording(angles, speeds, speeds, torques, log.timestep)
    smooth = filtered(angles[None], torques[None], log.timestep, log.natural, SPANS[-1])
    return Recording(smooth.angles[0], smooth.speeds[0], smooth.accelerations[0], torques, log.timestep)


def _spec(model: ChainModel, stiffness: Array, damping: Array) -> mujoco.MjSpec:
    """The nominal chain with a drive and a sensor of the angle in every joint: torque is what is sent less `stiffness`
    (njoint), in N m/rad, times the angle and `damping` (njoint), in N m s, times the speed.
    """
    spec = build_spec(model.nominal, model.gravity, model.timestep)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4  # the rig moves continuously
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for i in range(model.njoint):
        motor = spec.add_actuator(name=f"motor_{i + 1}", target=f"joint_{i + 1}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.biasprm[:3] = [0.0, -stiffness[i], -damping[i]]
        spec.add_sensor(
            name=f"angle_{i + 1}",
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=f"joint_{i + 1}",
        )
    return spec


def _write_friction(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
    for i, friction in enumerate(parameter.value.tolist()):
        spec.joint(f"joint_{i + 1}").damping = [friction, 0.0, 0.0]


def _tilting(gravity: float) -> sysid.ModifierFn:
    """Turns gravity, which is the same as turning the base, towards positive angles."""

    def write(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
        tilt = float(parameter.value[0])
        spec.option.gravity = [gravity * np.sin(tilt), 0.0, -gravity * np.cos(tilt)]

    return write


def _remembered_models() -> sysid.BuildModelFn:
    """The toolbox's own build of a model, once per set of parameters and not once per window."""
    built: dict[bytes, mujoco.MjModel] = {}

    def build(factors: sysid.ParameterDict, spec: mujoco.MjSpec) -> mujoco.MjModel:
        key = factors.as_vector().tobytes()
        if key not in built:
            built[key] = sysid.apply_param_modifiers(factors, spec)
        return built[key]

    return build


def _windows(spec: mujoco.MjSpec, seen: Recording, starts: list[int], steps: int) -> sysid.ModelSequences:
    """Windows of `steps` steps from each of the `starts` on, each with the state that it starts from."""
    model, n = spec.compile(), seen.torques.shape[1]
    mapping = {f"joint_{i + 1}_qpos": (sysid.SignalType.MjStateQPos, np.array([i])) for i in range(n)}
    times = seen.timestep * np.arange(steps)
    states, controls, measured = [], [], []
    for start in starts:
        window = slice(start, start + steps)
        states.append(sysid.create_initial_state(model, seen.angles[start], seen.speeds[start]))
        controls.append(sysid.TimeSeries(times, seen.torques[window]))
        measured.append(sysid.TimeSeries(times, seen.angles[window], mapping))
    names = [f"window_{i}" for i in range(len(states))]
    return sysid.ModelSequences("chain", spec, names, states, controls, measured)
