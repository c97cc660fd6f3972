"""The files of an arm that a log has told: law, MJCF and URDF say the torque that was identified."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from swinging import log_of, swinging_arm

from metaid.models import Array
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import RecordedResult, identify_record

DAMPING, DRY = np.array([0.5, 0.3, 0.2]), np.array([0.4, 0.3, 0.2])
STATES = np.random.default_rng(0).uniform(0.3, 1.0, (2, 12, 3)) * (1.0, -1.0, 1.0)  # angles and speeds, none at rest


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> RecordedResult:
    """What the log of an arm with friction says, all of whose parameters are a tenth more than the shipped one's."""
    arm = swinging_arm()
    record = log_of(
        arm.with_parameters(1.1 * arm.parameters),
        extra=lambda speeds: DAMPING * speeds + DRY * np.sign(speeds),
        seconds=4.0,
    )
    columns = {"time": record.times}
    for kind, values in (("angle", record.angles), ("torque", record.torques)):
        columns |= {f"{kind}_{joint + 1}": values[:, joint] for joint in range(record.njoint)}
    path = tmp_path_factory.mktemp("arm") / "log.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return identify_record(path, "spatial-three-link", friction=["viscous", "coulomb"])


def told(found: RecordedResult, angles: Array, speeds: Array, accelerations: Array | None = None) -> Array:
    """The torque (... x njoint) that was identified; what is not determined keeps its nominal value."""
    table = found.verdict.lumps
    values = table["identified"].fillna(table["nominal"]).fillna(0.0).to_numpy()
    rest = np.zeros_like(angles) if accelerations is None else accelerations
    return np.asarray(found.estimate.model.regressor(angles, speeds, rest) @ values)


def test_nearly_all_of_an_exact_log_is_determined(found: RecordedResult) -> None:
    """So the files are what was identified."""
    assert found.verdict.is_found
    assert found.verdict.lumps["determined"].mean() > 0.9


def test_law_of_an_arm_is_the_torque_that_was_identified(found: RecordedResult) -> None:
    """In Python, friction included."""
    names: dict[str, object] = {}
    exec(found.model.text(".py"), names)
    law = names["torque"]
    assert callable(law)
    for angles, speeds in zip(*STATES, strict=True):
        np.testing.assert_allclose(law(angles.tolist(), speeds.tolist()), told(found, angles, speeds), atol=1e-9)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_law_of_an_arm_in_c_is_the_torque_that_was_identified(found: RecordedResult, tmp_path: Path) -> None:
    """In C, friction included."""
    found.model.write(tmp_path / "law.h")
    calls = []
    for angles, speeds in zip(*STATES, strict=True):
        q, qd = (", ".join(map(repr, each.tolist())) for each in (angles, speeds))
        calls.append(f"{{ const double q[] = {{{q}}}, qd[] = {{{qd}}}; double t[3]; log_csv_torque(q, qd, t);")
        calls.append('for (int i = 0; i < 3; i++) printf("%.17g\\n", t[i]); }')
    body = "\n".join(["#include <stdio.h>", '#include "law.h"', "int main(void) {", *calls, "return 0; }"])
    (tmp_path / "main.c").write_text(body, encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-O0", "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True)
    torques = np.array(done.stdout.split(), dtype=np.float64).reshape(-1, 3)
    np.testing.assert_allclose(torques, told(found, *STATES), atol=1e-9)


def test_bias_force_of_the_mjcf_is_the_torque_that_was_identified(found: RecordedResult) -> None:
    """MuJoCo's own, which is that of the bodies without friction; with it once MuJoCo's damping is added."""
    model = mujoco.MjModel.from_xml_string(found.model.text(".xml"))
    data = mujoco.MjData(model)
    table = found.verdict.lumps.set_index("name")["identified"]
    dry = table[["coulomb1", "coulomb2", "coulomb3"]].to_numpy()
    for angles, speeds in zip(*STATES, strict=True):
        data.qpos[:], data.qvel[:] = angles, speeds
        mujoco.mj_forward(model, data)
        rubbed = model.dof_damping * speeds + dry * np.sign(speeds)
        np.testing.assert_allclose(data.qfrc_bias + rubbed, told(found, angles, speeds), atol=1e-6)
    np.testing.assert_allclose(model.dof_frictionloss, dry, rtol=1e-6)


@pytest.mark.parametrize("suffix", [".xml", ".urdf"])
def test_file_of_an_arm_is_a_plant_with_the_torque_that_was_identified(
    found: RecordedResult, tmp_path: Path, suffix: str
) -> None:
    """At any state and acceleration; a URDF has no rotors, which are told to its plant."""
    path = tmp_path / f"arm{suffix}"
    found.model.write(path)
    plant = load_plant(path)
    assert isinstance(plant, ArmPlant)
    tree = plant.tree
    if suffix == ".urdf":
        tree = replace(tree, rotor=found.model.tree.rotor)
    accelerations = np.random.default_rng(1).uniform(-3.0, 3.0, STATES[0].shape)
    np.testing.assert_allclose(
        joint_torque(tree, *STATES, accelerations), told(found, *STATES, accelerations), atol=1e-5
    )
