"""Cells that hold a number of each joint, as those of messages in a frame, or of their text in a file."""

from __future__ import annotations

from itertools import zip_longest

import numpy as np
import pandas as pd

NUMPY = r"np\.\w+\(([^()]*)\)"  # a number of NumPy's in a list that was written as a text


def has_lists(frame: pd.DataFrame) -> bool:
    """Whether cells of a column hold lists."""
    return any(_are_lists(column) for _, column in frame.items())


def spread(frame: pd.DataFrame) -> pd.DataFrame:
    """The same readings with a column for each number of a list: `q` is `q_1`, `q_2` and so on, or goes by the words of
    another list that is as long and the same in all rows, as the names of joints in a message are.
    """
    tables = [_table(column) if _are_lists(column) else column.to_frame() for _, column in frame.items()]
    words = {table.shape[1]: [*table.iloc[0]] for table in tables if table.shape[1] > 1 and _names_joints(table)}
    for name, table in zip(frame.columns, tables, strict=True):
        width = table.shape[1]
        table.columns = [f"{name}_{word}" for word in words.get(width, range(1, width + 1))] if width > 1 else [name]
    return pd.concat(tables, axis="columns")


def _are_lists(column: pd.Series) -> bool:
    """Whether its first cell that is one holds a list."""
    filled = column.iloc[:0] if pd.api.types.is_numeric_dtype(column) else column.dropna()
    return len(filled) > 0 and _is_list(filled.iloc[0])


def _is_list(cell: object) -> bool:
    is_text = isinstance(cell, str) and cell.startswith(("[", "(")) and cell.endswith(("]", ")"))
    return is_text or isinstance(cell, list | tuple | np.ndarray)


def _names_joints(table: pd.DataFrame) -> bool:
    """Whether a table has the same words, and no numbers, in each row."""
    return bool(pd.to_numeric(table.iloc[0], errors="coerce").isna().all() and (table == table.iloc[0]).all(axis=None))


def _table(cells: pd.Series) -> pd.DataFrame:
    """Lists, or their texts, as a table (nrow x nelement), without readings where a cell has none."""
    if cells.map(lambda cell: isinstance(cell, str)).any():
        plain = cells.str.replace(NUMPY, r"\1", regex=True).str.replace(r"[\[\]()'\"]", " ", regex=True)
        return plain.str.strip().str.split(r"[\s,]+", regex=True, expand=True)
    elements = zip_longest(*(cell if _is_list(cell) else () for cell in cells))
    return pd.DataFrame(dict(enumerate(elements)), index=cells.index)
