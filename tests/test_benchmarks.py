"""Tables of benchmarks say what was measured."""

from __future__ import annotations

import pytest

from benchmarks import arms, faults_stood
from metaid.models.tree import ModelError

pytestmark = pytest.mark.slow


def test_a_table_says_which_faults_an_estimate_stands() -> None:
    """A median over the chains for each setting, how many were found, and what was taken up."""
    stood = [
        faults_stood.Stood(
            f"a base tilted by 30 mrad / bench / {setting}", 3, seed, error * (1 + seed), found, taken, 13.6, 2.0
        )
        for setting, error, found, taken in (("alone", 0.1, False, []), ("proposed", 1e-4, True, ["tilt"]))
        for seed in range(3)
    ]
    (row,) = faults_stood.rows_of(stood)
    assert row["bench, alone"] == "20 %"
    assert row["found, bench, alone"] == "0 of 3"
    assert row["bench, proposed"] == "0.02 %"
    assert row["found, bench, proposed"] == "3 of 3"
    assert row["taken up, bench"] == "tilt 3"


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
