"""Rows as tables show them: 0 where a number is what rounding left."""

from __future__ import annotations

from typing import Any

import pytest

from metaid.results import shown_rows

ROW = {"name": "m4x", "nominal": 0.5, "identified": 0.25, "low": 0.2, "high": 0.3, "true": 0.25, "error": 1e-3}


@pytest.mark.parametrize(
    ("changed", "shown"),
    [
        ({}, {}),
        ({"identified": -1e-5}, {"identified": 0.0}),  # of ± 0.05 the digits are seen to 0.001
        ({"identified": -1e-3}, {}),
        ({"true": 5.6e-17, "nominal": 3e-52}, {"true": 0.0, "nominal": 0.0}),
        ({"error": -3e-13}, {"error": 0.0}),
        ({"error": 2e-7}, {}),
        ({"identified": 1e-8, "low": None, "high": None, "true": None}, {}),
    ],
)
def test_what_rounding_left_is_shown_as_nothing(changed: dict[str, Any], shown: dict[str, Any]) -> None:
    """Numbers that are nothing in SI units, errors of 1e-9, values whose digits are all behind those of their ±."""
    row = ROW | changed
    assert shown_rows({"verdict": "found", "lumps": [row]}) == [row | shown]


def test_rows_of_what_was_not_found_have_no_numbers() -> None:
    """But for what is known without the trials."""
    (row,) = shown_rows({"verdict": "not found", "lumps": [ROW]})
    assert row["identified"] is None
    assert row["nominal"] == ROW["nominal"]
