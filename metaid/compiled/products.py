"""Small matrices, compiled: products, whose blocks stay in registers while loops run along their columns, and systems
of equations.

Loops run along slices. Only of a slice does the compiler know that no index is negative, and only then does it use
vector instructions.
"""

from __future__ import annotations

from metaid.compiled.decorator import compiled, fused

BLOCK = 4  # rows and columns that are multiplied at once, held in registers
LANES = 8  # numbers in one instruction, at most


def whole(count: int, of: int) -> int:
    """`count`, or the next multiple of `of`: blocks then have no remainder."""
    return -(-count // of) * of


@fused
def multiply(closed, moved, changed, low, high):  # type: ignore[no-untyped-def]
    """Adds a product of matrices. Their rows are multiples of BLOCK: a block's sixteen numbers stay in registers while
    its loop runs along the columns.

    Args:
        closed: the first factor (nrow x ninner).
        moved: the second (ninner x ncolumn).
        changed: what the product is added to (nrow x ncolumn).
        low: the first column that is treated.
        high: the first column that is not, behind it.
    """
    for r in range(0, closed.shape[0], BLOCK):
        row0, row1 = changed[r, low:high], changed[r + 1, low:high]
        row2, row3 = changed[r + 2, low:high], changed[r + 3, low:high]
        for j in range(0, closed.shape[1], BLOCK):
            from0, from1 = moved[j, low:high], moved[j + 1, low:high]
            from2, from3 = moved[j + 2, low:high], moved[j + 3, low:high]
            a0, a1, a2, a3 = closed[r, j], closed[r, j + 1], closed[r, j + 2], closed[r, j + 3]
            b0, b1, b2, b3 = closed[r + 1, j], closed[r + 1, j + 1], closed[r + 1, j + 2], closed[r + 1, j + 3]
            c0, c1, c2, c3 = closed[r + 2, j], closed[r + 2, j + 1], closed[r + 2, j + 2], closed[r + 2, j + 3]
            d0, d1, d2, d3 = closed[r + 3, j], closed[r + 3, j + 1], closed[r + 3, j + 2], closed[r + 3, j + 3]
            for p in range(row0.shape[0]):
                x, y, z, w = from0[p], from1[p], from2[p], from3[p]
                row0[p] += a0 * x + a1 * y + a2 * z + a3 * w
                row1[p] += b0 * x + b1 * y + b2 * z + b3 * w
                row2[p] += c0 * x + c1 * y + c2 * z + c3 * w
                row3[p] += d0 * x + d1 * y + d2 * z + d3 * w


@compiled
def factorise(matrix, extra, factor):  # type: ignore[no-untyped-def]
    """Fills in L, with D on its diagonal, of L D Lᵀ = `matrix` with `extra` on its diagonal; whether that is positive
    definite. Of the `matrix`, which may be the `factor` itself, the lower triangle counts.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k] * factor[k, k]
            if i == j:
                rest += extra[i]
                if not rest > 0.0:
                    return False
                factor[i, i] = rest
            else:
                factor[i, j] = rest / factor[j, j]
    return True


@compiled
def solve(factor, vector):  # type: ignore[no-untyped-def]
    """Replaces a `vector` by the solution of L D Lᵀ x = vector."""
    n = vector.shape[0]
    for i in range(n):
        for j in range(i):
            vector[i] -= factor[i, j] * vector[j]
    for i in range(n - 1, -1, -1):
        vector[i] /= factor[i, i]
        for j in range(i + 1, n):
            vector[i] -= factor[j, i] * vector[j]


@fused
def solve_rows(factor, rows):  # type: ignore[no-untyped-def]
    """Replaces `rows` (n x any) by the solution of L D Lᵀ x = rows."""
    n = factor.shape[0]
    for i in range(n):
        row = rows[i]
        for k in range(i):
            share, other = factor[i, k], rows[k]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
    for i in range(n - 1, -1, -1):
        row, scale = rows[i], 1.0 / factor[i, i]
        for p in range(row.shape[0]):
            row[p] *= scale
        for k in range(i + 1, n):
            share, other = factor[k, i], rows[k]
            for p in range(row.shape[0]):
                row[p] -= share * other[p]
