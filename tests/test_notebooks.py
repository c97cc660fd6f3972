"""Notebooks run from top to bottom, and print what is stored in them."""

from __future__ import annotations

from pathlib import Path

import pytest

from soak.notebooks import differences, notebooks, read, run_notebook, same

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_notebook_runs_in_an_empty_folder_and_prints_what_is_stored(path: Path, tmp_path: Path) -> None:
    """Every cell, in order, without an error; `python -m soak.notebooks --store` stores what is printed now."""
    made = run_notebook(path, tmp_path)
    assert all(cell.execution_count for cell in made.cells if cell.cell_type == "code")
    assert differences(read(path), made) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("error 0.12346, 3 trials", "error 0.12345, 3 trials"),
        ("0.9652461650470291", "0.9652461650470404"),
        ("largest error: 8e-10", "largest error: -3e-14"),
        ("2e-09 of it", "3e-09 of it"),
        ("in /tmp/abc/find.toml after 1.5 s", "in /tmp/xyz/find.toml after 30.2 s"),
    ],
)
def test_rounding_times_and_folders_are_no_difference(one: str, other: str) -> None:
    """What differs from one machine, or from one run, to another."""
    assert same(one, other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("3 trials", "4 trials"),
        ("error 0.12346", "error 0.12344"),
        ("found", "not found"),
        ("[1, 2]", "[1, 2, 3]"),
        ("<Figure size 420x168 with 1 Axes> drawn", "<Figure size 420x168 with 2 Axes> drawn"),
        ("largest error: 8e-10", "largest error: 3e-05"),
    ],
)
def test_other_numbers_words_and_panels_are_differences(one: str, other: str) -> None:
    """A count, a digit that rounding does not reach, a word, a number more, a panel more."""
    assert not same(one, other)
