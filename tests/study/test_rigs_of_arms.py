"""A study of an arm of three joints behind a socket, which MuJoCo moves by Runge-Kutta steps in another process."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import Finished
from rig import ROOT, Server, rig_at, serving

from metaid.errors import StudyError
from metaid.plant import ArmStart
from metaid.results import read_snapshot
from metaid.store import Store
from metaid.study import StudySpec, create_study, load_study, problem_of, run_study

ARM = ROOT / "plants" / "arms" / "spatial-three-link.xml"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Server:
    """The example rig, with the MJCF of an arm."""
    with serving(tmp_path_factory.mktemp("rig")) as serve:
        yield serve("--watchdog", "60", plant=ARM)


def spec_of(folder: Path, server: Server, **rig: object) -> StudySpec:
    """A study of that rig, with a nominal arm whose masses are wrong by up to 30 %."""
    settings = {"joints": 3, "timestep": 0.002, "step_timeout": 60.0, **rig}
    lines = [f'socket = "{server.address}"', *(f"{key} = {value}" for key, value in settings.items())]
    (folder / "rig.toml").write_text("\n".join(lines))
    shutil.copy(ARM, folder / "arm.xml")
    (folder / "nominal.toml").write_text('mjcf = "arm.xml"\nhome = { shoulder = 0.5, elbow = 1.0 }\n')
    study = folder / "arm-rig.toml"
    study.write_text('plant = "rig.toml"\ntrials = 2\n[nominal]\nplant = "nominal.toml"\nseed = 1\n')
    return load_study(study)


def test_arm_behind_a_socket_is_found(tmp_path: Path, server: Server, metaid: Callable[..., Finished]) -> None:
    """With its rotors and its friction, though what moves it shares neither code nor integrator with the twin; and what
    was found is shown as of any study.
    """
    store = Store(str(tmp_path / "arm.db"), create=True)
    run_study(store, create_study(store, spec_of(tmp_path, server)))
    snapshot = read_snapshot(store, "arm-rig")
    found = snapshot.estimate
    assert found.explains
    model = mujoco.MjModel.from_xml_path(str(ARM))
    values = dict(zip(found.estimate.searched.prior.base.names, found.estimate.values.tolist(), strict=True))
    deviations = dict(zip(values, found.deviations.tolist(), strict=True))
    for joint in range(3):
        assert values[f"damping{joint + 1}"] == pytest.approx(
            float(np.ravel(model.dof_damping)[joint]), abs=3.0 * deviations[f"damping{joint + 1}"]
        )
    assert values["rotor3"] == pytest.approx(model.dof_armature[2], abs=3.0 * deviations["rotor3"])
    assert 0.0 < deviations["rotor3"] < 0.001 * values["rotor3"]
    lever = model.body_mass[3] * model.body_ipos[3]  # the first moments of the last link
    assert values["m3z"] == pytest.approx(lever[2], rel=1e-3)
    assert problem_of(snapshot.spec).robot.truth is None
    storage = ("--storage", store.url)
    assert metaid("study", "report", "arm-rig", "-o", "rig.html", *storage).status == 0
    assert "low to high is their 95 % interval" in metaid("study", "show", "arm-rig", "--bodies", *storage).out
    assert "the torque of each joint is within" in metaid("study", "run", "arm-rig", "--until", "1%", *storage).out
    refused = metaid("study", "validate", "arm-rig", *storage)
    assert (refused.status, "is a rig, and this needs a simulated plant" in refused.err) == (2, True)


def test_rig_of_an_arm_begins_where_it_is_asked_to(server: Server) -> None:
    """At the pose and at the speeds of a start."""
    start = ArmStart(np.array([0.1, -0.2, 0.3]), np.array([1.0, -1.0, 0.5]))
    with closing(rig_at(server, joints=3)) as rig:
        rig.push(start)
        pose, speeds = rig.states()
        rig.stop()
    np.testing.assert_array_equal(pose, start.pose)
    np.testing.assert_array_equal(speeds, start.speeds)


@pytest.mark.parametrize(
    ("rig", "said"),
    [({"joints": 2}, "has 2 joints, the nominal arm 3"), ({"gravity": 9.0}, "gravity is 9.81 m/s², the rig's 9")],
)
def test_rig_that_is_no_such_arm_is_refused(tmp_path: Path, server: Server, rig: dict[str, object], said: str) -> None:
    """Before it is called."""
    with pytest.raises(StudyError, match=said):
        spec_of(tmp_path, server, **rig)
