"""The names of numba and MuJoCo that metaid uses and that neither documents. Any release may drop them.

tests/compiled/test_undocumented.py says which of them is missing from the versions that are installed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco

# MuJoCo's shared library, which the wheel has beside its Python modules.
LIBRARY = next(Path(mujoco.__file__).parent.glob("libmujoco.*"))

# Keeps compiled functions out of numba's reference counts, at the price that nothing can be allocated in them.
WITHOUT_REFERENCE_COUNTS = {"_nrt": False}


def address_of(struct: mujoco.MjModel | mujoco.MjData) -> int:
    """The address of MuJoCo's own struct behind a Python object; it is valid as long as the object."""
    address: int = struct._address
    return address


def class_of(named_tuple: Any) -> type:
    """The Python class of a NamedTuple whose numba type this is."""
    python_class: type = named_tuple.instance_class
    return python_class
