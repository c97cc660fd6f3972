"""The paper's tables beside both readings of it, as Markdown: what `metaid paper table1` and `table2` print, in words.

python -m benchmarks.paper_tables
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.common import Row, table
from metaid.paper import run_table

NAMES = {1: "f_m", 2: "f_m1, f_m2, f_m3"}
READINGS = {
    "paper": ("paper_periods", "paper_falls"),
    "pure: maxima": ("periods", "falls"),
    "pure: complete periods": ("complete_periods", "falls"),
    "paper-like": ("like_periods", "like_falls"),
}
SUMMED = {"pure: maxima": "difference", "paper-like": "like_difference"}


def shown(periods: Sequence[int], falls: bool) -> str:
    """What a reading has of a row."""
    return "falls" if falls else "/".join(map(str, periods))


def rows_of(number: int, rows: Sequence[dict[str, Any]]) -> list[Row]:
    """The rows of a table, and the sums of what the readings differ by where Table II has so many counts."""
    found: list[Row] = [
        {NAMES[number]: ", ".join(f"{factor:.2f}" for factor in row["factors"].values())}
        | {name: shown(row[periods], row[falls]) for name, (periods, falls) in READINGS.items()}
        for row in rows
    ]
    if number > 1:
        counts = sum(len(row["paper_periods"]) for row in rows if not row["paper_falls"])
        sums = {name: sum(abs(each) for row in rows for each in row[key] or ()) for name, key in SUMMED.items()}
        found.append(
            {NAMES[number]: f"sum of absolute differences over the {counts} counts"}
            | {name: sums.get(name, "") for name in READINGS}
        )
    return found


def main() -> None:
    """Prints both tables."""
    print("\n\n".join(table(rows_of(number, run_table(number))) for number in NAMES))


if __name__ == "__main__":
    main()
