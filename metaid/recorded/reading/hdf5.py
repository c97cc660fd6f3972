"""Files of HDF5, as h5py, PyTables and recorders of demonstrations write them: arrays by the names of their groups."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from metaid.errors import optional_packages


def hdf5_arrays(path: Path) -> dict[str, Any]:
    """What a file holds, groups as dictionaries; pictures are left out.

    Raises:
        MissingExtraError: h5py is not installed.
        OSError: it cannot be read, or is no such file.
    """
    with optional_packages("hdf5"):
        import h5py
    with path.open("rb") as file, h5py.File(file, "r") as root:
        return _inside(root)


def _inside(group: Any) -> dict[str, Any]:
    """The arrays of a group, with numbers that it has as attributes, as a step or a rate."""
    found: dict[str, Any] = {name: each for name, each in group.attrs.items() if np.ndim(each) == 0}
    for name, item in group.items():
        if hasattr(item, "items"):
            found[name] = _inside(item)
        elif item.dtype.names:  # a table of PyTables', with columns of one width or more
            table = item[()]
            found[name] = {field: table[field] for field in item.dtype.names}
        elif item.ndim <= 2:
            found[name] = item.asstr()[()] if item.dtype.kind in "SO" else item[()]
    return found
