"""The identified model as files: they load elsewhere and move as what was identified."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from conftest import Finished, random_plant, wrong_chain
from exported import FULL, model_of
from random_arm import SOME, arm_named, wrong_tree

from metaid.exporting import IdentifiedModel, arm_dynamics, chain_dynamics
from metaid.models import Array, ChainModel
from metaid.models.law import sliding
from metaid.models.tree import ArmPrior, Tree, joint_mass_matrix, joint_torque
from metaid.plant import ArmSettings
from metaid.plant.description import read_arm

TOLERANCE = 1e-9

Metaid = Callable[..., Finished]


@dataclass(frozen=True)
class Identified:
    """A model to be written, and what it is to do: its torque less friction, its mass matrix, its friction."""

    model: IdentifiedModel
    bias: Callable[[Array, Array], Array]
    mass_matrix: Callable[[Array], Array]
    damping: Array
    coulomb: Array

    @property
    def njoint(self) -> int:
        return len(self.damping)

    def torque(self, angles: Array, speeds: Array) -> Array:
        """That of the law."""
        torque: Array = self.bias(angles, speeds) + self.damping * speeds + self.coulomb * sliding(speeds)
        return torque


def chain_of(nlink: int) -> Identified:
    """A random chain with friction, its lumps as they are."""
    random = np.random.default_rng(nlink)
    damping, coulomb = random.uniform(0.05, 0.2, (2, nlink))
    chain = replace(random_plant(nlink).chain, damping=damping, coulomb=coulomb)
    lumps, count = chain.lumps_of((*FULL, "damping", "coulomb")), len(chain.lumps_of(FULL).vector)
    known = np.ones(count, dtype=np.bool_)
    dynamics = chain_dynamics(lumps, 9.81, wrong_chain(chain, nlink), known)
    ideal = ChainModel(chain.lumps_of(FULL), 9.81)
    return Identified(model_of(dynamics, f"chain {nlink}"), ideal.torque, ideal.mass_matrix, damping, coulomb)


def arm_of(name: str, true: Tree) -> Identified:
    """An arm, its base parameters as they are."""
    prior = ArmPrior(wrong_tree(true, 0))
    dynamics = arm_dynamics(prior, prior.base.of(true.parameters))
    ideal = replace(true, damping=np.zeros(true.njoint), coulomb=np.zeros(true.njoint))

    def bias(angles: Array, speeds: Array) -> Array:
        return joint_torque(ideal, angles, speeds, np.zeros(true.njoint))

    def mass_matrix(angles: Array) -> Array:
        return joint_mass_matrix(ideal, angles)

    model = model_of(dynamics, name, tuple(true.gravity.tolist()))
    return Identified(model, bias, mass_matrix, true.damping, true.coulomb)


CHAINS = {f"chain-{nlink}": nlink for nlink in range(1, 6)}
MODELS = (*CHAINS, *SOME)


@cache
def identified_as(name: str) -> Identified:
    """One of MODELS."""
    return chain_of(CHAINS[name]) if name in CHAINS else arm_of(name, arm_named(name))


def states_of(identified: Identified, count: int = 5) -> Array:
    """Joint coordinates and speeds (count x 2 x njoint); a few speeds are slow."""
    states = np.random.default_rng(0).uniform(-2.0, 2.0, (count, 2, identified.njoint))
    states[0, 1] *= 0.01
    return states


def assert_moves_as(identified: Identified, model: mujoco.MjModel, lacks: Array, gravity: Array | None = None) -> None:
    """MuJoCo's bias force, mass matrix and friction are those that were identified; of rotors it `lacks` some."""
    assert model.nv == identified.njoint
    if gravity is not None:
        model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    for angles, speeds in states_of(identified):
        data.qpos[:], data.qvel[:] = angles, speeds
        mujoco.mj_forward(model, data)
        wanted, matrix = identified.bias(angles, speeds), np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, matrix)
        assert np.abs(data.qfrc_bias - wanted).max() <= TOLERANCE * np.abs(wanted).max()
        full = identified.mass_matrix(angles)
        assert np.abs(matrix + np.diag(lacks) - full).max() <= TOLERANCE * np.abs(full).max()
        assert data.qfrc_passive == pytest.approx(-identified.damping * speeds)
    assert model.dof_frictionloss == pytest.approx(identified.coulomb)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_mjcf_moves_as_what_was_identified(tmp_path: Path, name: str) -> None:
    """MuJoCo loads it as it is, ranges of the joints included."""
    identified = identified_as(name)
    identified.model.write(tmp_path / "model.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert_moves_as(identified, model, np.zeros(identified.njoint))
    tree = identified.model.tree
    assert model.jnt_limited.tolist() == np.isfinite(tree.low).tolist()
    assert model.jnt_range[np.isfinite(tree.low)] == pytest.approx(
        np.stack([tree.low, tree.high], axis=1)[np.isfinite(tree.low)]
    )


@pytest.mark.parametrize("name", MODELS)
def test_urdf_moves_as_what_was_identified(tmp_path: Path, name: str) -> None:
    """But for rotors, which a URDF has not; the file names them, and gravity where it is not the usual one."""
    identified = identified_as(name)
    path = tmp_path / "model.urdf"
    identified.model.write(path)
    tree = identified.model.tree
    assert_moves_as(identified, mujoco.MjModel.from_xml_path(str(path)), tree.rotor, tree.gravity)
    comment = path.read_text(encoding="utf-8").partition("-->")[0]
    for joint, rotor in zip(tree.names, tree.rotor.tolist(), strict=True):
        assert (f"{joint} {rotor:.6g} kg" in comment) == (rotor > 0.0)
    assert ("gravity; it is" in comment) == (tree.gravity.tolist() != [0.0, 0.0, -9.81])


@pytest.mark.robots
@pytest.mark.parametrize("name", MODELS)
def test_pinocchio_moves_the_urdf_alike(tmp_path: Path, name: str) -> None:
    """Where pinocchio is installed."""
    pinocchio = pytest.importorskip("pinocchio", reason="`make robots` installs pinocchio")
    identified = identified_as(name)
    identified.model.write(tmp_path / "model.urdf")
    model, tree = pinocchio.buildModelFromUrdf(str(tmp_path / "model.urdf")), identified.model.tree
    model.gravity.linear = tree.gravity
    data = model.createData()
    for angles, speeds in states_of(identified):
        pairs = zip(angles, model.joints[1:], strict=True)
        q = np.concatenate([[each] if joint.nq == 1 else [math.cos(each), math.sin(each)] for each, joint in pairs])
        wanted, full = identified.bias(angles, speeds), identified.mass_matrix(angles)
        bias = pinocchio.nonLinearEffects(model, data, q, speeds)
        assert np.abs(bias - wanted).max() <= TOLERANCE * np.abs(wanted).max()
        upper = np.triu(pinocchio.crba(model, data, q))
        matrix = upper + np.triu(upper, 1).T + np.diag(tree.rotor)
        assert np.abs(matrix - full).max() <= TOLERANCE * np.abs(full).max()


def test_plant_reads_the_files_of_an_arm_as_the_same_arm(tmp_path: Path) -> None:
    """MJCF and URDF are plants again, with the same names, ranges, links and friction."""
    tree = identified_as("four").model.tree
    for suffix in (".xml", ".urdf"):
        identified_as("four").model.write(tmp_path / f"arm{suffix}")
        kind = "mjcf" if suffix == ".xml" else "urdf"
        read = read_arm(ArmSettings.model_validate({kind: str(tmp_path / f"arm{suffix}")}), "arm.toml").tree
        assert read.names == tree.names
        assert read.low == pytest.approx(tree.low)
        links = slice(None) if suffix == ".xml" else [*range(10), 11, 12]
        assert read.parameters[:, links] == pytest.approx(tree.parameters[:, links], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_law_in_python_gives_the_same_torque(name: str) -> None:
    """Its function takes lists and needs nothing but a sine."""
    identified = identified_as(name)
    names: dict[str, Any] = {}
    exec(identified.model.text(".py"), names)
    for angles, speeds in states_of(identified):
        wanted = identified.torque(angles, speeds)
        assert names["torque"](angles.tolist(), speeds.tolist()) == pytest.approx(
            wanted, rel=TOLERANCE, abs=TOLERANCE * np.abs(wanted).max()
        )


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_law_in_c_gives_the_same_torque(tmp_path: Path) -> None:
    """All headers in one C99 program, without a warning."""
    source = ["#include <stdio.h>"]
    calls, wanted = [], []
    for name in MODELS:
        identified = identified_as(name)
        identified.model.write(tmp_path / f"{name}.h")
        source.append(f'#include "{name}.h"')
        for angles, speeds in states_of(identified):
            q, qd = (", ".join(map(repr, each.tolist())) for each in (angles, speeds))
            function = identified.model.name.replace(" ", "_")
            calls.append(f"{{ const double q[] = {{{q}}}, qd[] = {{{qd}}}; double t[{identified.njoint}];")
            calls.append(f"{function}_torque(q, qd, t);")
            calls.append(f'for (int i = 0; i < {identified.njoint}; i++) printf("%.17g\\n", t[i]); }}')
            wanted.append(identified.torque(angles, speeds))
    body = "\n".join([*source, "int main(void) {", *calls, "return 0; }"])
    (tmp_path / "main.c").write_text(body, encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O0"]
    subprocess.run(["cc", *flags, "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True)
    torques = np.array(done.stdout.split(), dtype=np.float64)
    first = 0
    for each in wanted:
        mine, first = torques[first : first + len(each)], first + len(each)
        assert np.abs(mine - each).max() <= TOLERANCE * np.abs(each).max()
    assert first == len(torques)


EXACT = 1e-12


@pytest.mark.parametrize("name", CHAINS)
def test_model_of_a_chain_is_the_same_in_mujoco_python_and_c(tmp_path: Path, name: str) -> None:
    """Torque and mass matrix to 1e-12 of the largest: the object, MJCF, `law.py` and `law.h`."""
    identified = identified_as(name)
    model, names = identified.model, dict[str, Any]()
    exec(model.text(".py"), names)
    simulated = mujoco.MjModel.from_xml_string(model.text(".xml"))
    data, states = mujoco.MjData(simulated), states_of(identified)
    compiled = in_c(tmp_path, identified, states) if shutil.which("cc") else None
    for i, (angles, speeds) in enumerate(states):
        torque, matrix = model.torque(angles, speeds), model.mass_matrix(angles)
        data.qpos[:], data.qvel[:] = angles, speeds
        mujoco.mj_forward(simulated, data)
        full = np.zeros_like(matrix)
        mujoco.mj_fullM(simulated, data, full)
        rubbing = identified.damping * speeds + identified.coulomb * sliding(speeds)
        pairs = [(data.qfrc_bias + rubbing, full), (names["torque"](angles, speeds), names["mass_matrix"](angles))]
        for other_torque, other_matrix in [*pairs, *([compiled[i]] if compiled else [])]:
            assert np.abs(other_torque - torque).max() <= EXACT * np.abs(torque).max()
            assert np.abs(np.array(other_matrix) - matrix).max() <= EXACT * np.abs(matrix).max()


def in_c(folder: Path, identified: Identified, states: Array) -> list[tuple[Array, Array]]:
    """Torque and mass matrix in each of `states` by the header, compiled."""
    n, function = identified.njoint, identified.model.name.replace(" ", "_")
    identified.model.write(folder / "law.h")
    calls = []
    for angles, speeds in states:
        q, qd = (", ".join(map(repr, each.tolist())) for each in (angles, speeds))
        calls.append(f"{{ const double q[] = {{{q}}}, qd[] = {{{qd}}}; double t[{n}], m[{n}][{n}];")
        calls.append(f"{function}_torque(q, qd, t); {function}_mass_matrix(q, m);")
        calls.append(f'for (int i = 0; i < {n}; i++) printf("%.17g\\n", t[i]);')
        calls.append(f'for (int i = 0; i < {n * n}; i++) printf("%.17g\\n", m[i / {n}][i % {n}]); }}')
    body = "\n".join(["#include <stdio.h>", '#include "law.h"', "int main(void) {", *calls, "return 0; }"])
    (folder / "main.c").write_text(body, encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O0"]
    subprocess.run(["cc", *flags, "main.c", "-o", "main", "-lm"], cwd=folder, check=True)
    done = subprocess.run([str(folder / "main")], capture_output=True, text=True, check=True)
    numbers = np.array(done.stdout.split(), dtype=np.float64).reshape(len(states), n + n * n)
    return [(row[:n], row[n:].reshape(n, n)) for row in numbers]


@pytest.mark.parametrize("name", SOME[:2])
def test_model_of_an_arm_gives_torque_and_mass_matrix(tmp_path: Path, name: str) -> None:
    """Those of what was identified, friction and rotors included: the object, `law.py` and `law.h`."""
    identified = identified_as(name)
    model, names, states = identified.model, dict[str, Any](), states_of(identified)
    exec(model.text(".py"), names)
    compiled = in_c(tmp_path, identified, states) if shutil.which("cc") else None
    for i, (angles, speeds) in enumerate(states):
        wanted, full = identified.torque(angles, speeds), identified.mass_matrix(angles)
        pairs = [(model.torque(angles, speeds), model.mass_matrix(angles))]
        pairs.append((names["torque"](angles, speeds), names["mass_matrix"](angles)))
        for torque, matrix in [*pairs, *([compiled[i]] if compiled else [])]:
            assert np.abs(torque - wanted).max() <= TOLERANCE * np.abs(wanted).max()
            assert np.abs(np.array(matrix) - full).max() <= TOLERANCE * np.abs(full).max()


def test_model_wants_a_number_for_each_joint() -> None:
    """Else one line says how many there are to be."""
    from metaid.errors import StudyError

    model = identified_as("chain-2").model
    with pytest.raises(StudyError, match=r"q has the shape \(3,\) \(allowed: 2 numbers, one a joint\)"):
        model.torque([0.0, 0.0, 0.0], [0.0, 0.0])
    with pytest.raises(StudyError, match=r"q \(3, 2\), v \(4, 2\) \(allowed: as many states of each\)"):
        model.torque(np.zeros((3, 2)), np.zeros((4, 2)))


@pytest.mark.parametrize("name", ["chain-2", SOME[0]])
def test_model_answers_for_many_states_at_once(name: str) -> None:
    """As for each alone; what is one state goes with all of many, and no states are answered with none."""
    identified = identified_as(name)
    model = identified.model
    poses, speeds = (np.array(each) for each in zip(*states_of(identified), strict=True))
    torques, still = model.torque(poses, speeds), np.zeros(model.njoint)
    assert torques == pytest.approx(np.array([model.torque(*each) for each in zip(poses, speeds, strict=True)]))
    assert model.torque(still, speeds) == pytest.approx(model.torque(np.zeros_like(speeds), speeds))
    assert model.inverse_dynamics(poses, still, still) == pytest.approx(model.torque(poses, still))
    assert model.mass_matrix(poses)[1] == pytest.approx(model.mass_matrix(poses[1]))
    assert model.torque(poses[:0], speeds[:0]).shape == (0, model.njoint)


def test_name_of_a_study_cannot_break_a_file() -> None:
    """Ends of comments, of strings and of lines in it are no ends."""
    name = '1 */ --> """ \\\n' + "\x1b[31m ö # ]]>"
    model = replace(identified_as("chain-2").model, name=name)
    names: dict[str, Any] = {}
    exec(model.text(".py"), names)
    assert len(names["torque"]([0.1, 0.2], [0.0, 0.0])) == 2
    assert mujoco.MjModel.from_xml_string(model.text(".xml")).nv == 2
    assert mujoco.MjModel.from_xml_string(model.text(".urdf")).nv == 2
    text = model.text(".h")
    assert text.count("*/") == text.count("/*")
    assert "static inline void study_1_31m_torque(" in text
    assert json.loads(model.text(".json"))["name"] == name


def test_lumps_that_are_not_determined_are_named() -> None:
    """In what a command prints and at the top of every file, with the reasons of the verdict; no nominal value is."""
    model = identified_as("chain-2").model
    about = {**model.about, "reasons": ["inertia_2 is not determined: these trials do not know it to a tenth"]}
    model = replace(model, about=about)
    assert model.notes(".h") == about["reasons"]
    for suffix in (".toml", ".xml", ".urdf", ".py", ".h"):
        assert "inertia_2 is not determined: these trials do not know it to a tenth." in model.text(suffix)


def test_model_without_possible_bodies_has_its_law() -> None:
    """Plant file, MJCF and URDF are refused, the law is as it was identified."""
    from metaid.errors import StudyError

    identified = identified_as("chain-2")
    model = replace(identified.model, dynamics=replace(identified.model.dynamics, tree=None, chain=None))
    for suffix in (".toml", ".xml", ".urdf"):
        with pytest.raises(StudyError, match=r"no possible bodies have the lumps .* \(allowed: \.py, \.h, \.json\)"):
            model.text(suffix)
    assert model.text(".py") == identified.model.text(".py")
    with pytest.raises(StudyError, match=r"whose plant file names an MJCF or a URDF \(allowed: \.xml, \.urdf, \.py"):
        identified_as("four").model.text(".toml")
