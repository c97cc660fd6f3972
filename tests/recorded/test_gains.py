"""Logs of an arm in units of motor currents, without and with a known weight on its last link."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from conftest import Finished
from random_arm import wrong_tree
from swinging import log_of, swinging_arm

from metaid.errors import RecordError
from metaid.models.tree import PARAMETERS, Tree
from metaid.recorded import (
    Choices,
    Gains,
    LogRun,
    Payload,
    RecordedResult,
    arm_model,
    drive_gains,
    estimate,
    estimate_records,
)
from metaid.recorded.weak_form.smoothed import smoothed
from metaid.show import render_log

GAINS = np.array([12.0, -9.0, 7.0])  # N m for a unit of the log: the second motor is mounted the other way round
MASS, CENTRE = 2.0, np.array([0.05, 0.1, -0.15])
FRICTION = ("viscous", "coulomb")
DRY = np.array([0.8, 0.6, 0.3])


def loaded(tree: Tree, mass: float = MASS) -> Tree:
    """An arm with a payload of this mass, which has an extent."""
    parameters = tree.parameters.copy()
    inertia = mass * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE) + 0.003 * np.eye(3))
    parameters[-1, :10] += np.concatenate([[mass], mass * CENTRE, inertia[np.triu_indices(3)]])
    return tree.with_parameters(parameters)


def record_of(tree: Tree, rubs: float = 1.0) -> LogRun:
    """A log in currents, with dry friction."""
    record = log_of(tree, noise=2e-5, extra=lambda speeds: rubs * DRY * np.tanh(speeds / 0.05), seconds=8.0)
    noise = 0.1 * np.random.default_rng(2).standard_normal(record.torques.shape)
    return record.with_torques((record.torques + noise) / GAINS)


def gains_of(payload: Payload, arm: Tree | None = None) -> Gains:
    """What logs of an arm say whose friction is another with the payload."""
    arm = arm or swinging_arm()
    free, load = record_of(arm), record_of(loaded(arm), rubs=1.3)
    return drive_gains([smoothed(free)], [(smoothed(load), payload)], arm_model(wrong_tree(arm, 0)))


def table(record: LogRun) -> pd.DataFrame:
    columns = {"time": record.times}
    for kind, values in (("angle", record.angles), ("torque", record.torques)):
        columns |= {f"{kind}_{joint + 1}": values[:, joint] for joint in range(record.njoint)}
    return pd.DataFrame(columns)


def test_known_weight_tells_gains_with_their_signs() -> None:
    """Each is within three deviations of the true one, wherever the weight is and whatever the nominal masses are."""
    found = gains_of(Payload("load", MASS))
    assert found.is_told[:2].all()
    off = (GAINS / found.values - 1.0)[found.is_told] / found.relative[found.is_told]
    assert (np.abs(off) < 3.0).all()


def test_place_of_the_weight_tells_more() -> None:
    """Where its centre is said, no joint is known worse, and the last one far better."""
    free, said = gains_of(Payload("load", MASS)), gains_of(Payload("load", MASS, tuple(CENTRE)))
    assert said.relative[2] < 0.3 * free.relative[2]
    np.testing.assert_allclose(said.values, GAINS, rtol=0.05)


def test_joint_that_no_weight_loads_is_not_told() -> None:
    """A weight that may be on the last axis says nothing of the last gain, which is given the others', to a half."""
    found = gains_of(Payload("load", MASS))
    assert found.is_told.tolist() == [True, True, False]
    assert 0.3 < found.relative[2] < 0.7
    assert np.abs(GAINS[:2]).min() * 0.6 < abs(found.values[2]) < np.abs(GAINS[:2]).max() * 1.4
    assert f"and not those of {found.joints[2]}" in found.text


def test_payload_that_hardly_weighs_anything_is_refused() -> None:
    """The joint that it tells best is named."""
    arm = swinging_arm()
    free, load = smoothed(record_of(arm)), smoothed(record_of(loaded(arm, 1e-3)))
    with pytest.raises(RecordError, match=r"payload: no gain is told to 10%, that of joint \S+ best"):
        drive_gains([free], [(load, Payload("load", 1e-3))], arm_model(arm))


@pytest.fixture(scope="module")
def result() -> RecordedResult:
    """What both logs say, named together."""
    arm = swinging_arm()
    free, load = table(record_of(arm)), table(record_of(loaded(arm), rubs=1.3))
    return estimate(
        [free, load],
        "spatial-three-link",
        payloads=[Payload(load, MASS, tuple(CENTRE))],
        friction=FRICTION,
        window=0.2,
        delay=0.0,
    )


@pytest.mark.slow
def test_bodies_are_in_true_kilograms_and_their_deviations_hold_those_of_the_gains(result: RecordedResult) -> None:
    """Of logs in currents the parameters are those of the arm, and intervals are wider than without gains."""
    found = result.estimate
    assert len(found.logs) == 1
    prior, gains = found.model.prior, found.gains
    assert prior is not None
    assert gains is not None
    true = prior.base.of(swinging_arm().parameters)[prior.base.columns % len(PARAMETERS) < len(PARAMETERS) - 2]
    heavy = np.abs(true) > 0.2 * np.abs(true).max()
    values, deviations = found.values[: len(true)][heavy], found.deviations[: len(true)][heavy]
    np.testing.assert_allclose(values, true[heavy], rtol=0.1)
    assert (np.abs(values - true[heavy]) < 3.0 * deviations).all()
    unsure = estimate_records(
        result.records, found.model, Choices(friction=FRICTION), replace(gains, relative=np.full(3, 0.3))
    )
    assert (unsure.deviations[: len(true)][heavy] > 0.15 * np.abs(values)).all()
    assert (deviations < 0.1 * np.abs(values)).all()


@pytest.mark.slow
def test_gains_are_in_the_summary_the_model_and_the_report(result: RecordedResult) -> None:
    """Joint by joint, with the ends of the interval."""
    rows = result.summary["gains"]
    assert [row["joint"] for row in rows] == list(result.estimate.model.joints)
    assert all(row["low"] < row["gain"] < row["high"] for row in rows)
    assert result.model.about["gains"] == [row["gain"] for row in rows]
    assert f"{rows[0]['joint']} {rows[0]['gain']:.4g} ± {rows[0]['sd']:.2g}; " in render_log(result)
    assert any("the payload tells the gains of" in reason for reason in result.verdict.reasons)


@pytest.mark.slow
def test_command_takes_a_payload(metaid: Callable[..., Finished]) -> None:
    """The log that carries it need not be named twice, and may be."""
    arm = swinging_arm()
    table(record_of(arm)).to_csv("free.csv", index=False)
    table(record_of(loaded(arm), rubs=1.3)).to_csv("load.csv", index=False)
    place = ",".join(f"{each}" for each in CENTRE)
    options = ("--nominal", "spatial-three-link", "--friction", "viscous,coulomb", "--window", "0.2")
    done = metaid("estimate", "free.csv", "load.csv", "--payload", f"load.csv=2@{place}", *options, "--json")
    assert (done.status, done.err) == (0, "")
    shown = json.loads(done.out)
    assert [log["path"] for log in shown["logs"]] == ["free.csv"]
    assert [row["determined"] for row in shown["gains"]] == [True, True, True]
    assert "gains of the drives" in metaid("estimate", "free.csv", "--payload", "load.csv=2", *options).out


@pytest.mark.parametrize(
    ("payload", "nominal", "says"),
    [
        ("load.csv", "spatial-three-link", "--payload 'load.csv' (allowed: LOG=KG or LOG=KG@X,Y,Z"),
        ("load.csv=heavy", "spatial-three-link", "(allowed: LOG=KG or LOG=KG@X,Y,Z"),
        ("load.csv=-1", "spatial-three-link", "payload of -1 kg (allowed: 0.001 to 10000)"),
        ("load.csv=1@0,0", "spatial-three-link", "payload at (0.0, 0.0) (allowed: three numbers in m"),
        ("log.csv=1", "spatial-three-link", "no log without a payload (allowed: one or more)"),
        ("load.csv=1", "three-link", "payload: the robot is a planar chain"),
    ],
)
def test_payload_that_cannot_be_is_refused_in_one_line(
    metaid: Callable[..., Finished], payload: str, nominal: str, says: str
) -> None:
    """It says what is allowed, with exit status 2."""
    for name in ("log.csv", "load.csv"):
        table(record_of(swinging_arm())).to_csv(name, index=False)
    done = metaid("estimate", "log.csv", "--payload", payload, "--nominal", nominal)
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert says in done.err


def test_interval_of_a_gain_is_that_of_its_reciprocal() -> None:
    """What is nearly unknown has no upper end."""
    known = np.array([True, False])
    frame = Gains(("a", "b"), np.array([10.0, 10.0]), np.array([0.1, 0.6]), known).frame
    np.testing.assert_allclose(frame["low"][0], 10.0 / 1.196, rtol=1e-3)
    np.testing.assert_allclose(frame["high"][0], 10.0 / 0.804, rtol=1e-3)
    assert np.isnan(frame["high"][1])
