"""The motion to record: it keeps its limits, is better than random ones, and a log of it shows what was promised."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from conftest import Finished, wrong_chain

from metaid.errors import PlantError
from metaid.excitation import Excitation, LogNoise, best_of_random, excite, problem_of, recorded, write_motion
from metaid.models import Array
from metaid.plant import load_chain, load_plant
from metaid.recorded import Choices, equations_like, estimate_records

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
FINE = np.arange(0.0, 8.0, 0.001)  # s
FRICTION = ("viscous", "coulomb")
LIMITS = "speed = 3.0\nacceleration = 15.0\ntorque = 4.0\n"
# An arm of three hinges that can hit its own base and the floor.
ARM = """
<mujoco><compiler angle="radian"/>
  <worldbody><geom type="plane" size="2 2 0.1"/>
    <body name="base"><geom type="cylinder" size="0.08 0.2" pos="0 0 0.2"/>
      <body name="turret" pos="0 0 0.45"><joint name="pan" axis="0 0 1" range="-3 3" limited="true"/>
        <geom type="sphere" size="0.03" mass="2"/>
        <body name="upper"><joint name="lift" axis="0 1 0" range="-3 3" limited="true" damping="0.5"/>
          <geom type="capsule" fromto="0 0 0.08 0 0 0.35" size="0.04" mass="3"/>
          <body name="fore" pos="0 0 0.4"><joint name="bend" axis="0 1 0" range="-3 3" limited="true"/>
            <geom type="capsule" fromto="0 0 0.08 0.05 0 0.35" size="0.03" mass="2"/></body></body></body></body>
  </worldbody>
  <actuator><motor joint="pan" forcerange="-20 20" forcelimited="true"/>
    <motor joint="lift" forcerange="-40 40" forcelimited="true"/>
    <motor joint="bend" forcerange="-15 15" forcelimited="true"/></actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Excitation:
    """A motion of two links whose motors are weak."""
    limits = tmp_path_factory.mktemp("limits") / "limits.toml"
    limits.write_text(LIMITS)
    return excite("two-link", seconds=16.0, limits=limits)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Excitation, Path]:
    """A motion of an arm that can hit itself and the floor, and its file."""
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM)
    with pytest.MonkeyPatch.context() as patch:
        # What is promised of the arm no test reads.
        patch.setattr("metaid.excitation.forecast.REHEARSED", 4)
        return excite(path, seconds=16.0), path


def assert_kept(found: Excitation) -> None:
    """All limits at every millisecond, and rest at both ends."""
    motion, limits = found.at(FINE), found.limits
    assert ((motion.angles >= limits.low) & (motion.angles <= limits.high)).all()
    assert (np.abs(motion.speeds) <= limits.speed).all()
    assert (np.abs(motion.accelerations) <= limits.acceleration).all()
    assert (np.abs(found.nominal_torques(FINE)) <= limits.torque).all()
    ends = found.at(np.array([0.0, found.seconds]))
    np.testing.assert_allclose([ends.speeds, ends.accelerations], 0.0, atol=1e-9)
    np.testing.assert_allclose(ends.angles[1], ends.angles[0], atol=1e-9)


def test_weak_motors_hold_the_pendulum_that_they_move(pendulum: Excitation) -> None:
    """Position, speed, acceleration and nominal torque keep their limits, and the motion begins and ends at rest."""
    assert_kept(pendulum)
    assert np.abs(pendulum.nominal_torques(FINE)).max() > 2.0  # of 4 N m: the limit is what it moves by


def test_arm_touches_neither_itself_nor_the_floor(arm: tuple[Excitation, Path]) -> None:
    """MuJoCo finds no contact at any millisecond."""
    found, path = arm
    assert_kept(found)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for pose in found.at(FINE).angles:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        assert data.ncon == 0


def test_determinant_is_no_less_than_that_of_500_random_series(
    pendulum: Excitation, arm: tuple[Excitation, Path]
) -> None:
    """Which keep the same limits."""
    for found in (pendulum, arm[0]):
        _, random = best_of_random(found.problem, found.criterion, 4242)
        assert found.criterion.value(found.series) >= found.criterion.value(random)


def test_promised_deviations_hold_for_robots_that_are_30_percent_off(pendulum: Excitation) -> None:
    """Of logs of ten wrong chains the errors are what was promised, within a factor of 1.5, and intervals cover."""
    model, chain, noise = pendulum.problem.model, load_chain("two-link").chain, LogNoise()
    errors, covered = [], []
    found = None
    for seed in range(10):
        true = wrong_chain(chain, seed)
        friction = np.random.default_rng(seed).uniform(0.02, 0.2, 4)
        values = np.concatenate([true.lumps_of(("gravity", "coriolis", "inertia")).vector, [0.01], friction])

        def torques(angles: Array, speeds: Array, accelerations: Array, values: Array = values) -> Array:
            return np.asarray(model.regressor(angles, speeds, accelerations) @ values)

        (log,) = recorded(torques, pendulum.series, pendulum.seconds, noise, [100 + seed])
        found = found or estimate_records(
            [log], model, Choices(friction=("viscous", "coulomb"), zeros=False, delay=0.0)
        )
        equations = equations_like(found, log)
        told = equations.solution.values
        errors.append(told - values)
        covered.append(np.abs(told - values) < 1.96 * np.sqrt(np.diag(equations.covariance(told))))
    shares = np.sqrt(np.mean(np.square(errors), axis=0)) / pendulum.forecast.deviations
    assert np.median(shares) < 1.5
    assert np.median(shares) > 1.0 / 1.5
    assert np.mean(covered) > 0.9


def test_of_windows_that_predict_alike_the_finest_are_taken(arm: tuple[Excitation, Path]) -> None:
    """A torque that no model explains hides what long windows lose of friction, and the error of what is left out does
    not show it.
    """
    found, _ = arm
    model, nominal = found.problem.model, found.problem.nominal

    def torques(angles: Array, speeds: Array, accelerations: Array) -> Array:
        return np.asarray(model.regressor(angles, speeds, accelerations) @ nominal)

    random = np.random.default_rng(9)
    rows = model.regressor(*(random.uniform(-most, most, (500, 3)) for most in (1.5, 2.0, 8.0)))
    spans = []
    for seed in range(4):
        (log,) = recorded(torques, found.series, found.seconds, LogNoise(), [seed])
        told = estimate_records([log], model, Choices(friction=FRICTION, zeros=False, delay=0.0))
        spans.append(told.equations.span)
        assert np.linalg.norm(rows @ (told.values - nominal)) < 0.008 * np.linalg.norm(rows @ nominal)
    assert np.median(spans) <= 0.1


def test_files_hold_the_motion(arm: tuple[Excitation, Path], tmp_path: Path) -> None:
    """The CSV has what the series is; the YAML has the same points, by the joints' names and with times."""
    found, _ = arm
    for name in ("motion.csv", "motion.yaml"):
        write_motion(found, tmp_path / name, rate=50.0)
    frame = pd.read_csv(tmp_path / "motion.csv")
    motion = found.at(frame["time"].to_numpy())
    assert frame["time"].iloc[-1] == found.seconds
    np.testing.assert_allclose(frame[["angle_pan", "angle_lift", "angle_bend"]], motion.angles, atol=1e-5)
    np.testing.assert_allclose(frame["speed_lift"], motion.speeds[:, 1], atol=1e-5)
    lines = (tmp_path / "motion.yaml").read_text().splitlines()
    assert 'joint_names: ["pan", "lift", "bend"]' in lines
    points = [json.loads(line.partition(": ")[2]) for line in lines if line.startswith("- positions")]
    np.testing.assert_allclose(points, motion.angles, atol=1e-5)
    assert lines[-1] == "  time_from_start: {sec: 16, nanosec: 0}"


def test_payload_tells_the_gains_of_drives_that_carry_it(arm: tuple[Excitation, Path]) -> None:
    """Those of the joints that gravity loads are told well, for they carry it."""
    assert arm[0].payload is not None
    _, gains = arm[0].payload
    assert gains[1] < 0.1


@pytest.mark.parametrize(
    ("given", "limits", "why"),
    [
        (["nowhere"], None, "unknown plant 'nowhere'"),
        (["two-link", "--seconds", "1"], None, "allowed: 4 to 600 s"),
        (["two-link", "--noise", "speed=1"], None, "unknown key 'speed' (allowed: angle, torque)"),
        (["two-link", "-o", "motion.txt"], None, "allowed: .csv, .yaml"),
        (["two-link"], "torque = 0.001", "joint 1 needs more torque than it has"),
        (["two-link"], "torque = {2 = 0}", "joint 2 has no motor, torque 0: no motion can be asked of it (allowed: "),
        (["two-link"], "speed = {elbow = 1.0}", "unknown joint 'elbow' (allowed: 1, 2)"),
        (["two-link"], "low = 1.0\nhigh = 0.5", "allowed: low below high"),
        (["two-link"], "speeds = 1.0", "unknown key 'speeds'"),
    ],
)
def test_wrong_request_is_refused_in_one_line(metaid: Metaid, given: list[str], limits: str | None, why: str) -> None:
    """It says what is allowed, and nothing is written."""
    if limits is not None:
        Path("limits.toml").write_text(limits)
        given = [*given, "--limits", "limits.toml"]
    told = metaid("excite", *given)
    assert told.status == 2
    assert why in told.err
    assert len(told.err.splitlines()) == 1
    assert not list(Path().glob("motion*"))


def test_arm_that_cannot_be_clear_is_refused(arm: tuple[Excitation, Path]) -> None:
    """It says what is met."""
    found, path = arm
    problem = problem_of(load_plant(path), replace(found.limits, floor=0.87), found.series.period)
    with pytest.raises(PlantError, match=r"a shape comes within 0\.02 m of the floor"):
        best_of_random(problem, found.criterion, 1, 40)
