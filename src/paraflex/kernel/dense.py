"""Gaussian elimination of small dense systems. Compiled in a second where a LAPACK call takes eight."""

from __future__ import annotations

from paraflex.kernel.compiling import kernel


@kernel
def solve_dense(matrix, right):
    """Solve matrix x = right in place of right (n, k), by elimination with partial pivoting; matrix is destroyed.

    Returns
    -------
    float
        The smallest pivot as a fraction of the largest entry: zero for a singular matrix, of which right then holds
        no solution.
    """
    n, columns = right.shape
    largest, smallest = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(matrix[i, j]))
    for i in range(n):
        pivot = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[pivot, i]):
                pivot = r
        size = abs(matrix[pivot, i])
        if not size > 0.0:
            return 0.0
        smallest = size if i == 0 else min(smallest, size)
        if pivot != i:
            for j in range(i, n):
                matrix[i, j], matrix[pivot, j] = matrix[pivot, j], matrix[i, j]
            for j in range(columns):
                right[i, j], right[pivot, j] = right[pivot, j], right[i, j]
        for r in range(i + 1, n):
            factor = matrix[r, i] / matrix[i, i]
            # Constraint Jacobians are mostly zeros.
            if factor != 0.0:
                for j in range(i + 1, n):
                    matrix[r, j] -= factor * matrix[i, j]
                for j in range(columns):
                    right[r, j] -= factor * right[i, j]
    for i in range(n - 1, -1, -1):
        for r in range(i + 1, n):
            factor = matrix[i, r]
            if factor != 0.0:
                for j in range(columns):
                    right[i, j] -= factor * right[r, j]
        for j in range(columns):
            right[i, j] /= matrix[i, i]
    return smallest / largest
