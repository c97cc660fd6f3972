"""The robustness benchmark: what it says of a fault follows from what it measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import arms, faults_stood
from benchmarks.faulted import FAULTS, Result, identify
from benchmarks.robustness import draw_pictures, error_rows, first_rows, largest_size
from metaid.models.tree import ModelError

pytestmark = pytest.mark.slow


def test_size_for_one_percent_lies_on_the_curve() -> None:
    """Between two sizes on a straight line of logarithms; not below the first, nor beyond the last."""
    assert largest_size([(1.0, 0.001), (10.0, 0.1)]) == pytest.approx(np.sqrt(10.0))
    assert largest_size([(1.0, 0.02), (10.0, 0.1)]) is None
    assert largest_size([(1.0, 0.001), (10.0, 0.009)]) == np.inf
    assert largest_size([(16.0, 0.001), (8.0, 0.001), (4.0, 0.1)]) == pytest.approx(np.sqrt(32.0))


def test_tables_and_pictures_say_what_breaks_first(tmp_path: Path) -> None:
    """Medians over the chains, and the lump whose error passes one percent at the smallest size."""
    names = ("gravity_1", "gravity_2", "coriolis_1_2")
    results = [
        Result(2, name, size, seed, names, (1e-3, 2e-3, 1e-2 * (i + 0.5) * (seed + 1) / 2), (1e-3, 1e-3, 1e-3))
        for name, fault in FAULTS.items()
        for i, size in enumerate(fault.sizes)
        for seed in range(3)
    ]
    rows = {(row["fault"], row["size"]): row for row in error_rows(results)}
    assert rows["tilt, mrad", 3.0]["N = 2, coriolis, %"] == pytest.approx(1.5)
    assert rows["tilt, mrad", 3.0]["N = 2, gravity, %"] == pytest.approx(0.2)
    tilt = next(row for row in first_rows(results) if row["fault"] == "tilt, mrad")
    assert tilt["first lump beyond"] == "coriolis_1_2, 1.5% at 3"
    assert tilt["gravity within 1 % up to"] == "30 and more"
    assert tilt["coriolis within 1 % up to"] == "2"
    draw_pictures(results, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"robustness.png", "robustness-lumps.png"}


def test_least_squares_is_given_trajectories_that_weak_drives_can_follow() -> None:
    """Where the widest swing needs more torque than there is, it gets a smaller one."""
    assert max(identify((2, "torque limit", 8.0, 0)).least_squares) < 0.5


def test_one_chain_is_identified_by_both_methods() -> None:
    """A milliradian of noise on two links: metaid within two percent, least squares with torques in its own way."""
    found = identify((2, "angle noise", 1.0, 0))
    assert max(found.errors[:2]) < 0.02
    assert max(found.least_squares) < 0.02


def test_a_table_says_which_faults_an_estimate_stands() -> None:
    """A median over the chains for each setting, how many were found, and what was taken up."""
    stood = [
        faults_stood.Stood(
            f"a base tilted by 30 mrad / {setting}", 3, seed, error * (1 + seed), found, taken, 13.6, 2.0
        )
        for setting, error, found, taken in (("default", 0.1, False, []), ("proposed", 1e-4, True, ["tilt"]))
        for seed in range(3)
    ]
    (row,) = faults_stood.rows_of(stood)
    assert row["worst lump, default"] == "20 %"
    assert row["found, default"] == "0 of 3"
    assert row["worst lump, proposed"] == "0.02 %"
    assert row["found, proposed"] == "3 of 3"
    assert row["taken up"] == "tilt 3"


def test_a_table_of_arms_counts_those_that_were_found() -> None:
    """A row an arm, errors of those found alone; what is rounding is said to be below it."""

    def run(arm: str, seed: int, error: float, is_found: bool) -> arms.Identified:
        nominal, last = (ModelError(each, each / 2, each / 4) for each in (0.1 * (1 + seed), error))
        return arms.Identified(arm, seed, 6, 50 + len(arm), nominal, [last], [1.0], [is_found], 40, 0, 2.0 + seed)

    runs = [
        run("one", 0, 1e-3, True),
        run("one", 1, 3e-3, True),
        run("one", 2, 0.5, False),
        run("other", 0, 1e-9, True),
    ]
    one, other, both = [row.split(" | ")[1:] for row in arms.identified_table(runs, True).splitlines()[2:]]
    assert one == ["3", "53", "10 to 30 %", "2", "–", "0.2 %", "0.1 %", "0.05 %", "0.3 %", "75.5 %", "3", "4 |"]
    assert other[5:9] == ["below 1e-08"] * 4
    assert both[:4] == ["4", "53 to 55", "10 to 30 %", "3"]
