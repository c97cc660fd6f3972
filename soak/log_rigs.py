"""Simulated rigs that log how they move, and what may happen to them and to their logs: a case is a number."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import tomli_w
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from benchmarks.chains import random_chain
from metaid.models import Array
from metaid.models.tree import Tree, joint_mass_matrix, joint_torque
from metaid.plant import ArmPlant, ArmStart, FaultSettings, MujocoPlant, PlantSettings, Start, load_plant

SEED = 7
STEP = 5e-4  # s, of the simulation
RATES = (100, 200, 500, 1000)  # Hz
HARMONICS, SLOWEST, STIFF = 4, 0.25, 15.0  # of the motion, in Hz, and of the controller, in rad/s
FAULTS = (
    "late torques",
    "a bump",
    "a joint sticks",
    "a frozen encoder",
    "rows missing",
    "a gap",
    "NaN",
    "time goes back",
    "degrees",
    "no excitation",
    "little excitation",
    "torques of a joint missing",
    "torques of a joint are 0",
    "a torque scale",
    "a tilted base",
    "an encoder that is off",
    "a spring",
    "angles late",
    "wrong kinematics",
)
MENDED = {"NaN": "no number", "time goes back": "order"}  # and the repair that says so
BROKEN = ("degrees", "torques of a joint missing", "torques of a joint are 0")  # no such log is of its rig


@dataclass(frozen=True)
class Case:
    """A log by its number, and what it is `about`, in words."""

    number: int
    plant: str
    rate: int
    seconds: float
    noise: float
    steps: float
    speeds: bool
    damping: float
    dry: float
    friction: tuple[str, ...] | None
    delay: float | None
    fault: str

    @property
    def about(self) -> str:
        return ", ".join(
            [
                self.plant,
                f"{self.rate} Hz",
                f"{self.seconds:.1f} s",
                f"noise {self.noise:g}, steps {self.steps:.2g}",
                f"friction {self.damping:.2g} {self.dry:.2g}",
                "all terms" if self.friction is None else "two terms",
                "delay found" if self.delay is None else "delay said",
                self.fault or "no fault",
            ]
        )

    @property
    def well_posed(self) -> bool:
        return not self.fault and self.delay is None


def draw(number: int) -> Case:
    """The case of that number."""
    random = np.random.default_rng([SEED, number])
    plant = str(random.choice(["1", "2", "3", "4", "5", "puma560", "scara"]))
    noise, steps = ((0.0, 0.0), (1e-4, 0.0), (1e-3, 0.0), (0.0, 2.0 * np.pi / 8192))[int(random.integers(4))]
    is_rubbed = random.random() < 0.7
    fault = "" if random.random() < 0.4 else str(random.choice(FAULTS))
    return Case(
        number=number,
        plant=plant,
        rate=int(random.choice(RATES)),
        seconds=float(random.uniform(6.0, 15.0)),
        noise=noise,
        steps=steps,
        speeds=bool(random.random() < 0.5),
        damping=float(random.uniform(0.02, 0.5)) * is_rubbed,
        dry=float(random.uniform(0.02, 0.5)) * is_rubbed * bool(random.random() < 0.7),
        friction=None if random.random() < 0.6 else ("viscous", "coulomb"),
        delay=None if random.random() < 0.7 else 0.0,
        fault="angles late" if fault == "wrong kinematics" and plant not in ("puma560", "scara") else fault,
    )


@dataclass(frozen=True)
class Rig:
    """A simulated rig: its `plant`, as a tree, home, and the file of what is believed of it."""

    plant: MujocoPlant | ArmPlant
    tree: Tree
    home: Array
    believed: str | Path

    def push(self) -> None:
        """Puts it at rest, at home."""
        rest = np.zeros_like(self.home)
        if isinstance(self.plant, ArmPlant):
            self.plant.push(ArmStart(self.home, rest))
        else:
            self.plant.push(Start(rest, self.home))


def rig_of(case: Case, folder: Path, random: Generator) -> Rig:
    """The rig of a case; the file of its nominal plant is written into `folder`."""
    tilt = 0.03 if case.fault == "a tilted base" else 0.0
    if case.plant.isdigit():
        nlink = int(case.plant)
        true, nominal = random_chain(nlink, 9000 + case.number)
        hidden = {"stiffness": 1.0} if case.fault == "a spring" else {}
        links = tuple(
            link.model_copy(update={"damping": case.damping, "frictionloss": case.dry, **hidden}) for link in true
        )
        plant = MujocoPlant("rig", PlantSettings(links=links, timestep=STEP, faults=FaultSettings(tilt=tilt)))
        path = folder / "believed.toml"
        path.write_text(tomli_w.dumps({"links": [link.model_dump(exclude_none=True) for link in nominal]}))
        damping, dry = np.full(nlink, case.damping), np.full(nlink, case.dry)
        tree = replace(plant.tree, damping=damping, coulomb=dry)
        return Rig(plant, tree, np.zeros(nlink), path)
    return _arm_rig(case, random)


def _arm_rig(case: Case, random: Generator) -> Rig:
    """The rig of a case with an arm."""
    shipped = load_plant(case.plant)
    assert isinstance(shipped, ArmPlant)
    believed, n = shipped.tree, shipped.njoint
    share = random.uniform(0.75, 1.25, n)
    wrists = np.where(np.arange(n) < 3, 1.0, 0.2 if n == 6 else 1.0)  # which have less friction
    tree = replace(
        believed,
        mass=believed.mass * share,
        inertia=believed.inertia * share[:, None, None],
        rotor=believed.rotor * random.uniform(0.7, 1.3, n),
        damping=case.damping * wrists,
        coulomb=case.dry * wrists,
    )
    if case.fault == "a tilted base":
        tree = replace(tree, gravity=Rotation.from_rotvec([0.03, 0.02, 0.0]).apply(tree.gravity))
    if case.fault == "wrong kinematics":
        turns = Rotation.from_rotvec(random.normal(0.0, 0.005, (n, 3))).as_matrix()
        place = tree.position + random.normal(0.0, 0.002, (n, 3))
        tree = replace(tree, position=place, rotation=tree.rotation @ turns)
    plant = ArmPlant("rig", shipped.settings.model_copy(update={"timestep": STEP}), tree)
    return Rig(plant, tree, shipped.home, case.plant)


def log_of(case: Case, rig: Rig, random: Generator) -> pd.DataFrame:
    """What a rig logs of a motion: sums of sinusoids, which a controller follows that believes a wrong model."""
    n, every = rig.plant.njoint, round(1.0 / case.rate / STEP)
    steps = round(case.seconds / STEP) // every * every
    times = STEP * np.arange(0, steps, every, dtype=np.float64)
    reach = {"no excitation": 0.0, "little excitation": 0.003}.get(case.fault, float(random.uniform(0.3, 0.8)))
    wanted, speed, rate = _wanted(times, rig, reach, random)
    wrong = rig.tree.with_parameters(rig.tree.parameters * 1.1)
    ahead = joint_torque(wrong, wanted, speed, rate)
    coarse = max(1, round(0.05 * case.rate))
    inertia = joint_mass_matrix(wrong, wanted[::coarse])
    rest, near = np.zeros((n, n)), rig.home + 1e-4 * np.eye(n)
    weight = (joint_torque(wrong, near, rest, rest) - joint_torque(wrong, rig.home, rest[0], rest[0])).T / 1e-4
    joint, late = int(random.integers(n)), int(random.integers(2, 20))
    stuck = case.fault == "a joint sticks"
    off = 0.02 * random.standard_normal(n) if case.fault == "an encoder that is off" else np.zeros(n)
    angles, speeds, torques = np.empty((3, len(times), n))
    spring = case.fault == "a spring" and isinstance(rig.plant, ArmPlant)
    rig.push()
    sent = np.zeros((steps + every, n))
    for tick in range(len(times)):
        true, moving = rig.plant.states()
        read = true + off + case.noise * random.standard_normal(n)
        read = np.round(read / case.steps) * case.steps if case.steps else read
        fast = moving + 10.0 * case.noise * random.standard_normal(n)
        error = wanted[tick] - true
        torque = (
            ahead[tick]
            + inertia[tick // coarse] @ (STIFF**2 * error + 2.0 * STIFF * (speed[tick] - fast))
            - weight @ error
        )
        angles[tick], speeds[tick], torques[tick] = read, fast, torque
        if stuck and tick == len(times) // 2:
            rig.plant.model.dof_damping[joint] = 300.0
        begin = tick * every
        sent[begin : begin + every] = torque
        for step in range(begin, begin + every):
            acting = sent[max(step - late, 0)] if case.fault == "late torques" else torque
            if spring:
                acting = acting - 2.0 * (rig.plant.states()[0] - rig.home)
            if case.fault == "a bump" and 0.0 <= STEP * step - 0.4 * case.seconds < 0.1:
                acting = acting + np.where(np.arange(n) == joint, 8.0, 0.0)
            rig.plant.apply_torque(acting)
            rig.plant.step()
    columns = {"time": times}
    for kind, values in (("angle", angles), ("speed", speeds), ("torque", torques)):
        if kind != "speed" or case.speeds:
            columns |= {f"{kind}_{i + 1}": values[:, i] for i in range(n)}
    return pd.DataFrame(spoiled(case, columns, joint, random))


def _wanted(times: Array, rig: Rig, reach: float, random: Generator) -> tuple[Array, Array, Array]:
    """Joint coordinates, speeds and accelerations (ntime x njoint) that the controller wants."""
    n = len(rig.home)
    pulse = 2.0 * np.pi * SLOWEST * np.arange(1, HARMONICS + 1)
    sizes = random.standard_normal((2, HARMONICS, n)) / np.arange(1, HARMONICS + 1)[:, None]
    far = np.where(rig.tree.slides, 0.1, 1.0)
    sizes *= reach * far / np.abs(sizes).sum(axis=(0, 1))
    phase = times[:, None] * pulse
    begun = 1.0 - np.exp(-((times[:, None] / 0.5) ** 2))
    angle = rig.home + begun * (np.sin(phase) @ sizes[0] + (1.0 - np.cos(phase)) @ sizes[1])
    speed = np.gradient(angle, times, axis=0)
    return angle, speed, np.gradient(speed, times, axis=0)


def spoiled(case: Case, log: dict[str, Array], joint: int, random: Generator) -> dict[str, Array]:
    """The columns of a log after what happened to the file; `joint` is the one that it happened to."""
    count = len(log["time"])
    middle, rows = count // 2, np.arange(count)
    angle, torque = f"angle_{joint + 1}", f"torque_{joint + 1}"
    if case.fault == "a frozen encoder":
        log[angle][middle : middle + count // 6] = log[angle][middle]
    elif case.fault == "rows missing":
        rows = np.sort(random.choice(rows, count - count // 50, replace=False))
    elif case.fault == "a gap":
        rows = np.delete(rows, np.arange(middle, middle + count // 15))
    elif case.fault == "NaN":
        log[torque][middle] = np.nan
    elif case.fault == "time goes back":
        log["time"] = log["time"].copy()
        log["time"][middle] = log["time"][middle - 3]
    elif case.fault == "torques of a joint missing":
        del log[torque]
    elif case.fault == "torques of a joint are 0":
        log[torque] = np.zeros(count)
    elif case.fault == "a torque scale" and case.plant != "1":  # of one joint alone nothing shows it
        log[torque] = 1.1 * log[torque]
    shift = max(1, round(0.006 * case.rate)) if case.fault == "angles late" else 0
    for name in log:
        if name.startswith("angle"):
            log[name] = np.roll(log[name], shift) * (180.0 / np.pi if case.fault == "degrees" else 1.0)
    return {name: values[rows][shift:] for name, values in log.items()}
