"""Frames as JSON has them, and their numbers as tables have them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

UNKNOWN = "–"  # in the place of a number that is not known
NO_ERROR = 1e-9  # as a share: what is less is what rounding left


def json_rows(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a frame by their columns, None for what is not known."""
    return [
        {str(key): None if isinstance(value, float) and value != value else value for key, value in row.items()}
        for row in frame.to_dict("records")
    ]


def number_text(value: float | None, form: str = ".5g") -> str:
    """A number for a table, in a format; a dash where it is not known."""
    return UNKNOWN if value is None or value != value else format(value, form)
