"""Gaussian elimination of small dense systems, which compiles in one second; a LAPACK call takes eight."""

from .compiling import kernel


@kernel
def factor_dense(matrix, order):
    """Factor a matrix into L and U, in place, by elimination with partial pivoting.

    Parameters
    ----------
    matrix : (n, n) array
        Matrix; overwritten by its factors.
    order : (n,) array of int
        Row exchanged with each row at its elimination. Written.

    Returns
    -------
    float
        Smallest pivot as a fraction of the largest entry; zero for a singular matrix, which has no factors.
    """
    n = matrix.shape[0]
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
        order[i] = pivot
        if pivot != i:
            for j in range(n):
                matrix[i, j], matrix[pivot, j] = matrix[pivot, j], matrix[i, j]
        for r in range(i + 1, n):
            # Constraint Jacobians are mostly zeros.
            if matrix[r, i] != 0.0:
                factor = matrix[r, i] / matrix[i, i]
                matrix[r, i] = factor
                for j in range(i + 1, n):
                    matrix[r, j] -= factor * matrix[i, j]
    return smallest / largest


@kernel
def solve_factored(factors, order, right):
    """Solve matrix x = right in place of right (n, k), with the factors (n, n) and order (n,) of `factor_dense`."""
    n, columns = right.shape
    for i in range(n):
        pivot = order[i]
        if pivot != i:
            for j in range(columns):
                right[i, j], right[pivot, j] = right[pivot, j], right[i, j]
    for i in range(n):
        for r in range(i):
            if factors[i, r] != 0.0:
                for j in range(columns):
                    right[i, j] -= factors[i, r] * right[r, j]
    for i in range(n - 1, -1, -1):
        for r in range(i + 1, n):
            if factors[i, r] != 0.0:
                for j in range(columns):
                    right[i, j] -= factors[i, r] * right[r, j]
        for j in range(columns):
            right[i, j] /= factors[i, i]
