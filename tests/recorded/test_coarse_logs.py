"""Logs of few readings a second, whose torques act a reading late: of a disk on a shaft, which MuJoCo moves."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

import metaid

RATE, STEPS = 40.0, 25  # Hz, and steps of the simulation from one reading to the next
PERIOD = 1.0 / RATE  # s
DISK = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body>
<joint name="shaft" axis="0 1 0" damping="{damping}" frictionloss="{dry}"/>
<inertial mass="{mass}" pos="0 0 -0.05" diaginertia="0.0108 0.0108 0.0108"/></body></worldbody>
<actuator><motor joint="shaft"/></actuator></mujoco>"""
MASS, DAMPING, OFFSET = 9.5, 0.04, 0.08  # kg, N m s, N m
INERTIA = 0.0108 + MASS * 0.05**2  # kg m²


def log_of(seconds: float, dry: float, offset: float, seed: int) -> pd.DataFrame:
    """Angles with 1 mrad of noise, and the torques that are sent, which act from the next reading on."""
    model = mujoco.MjModel.from_xml_string(DISK.format(mass=MASS, damping=DAMPING, dry=dry))
    data, random = mujoco.MjData(model), np.random.default_rng(seed)
    sent, rows = 0.0, []
    for _ in range(round(seconds * RATE)):
        before, sent = sent, float(np.clip(0.85 * sent + 0.5 * random.standard_normal(), -3.0, 3.0))
        rows.append([*(data.qpos + 1e-3 * random.standard_normal()), sent])
        for _ in range(STEPS):
            data.ctrl[:] = before - offset
            mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["th", "u"])


@pytest.fixture
def nominal(tmp_path: Path) -> Path:
    path = tmp_path / "disk.xml"
    path.write_text(DISK.format(mass=7.0, damping=0.0, dry=0.0))
    return path


def test_delay_and_inertia_are_not_those_of_windows_whose_readings_lie_to_one_side(nominal: Path) -> None:
    """Of ten readings in a window: a delay that is off by a thirteenth of a reading, and an inertia by a hundredth."""
    log = log_of(30.0, dry=0.0, offset=0.0, seed=0)
    found = metaid.estimate(log, nominal, rate=RATE, friction=("viscous", "coulomb"))
    values = found.verdict.lumps.set_index("name")["identified"]
    assert found.summary["delay"] == pytest.approx(PERIOD, abs=PERIOD / 80)
    assert values["yy1"] == pytest.approx(INERTIA, rel=0.008)


def test_simulations_are_under_the_torques_that_were_held_from_reading_to_reading(nominal: Path) -> None:
    """Not under their means with those before and after: what is left is little more than the noise of the angles."""
    log = log_of(30.0, dry=0.0, offset=0.0, seed=0)
    found = metaid.estimate(log, nominal, rate=RATE, friction=("viscous", "coulomb"), delay=PERIOD)
    assert found.summary["held_out"]["motion"]["angle"][0] < 4e-3


def test_friction_that_was_chosen_before_a_delay_was_known_is_chosen_anew(nominal: Path) -> None:
    """A torque of 25 ms ago looks like hysteresis, and hides the one that is always there."""
    found = metaid.estimate(log_of(40.0, dry=0.22, offset=OFFSET, seed=2), nominal, rate=RATE)
    assert found.summary["friction"]["terms"] == ["viscous", "coulomb", "offset"]
    assert found.verdict.is_found
