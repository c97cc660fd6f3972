"""`metaid study plot` of a study of an arm: its own figures, and what it has none of."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished
from PIL import Image

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
FIGURES = (
    "convergence, factors, tracking, known, parallel, estimate-motion, estimate-residuals, estimate-correlation, "
    "estimate-trials"
)


def drawn(folder: Path) -> set[str]:
    """The names of the figures in a folder, each of which shows something."""
    for path in folder.iterdir():
        with Image.open(path) as picture:
            assert np.count_nonzero(picture.convert("L").histogram()) > 20, path  # shades of grey
    return {path.stem for path in folder.iterdir()}


def test_arm_that_was_found_is_drawn(arms: Path, metaid: Metaid, tmp_path: Path) -> None:
    """How the trials went, how well base parameters are known, tracking, and the motion beside the twin's."""
    out = metaid("study", "plot", "exact", "--storage", str(arms), "-o", "pictures").out
    assert out == f"9 figures are in pictures: {FIGURES}\n"
    assert drawn(tmp_path / "pictures") == set(FIGURES.split(", "))


def test_arm_that_was_not_found_is_drawn_where_the_twin_differs(arms: Path, metaid: Metaid, tmp_path: Path) -> None:
    """One trial is no line over the trials, and nothing is known."""
    assert metaid("study", "plot", "bent", "--storage", str(arms), "-o", "pictures").status == 0
    assert drawn(tmp_path / "pictures") == {"estimate-motion", "estimate-residuals"}


def test_fall_boundary_of_an_arm_is_refused_in_one_line(arms: Path, metaid: Metaid, tmp_path: Path) -> None:
    """It names the figures that there are, and leaves no folder behind."""
    refused = metaid("study", "plot", "exact", "--storage", str(arms), "-o", "pictures", "--over", "zz1", "m2x")
    assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert f"(its figures: {FIGURES})" in refused.err
    assert not (tmp_path / "pictures").exists()


def test_balanced_wheel_is_identified_and_drawn(metaid: Metaid, tmp_path: Path) -> None:
    """Its mass lies on its axis, at the base's origin, and nothing limits it: neither gravity nor speed loads it, and
    it has no size. Nothing is warned of.
    """
    body = '<joint name="axle" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
    (tmp_path / "wheel.xml").write_text(f"<mujoco><worldbody><body>{body}</body></worldbody></mujoco>")
    (tmp_path / "study.toml").write_text('plant = "wheel.xml"\nnominal = "wheel.xml"\ntrials = 2\n')
    assert metaid("study", "run", "study.toml", "--create", "--quiet").status == 0
    shown = metaid("study", "plot", "study", "-o", "pictures")
    assert (shown.status, shown.err) == (0, "")
    assert drawn(tmp_path / "pictures") == set(FIGURES.split(", "))
    assert metaid("plant", "draw", "wheel.xml", "-o", "wheel.png")[::2] == (0, "")
