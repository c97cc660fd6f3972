"""Vectors in space as triples, which a compiled loop keeps in registers."""

from __future__ import annotations

from metaid.compiled.decorator import compiled


@compiled
def triple(row):  # type: ignore[no-untyped-def]
    """The three numbers of a row of an array."""
    return row[0], row[1], row[2]


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
