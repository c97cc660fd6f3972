"""What else identifies a chain, from recorded torques: linear least squares, and MuJoCo's own sysid toolbox."""

from __future__ import annotations

import io
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import sysid

from benchmarks.chains import Links
from benchmarks.recording import RUNS, Recording
from metaid.episode import natural_time
from metaid.models import Array
from metaid.plant import LinkSettings, chain_of
from metaid.plant.mujoco_model import build_spec

WINDOW, WINDOWS = 2.0, 24  # natural times that sysid simulates from a measured state, and how many of those it gets
LEAST_FACTOR, LARGEST_FACTOR = 0.3, 3.0  # that sysid allows of each nominal mass, centre of mass and inertia
SYSID_ITERATIONS, SYSID_TOLERANCE = 50, 1e-5  # the latter of a step in the factors


@dataclass(frozen=True)
class Found:
    """What a method found: `lumps` (nlump), `inertia_lumps` (nlink) or None; the seconds of motion of the plant that it
    saw; metaid's trials."""

    lumps: Array
    inertia_lumps: Array | None
    plant_s: float
    trials: int | None = None


def inverse_dynamics_regressor(angles: Array, speeds: Array, accelerations: Array, gravity: float) -> Array:
    """Joint torque per unit of each lump (nsample x nlink x nlump + nlink): gravity and Coriolis lumps in the order of
    `lump_names`, then inertia lumps.

    Joint `angles` (rad), `speeds` (rad/s), `accelerations` (rad/s²), all (nsample x nlink); `gravity` in m/s².  Eqs. 4
    and 6 of docs/method.md, which are linear in the lumps.
    """
    phi, rate, second_rate = (np.cumsum(signal, axis=1) for signal in (angles, speeds, accelerations))
    nsample, n = phi.shape
    first, second = np.triu_indices(n, 1)
    links, pairs = np.arange(n), n + np.arange(len(first))
    force = np.zeros((nsample, n, n + len(first) + n))
    force[:, links, links] = -gravity * np.sin(phi)
    sine, cosine = np.sin(phi[:, first] - phi[:, second]), np.cos(phi[:, first] - phi[:, second])
    force[:, first, pairs] = cosine * second_rate[:, second] + sine * rate[:, second] ** 2
    force[:, second, pairs] = cosine * second_rate[:, first] - sine * rate[:, first] ** 2
    force[:, links, n + len(first) + links] = second_rate
    torque: Array = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
    return torque


def least_squares(seen: Recording, nominal: Links, gravity: float) -> Found:
    """The lumps that explain the torques best.  The nominal model only scales the
    columns.
    """
    believed = chain_of(nominal)
    scale = np.append(believed.lumps.vector, believed.inertia_lumps)
    n = believed.nlink
    angles, speeds, accelerations = (signal.reshape(-1, n) for signal in (seen.angles, seen.speeds, seen.accelerations))
    regressor = inverse_dynamics_regressor(angles, speeds, accelerations, gravity).reshape(-1, len(scale)) * scale
    solution = np.linalg.lstsq(regressor, seen.torques.ravel())[0] * scale
    return Found(solution[:-n], solution[-n:], seen.seconds)


def mujoco_sysid(seen: Recording, nominal: Links, gravity: float) -> Found:
    """The lumps of the chain that MuJoCo's sysid toolbox finds from angles and torques.

    It searches the mass, centre of mass and inertia of every link; lengths are known. The upright chain is unstable,
    so no simulation can follow a recording for long: it is given short windows, each with the state it starts from.
    """
    believed = chain_of(nominal)
    steps = round(WINDOW * natural_time(believed, gravity) / seen.timestep)
    spec = build_spec(believed, gravity, seen.timestep)
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for i in range(believed.nlink):
        motor = spec.add_actuator(name=f"motor_{i + 1}", target=f"joint_{i + 1}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        spec.add_sensor(
            name=f"angle_{i + 1}",
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=f"joint_{i + 1}",
        )
    factors = sysid.ParameterDict()
    for i, link in enumerate(nominal):
        factors.add(_link_parameter(f"link_{i + 1}", link))
    sequences = _windows(spec, seen, steps)
    observed = [(f"joint_{i + 1}_qpos", sysid.SignalType.MjStateQPos) for i in range(believed.nlink)]
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        build_model=_remembered_models(),
        resample_true=False,
        enabled_observations=observed,
        n_threads=1,
    )
    found, _ = sysid.optimize(
        factors,
        residual,
        optimizer="mujoco",
        verbose=False,
        max_iters=SYSID_ITERATIONS,
        xtol=SYSID_TOLERANCE,
        output=io.StringIO(),
    )
    identified = chain_of(tuple(_scaled(link, found[f"link_{i + 1}"].value) for i, link in enumerate(nominal)))
    return Found(identified.lumps.vector, identified.inertia_lumps, WINDOWS * steps * seen.timestep)


def _remembered_models() -> sysid.BuildModelFn:
    """The toolbox's own build of a model, once per set of parameters and not once per window."""
    built: dict[bytes, mujoco.MjModel] = {}

    def build(factors: sysid.ParameterDict, spec: mujoco.MjSpec) -> mujoco.MjModel:
        key = factors.as_vector().tobytes()
        if key not in built:
            built[key] = sysid.apply_param_modifiers(factors, spec)
        return built[key]

    return build


def _link_parameter(body: str, link: LinkSettings) -> sysid.Parameter:
    """Factors of a link's nominal mass, centre of mass and inertia, written into the body of that name."""

    def write(spec: mujoco.MjSpec, parameter: sysid.Parameter) -> None:
        scaled, written = _scaled(link, parameter.value), spec.body(body)
        written.mass, written.ipos = scaled.mass, [0.0, 0.0, scaled.com]
        written.inertia = [scaled.inertia] * 3

    return sysid.Parameter(body, np.ones(3), np.full(3, LEAST_FACTOR), np.full(3, LARGEST_FACTOR), modifier=write)


def _scaled(link: LinkSettings, factors: Array) -> LinkSettings:
    mass, com, inertia = factors.tolist()
    believed = chain_of((link,))
    return link.model_copy(
        update={
            "mass": mass * link.mass,
            "com": com * float(believed.com[0]),
            "inertia": inertia * float(believed.inertia[0]),
        }
    )


def _windows(spec: mujoco.MjSpec, seen: Recording, steps: int) -> sysid.ModelSequences:
    """Windows of `steps` steps, evenly out of the recording, each with the recorded state that it starts from."""
    model, n = spec.compile(), seen.angles.shape[2]
    mapping = {f"joint_{i + 1}_qpos": (sysid.SignalType.MjStateQPos, np.array([i])) for i in range(n)}
    times = seen.timestep * np.arange(steps)
    states, controls, measured = [], [], []
    each = WINDOWS // RUNS
    for run in range(RUNS):
        for start in np.linspace(0, seen.angles.shape[1] - steps, each, dtype=int).tolist():
            window = slice(start, start + steps)
            states.append(sysid.create_initial_state(model, seen.angles[run, start], seen.speeds[run, start]))
            controls.append(sysid.TimeSeries(times, seen.torques[run, window]))
            measured.append(sysid.TimeSeries(times, seen.angles[run, window], mapping))
    names = [f"window_{i}" for i in range(len(states))]
    return sysid.ModelSequences("chain", spec, names, states, controls, measured)
