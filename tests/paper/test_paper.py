"""The paper's results: what correct dynamics says of them, and, under names that say so, what was fitted to them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished
from places import ROOT

from metaid.errors import EpisodeError
from metaid.paper import LIKE, PURE, paper_table, run_fig4, run_sweep, run_table

PRINTED = {1: [16, 11, 10, 9, 8, 6, 4], 2: [9, 24, 8, 24, 7, 21, 6, 18, 5, 15, 4, 14, 3, 14, 3, 13]}


@pytest.mark.parametrize("number", [1, 2])
def test_tables_are_as_printed(number: int) -> None:
    """Every count, and the falls of the last rows."""
    rows = paper_table(number)
    assert [count for row in rows for count in row.periods] == PRINTED[number]
    assert [row.falls for row in rows] == [not row.periods for row in rows]
    assert set(rows[0].factors) == ({"gravity_1"} if number == 1 else {"coriolis_1_2", "gravity_1", "gravity_2"})


def test_correct_dynamics_has_every_count_of_table_one_by_its_stated_rule() -> None:
    """Seven counts of maxima plus one, and the fall at 0.99."""
    rows = run_table(1)
    assert {row["rule"] for row in rows} == {"maxima"}
    assert [row["periods"] for row in rows] == [row["paper_periods"] for row in rows]
    assert [row["falls"] for row in rows] == [False] * 7 + [True]


@pytest.mark.parametrize("number", [1, 2])
def test_correct_dynamics_falls_where_the_paper_falls(number: int) -> None:
    """Row by row, (0.99, 1, 1) of Table II, which does not, included."""
    rows = run_table(number)
    assert [row["falls"] for row in rows] == [row["paper_falls"] for row in rows]
    assert all((row["periods"] == []) == row["falls"] for row in rows)


@pytest.mark.parametrize("nlink", [1, 2])
def test_no_period_is_complete_at_exact_compensation(nlink: int) -> None:
    """At 1.00 every joint keeps its speed: the four "periods" of Table I are revolutions."""
    exact = np.ones(nlink * (nlink + 1) // 2)
    reading = PURE[nlink]
    assert reading.complete_periods(exact) == [0] * nlink
    speeds = np.diff(reading.counting.record(exact).angles[0], axis=0)
    assert np.abs(speeds - speeds[0]).max() < 1e-9
    if nlink == 1:
        assert reading.periods(exact) == [4]
        assert 3 * 2 * np.pi < 5000 * speeds[0, 0] < 4 * 2 * np.pi


def test_counts_do_not_see_the_coriolis_lump() -> None:
    """From half to one and a half of its true value no count changes, and the frequency is not least at the truth."""
    rows = run_sweep()
    assert {tuple(row["periods"]) for row in rows} == {(6, 8)}
    hertz = np.array([row["frequency_hz"] for row in rows])
    assert (np.diff(hertz, axis=0) < 0.0).all()
    assert (np.ptp(hertz, axis=0) < 0.003 * hertz.mean(axis=0)).all()


def test_fitted_reading_has_table_one_exactly() -> None:
    """paper-like was made to have it."""
    rows = run_table(1)
    assert [row["like_periods"] for row in rows] == [row["paper_periods"] for row in rows]
    assert [row["like_falls"] for row in rows] == [row["paper_falls"] for row in rows]


def test_fitted_reading_is_ten_periods_at_most_from_table_two() -> None:
    """Over sixteen counts, all falls right."""
    rows = run_table(2)
    assert sum(abs(difference) for row in rows for difference in row["like_difference"] or ()) <= 10
    assert [row["like_falls"] for row in rows] == [row["paper_falls"] for row in rows]


def test_fitted_reading_swings_within_the_axes_of_figure_four() -> None:
    """All angles stay within the 100 degrees of the paper's axes; correct dynamics turns link 2 round."""
    like, pure = (run_fig4(reading[2])[0] for reading in (LIKE, PURE))
    assert len(like) == 5001
    assert np.degrees(np.abs(like).max()) < 100.0
    assert np.abs(pure[:, 1]).max() > 2 * np.pi


def test_no_other_plant_is_bent_to_match() -> None:
    """The fault and the spring are in the plants that are labelled as fitted, and nowhere else."""
    for path in (ROOT / "plants").glob("*.toml"):
        text = path.read_text()
        fitted = "over_compensation" in text or "stiffness" in text
        assert fitted == path.stem.startswith("paper-like")
        assert not fitted or "Fitted to the paper" in text


def test_table_that_the_paper_does_not_have_is_refused() -> None:
    """A wrong number tells which are right."""
    with pytest.raises(EpisodeError, match=r"no table 3 \(allowed: 1, 2\)"):
        paper_table(3)


@pytest.mark.parametrize(("command", "rows"), [("table1", 8), ("table2", 10)])
def test_json_of_the_tables_is_that_of_the_contract(metaid: Callable[..., Finished], command: str, rows: int) -> None:
    """A list of rows with the agreed fields."""
    shown = json.loads(metaid("paper", command, "--json").out)
    assert len(shown) == rows
    for row in shown:
        assert {"factors", "paper_periods", "periods", "paper_falls", "falls"} <= set(row)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["table1", "table2", "fig4", "sweep"])
def test_command_prints_a_table_and_draws_a_picture(metaid: Callable[..., Finished], command: str) -> None:
    """Text on stdout, JSON if asked, a PNG where -o says."""
    finished = metaid("paper", command, "-o", "picture.png")
    assert finished.status == 0
    assert "paper" in finished.out or "f_m1" in finished.out
    assert Path("picture.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(metaid("paper", command, "--json").out)
