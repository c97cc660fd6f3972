"""Vectors in space as triples, which a compiled loop keeps in registers."""

from __future__ import annotations

import numpy as np

from metaid.compiled.decorator import compiled


@compiled
def triple(row, first=0):  # type: ignore[no-untyped-def]
    """Three numbers of a row of an array, from the `first` on: a slice would be cut to the row's length each time."""
    return row[first], row[first + 1], row[first + 2]


@compiled
def cosine_and_sine(angle):  # type: ignore[no-untyped-def]
    """Cosine and sine of an `angle`, in rad, to 2e-16 up to a million turns.

    A quarter of the cost of the C library's, which no compiler can put into the loop over joints. The angle less the
    nearest multiple of π/2, in three parts whose products are exact (Cody and Waite), goes into the polynomials of
    Sun's fdlibm.
    """
    quarters = np.floor(angle * (2.0 / np.pi) + 0.5)
    x = angle - quarters * 1.57079632673412561417
    x -= quarters * 6.07710050630396597660e-11
    x -= quarters * 2.02226624879595063154e-21
    z = x * x
    odd = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    odd = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * odd)
    sine = x + x * z * (-1.66666666666666324348e-01 + z * odd)
    even = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    even = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * even))
    cosine = 1.0 - 0.5 * z + z * z * even
    quarter = np.int64(quarters) & 3
    if quarter & 1:
        cosine, sine = sine, cosine
    return -cosine if quarter == 1 or quarter == 2 else cosine, -sine if quarter >= 2 else sine


@compiled
def put(row, vector):  # type: ignore[no-untyped-def]
    """Writes a `vector` into a row of an array."""
    row[0], row[1], row[2] = vector


@compiled
def plus(one, other):  # type: ignore[no-untyped-def]
    """The sum of two vectors."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


@compiled
def times(number, vector):  # type: ignore[no-untyped-def]
    """A `number` times a `vector`."""
    return number * vector[0], number * vector[1], number * vector[2]


@compiled
def dot(one, other):  # type: ignore[no-untyped-def]
    """The inner product of two vectors."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@compiled
def cross(one, other):  # type: ignore[no-untyped-def]
    """The vector product of two vectors."""
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


@compiled
def outward(matrix, vector):  # type: ignore[no-untyped-def]
    """A `vector` of the frame of the link before, in that of the link: its `matrix` (9, row by row) transposed."""
    x, y, z = vector
    return (
        matrix[0] * x + matrix[3] * y + matrix[6] * z,
        matrix[1] * x + matrix[4] * y + matrix[7] * z,
        matrix[2] * x + matrix[5] * y + matrix[8] * z,
    )


@compiled
def inward(matrix, vector):  # type: ignore[no-untyped-def]
    """A `vector` of the frame of a link, in that of the link before: its `matrix` (9, row by row)."""
    x, y, z = vector
    return (
        matrix[0] * x + matrix[1] * y + matrix[2] * z,
        matrix[3] * x + matrix[4] * y + matrix[5] * z,
        matrix[6] * x + matrix[7] * y + matrix[8] * z,
    )


@compiled
def symmetric(inertia, vector):  # type: ignore[no-untyped-def]
    """A symmetric matrix, as the triples (xx, xy, xz) and (yy, yz, zz), times a `vector`."""
    (xx, xy, xz), (yy, yz, zz) = inertia
    x, y, z = vector
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
