"""`metaid episode` of an arm: one push, what each joint does, and the fall."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished
from PIL import Image

import metaid as package

Metaid = Callable[..., Finished]
ARM = "spatial-three-link"


def test_arm_coasts_under_its_own_law(metaid: Metaid) -> None:
    """Every joint keeps its speed, and the command says so; in Python it is the same."""
    shown = json.loads(metaid("episode", ARM, "--json").out)
    assert (shown["fell"], shown["fall_step"], shown["fall_time_s"]) == (False, None, None)
    assert shown["kinetic_hz"] < 1e-9
    for joint in shown["joints"]:
        assert joint["does"] == "coasts"
        assert joint["end_speed"] == pytest.approx(joint["start_speed"])
        assert joint["to"] == pytest.approx(joint["from"] + 0.3 * joint["start_speed"], abs=1e-6)
    assert package.perturb(ARM) == shown
    assert metaid("episode", ARM).out.count("coasts") == 3


def test_law_of_a_nominal_arm_does_not_let_it_coast(metaid: Metaid) -> None:
    """Nor does one whose base parameters are half as large again; another seed begins elsewhere."""
    for law in (["--nominal", "1"], ["--factor", "all=1.5"], ["--factor", "m2z=1.5"]):
        shown = json.loads(metaid("episode", ARM, "--json", *law).out)
        assert shown["kinetic_hz"] > 0.05
        assert {joint["does"] for joint in shown["joints"]} != {"coasts"}
    elsewhere = json.loads(metaid("episode", ARM, "--json", "--seed", "1").out)
    assert [joint["from"] for joint in elsewhere["joints"]] != [joint["from"] for joint in shown["joints"]]


def test_fall_says_when_and_which_joint(metaid: Metaid, tmp_path: Path) -> None:
    """A law that is five times too strong drives a joint out of its range or past its speed before the time is up."""
    shown = json.loads(metaid("episode", ARM, "--factor", "all=5", "--steps", "400", "--json").out)
    assert shown["fell"]
    assert 0 < shown["fall_step"] < 400
    assert shown["fall_time_s"] == pytest.approx(0.002 * shown["fall_step"])
    assert shown["kinetic_hz"] is None
    assert {joint["does"] for joint in shown["joints"]} & {"runs away", "leaves its range"}
    out = metaid("episode", ARM, "--factor", "all=5", "--steps", "400", "-o", "push.png").out
    assert f"fell after {shown['fall_time_s']:.3g} s, at step {shown['fall_step']} of 400" in out
    with Image.open(tmp_path / "push.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 20


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([ARM, "--factor", "m9=2"], "unknown base parameter 'm9' (allowed: all, "),
        ([ARM, "--factor", "all=-1"], "factor all=-1.0 (allowed: 0 to 1000)"),
        ([ARM, "--steps", "1000000"], "allowed of an arm: 1 to 100000"),
        ([ARM, "--video", "arm.mp4"], "--video: plant spatial-three-link is an arm"),
        (["one-link", "--nominal", "1"], "--nominal is of an arm, and plant one-link is a planar chain"),
    ],
)
def test_what_an_arm_has_not_is_refused_in_one_line(metaid: Metaid, arguments: list[str], said: str) -> None:
    """It says what is wrong and what is allowed."""
    refused = metaid("episode", *arguments)
    assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert said in refused.err
