"""Names that numba and MuJoCo do not document: should one go, the test of that name says so."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import mujoco
import numba
import numpy as np
from numba.extending import overload

from metaid.compiled.undocumented import LIBRARY, WITHOUT_REFERENCE_COUNTS, address_of, class_of


class Point(NamedTuple):
    """Something that a compiled function takes."""

    x: float


def test_numba_has_the_option_nrt() -> None:
    """Option `_nrt` of `numba.njit`: with it a function that allocates nothing compiles and runs."""
    assert numba.njit(**WITHOUT_REFERENCE_COUNTS)(lambda numbers: numbers[0] + 1.0)(np.ones(1)) == 2.0


def test_numba_has_the_attribute_instance_class() -> None:
    """Attribute `instance_class` of a NamedTuple's type: the class by which an overload is chosen."""
    seen = []

    def look(point):  # type: ignore[no-untyped-def]
        raise NotImplementedError

    @overload(look)
    def _look(point):  # type: ignore[no-untyped-def]
        seen.append(class_of(point))
        return lambda point: point.x

    assert numba.njit(lambda point: look(point))(Point(3.0)) == 3.0  # type: ignore[no-untyped-call]
    assert seen[0] is Point


def test_mujoco_has_the_attribute_address() -> None:
    """Attribute `_address` of MjModel and MjData: where MuJoCo's library finds both; a step through it is one step."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    data = mujoco.MjData(model)
    library = ctypes.CDLL(LIBRARY)
    library.mj_step(ctypes.c_void_p(address_of(model)), ctypes.c_void_p(address_of(data)))
    assert data.time == model.opt.timestep
