"""Independent rows of sparse matrices, and the columns that they determine.

Small matrices are treated by QR factorisation with column pivoting, large ones by Gaussian elimination. The next pivot
is in the column with the fewest entries (Markowitz 1957), in the shortest row where its entry is not small. Branches of
a tree are thus eliminated from their ends and loops one by one, so the cost for chains and rows of loops is
proportional to the number of entries.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Indices, Numbers

# A row of unit norm is dependent if its part independent of other rows is not larger than this.
DEPENDENT = 1e-8
# Smallest pivot relative to the largest entry of its row.
_PIVOT = 0.1
# Rows with smaller remainders are deferred until no others are left: their elimination amplifies other rows.
_WAITING = (1e-2, 1e-4, 1e-6, DEPENDENT)
# Relative remainder of an entry that is regarded as cancelled.
_CANCELLED = 1e-14


class Independent(NamedTuple):
    """Independent rows and the columns that they determine.

    Attributes
    ----------
    groups : tuple of arrays of int
        Indices of the independent rows of each group, ascending.
    columns : array of int
        Indices of as many columns, ascending, in which the rows form a regular matrix.
    """

    groups: tuple[Indices, ...]
    columns: Indices


def independent_dense(groups: Sequence[csr_matrix], weights: Array) -> Independent:
    """Select independent rows by QR factorisation: any of the first group, then in order those of the other groups.

    Parameters
    ----------
    groups : sequence of (rows, n) sparse matrices
        Groups of rows of unit norm.
    weights : (n,) array
        Weights of the columns; a column of larger weight is selected later.
    """
    first, *others = (group.toarray() for group in groups)
    kept, basis = np.zeros(0, dtype=int), np.zeros((weights.size, 0))
    if first.size:
        basis, upper, order = (np.asarray(part) for part in scipy.linalg.qr(first.T, mode="economic", pivoting=True))
        size = np.abs(np.diag(upper))
        rank = int(np.sum(size > DEPENDENT * size.max(initial=1.0)))
        kept, basis = np.sort(order[:rank]), basis[:, :rank]
    found, taken = [kept], [first[kept]]
    for group in others:
        rows, basis = successive(group, basis)
        found.append(np.array(rows, dtype=int))
        taken.append(group[found[-1]])
    whole = np.vstack(taken) / weights
    order = np.asarray(scipy.linalg.qr(whole, mode="r", pivoting=True)[-1]) if whole.size else np.zeros(0, dtype=int)
    return Independent(tuple(found), np.sort(order[: len(whole)]))


def successive(rows: Array, basis: Array) -> tuple[list[int], Array]:
    """Select the rows (h, n) of unit norm that are independent of a basis (n, k) and of previous rows.

    Returns
    -------
    list of int
        Indices of the independent rows.
    (n, k + independent) array
        Orthonormal basis extended by them.
    """
    kept: list[int] = []
    for k, row in enumerate(rows):
        left = row - basis @ (basis.T @ row)
        if np.linalg.norm(left) > DEPENDENT:
            left -= basis @ (basis.T @ left)
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
            kept.append(k)
    return kept, basis


def unit_rows(rows: Array) -> Array:
    """Normalise rows to unit norm; rows of zeros are unchanged."""
    return rows / sizes(rows, 1)


def sizes(matrix: Numbers, axis: int) -> Array:
    """Return the norms of a matrix' rows (rows, 1), with axis 1, or columns (1, columns), with axis 0; 1 if zero."""
    size = np.linalg.norm(matrix, axis=axis, keepdims=True)
    return np.where(size > 0.0, size, 1.0)


def independent_sparse(groups: Sequence[csr_matrix], weights: Array) -> Independent:
    """Select independent rows as `independent_dense` does, by elimination and without an order within a group."""
    work = _Elimination(scipy.sparse.csr_matrix(scipy.sparse.vstack(groups)), weights)
    found, first = [], 0
    for group in groups:
        rows = range(first, first := first + group.indptr.size - 1)
        found.append(np.array(sorted(work.eliminate(rows)), dtype=int) - rows.start)
    return Independent(tuple(found), np.array(sorted(work.pivots), dtype=int))


class _Elimination:
    """Sparse Gaussian elimination, with rows as dictionaries of entries and the set of rows of each column."""

    def __init__(self, matrix: csr_matrix, weights: Array) -> None:
        matrix.eliminate_zeros()
        self.weights: list[float] = weights.tolist()
        self.rows: list[dict[int, float]] = []
        self.columns: dict[int, set[int]] = {}
        self.largest: dict[int, tuple[float, float]] = {}
        self.pivots: list[int] = []
        self.heap: list[tuple[int, int]] = []
        columns, values = matrix.indices.tolist(), matrix.data.tolist()
        for k, (begin, end) in enumerate(pairwise(np.asarray(matrix.indptr).tolist())):
            own = slice(begin, end)
            self.rows.append(dict(zip(columns[own], values[own], strict=True)))
            for column in columns[own]:
                self.columns.setdefault(column, set()).add(k)

    def eliminate(self, rows: Iterable[int]) -> list[int]:
        """Eliminate by those of the given rows that are independent of all previous ones, and return them."""
        waiting, kept = set(rows), list[int]()
        for least in _WAITING:
            while before := len(waiting):
                self.heap = [(len(self.columns[j]), j) for j in {j for k in waiting for j in self.rows[k]}]
                heapq.heapify(self.heap)
                kept += self._sweep(waiting, least)
                if len(waiting) == before:
                    break
        for row in waiting:
            for j in self.rows[row]:
                self.columns[j].discard(row)
        return kept

    def _sweep(self, waiting: set[int], least: float) -> list[int]:
        """Eliminate by rows with at least the given remainder, columns with few entries first, and return them."""
        kept = []
        while self.heap:
            count, column = heapq.heappop(self.heap)
            if count != len(self.columns[column]):
                continue
            for row in sorted(self.columns[column] & waiting, key=lambda k: len(self.rows[k])):
                size, weighted = self._size(row)
                if size > least and abs(self.rows[row][column]) > _PIVOT * weighted * self.weights[column]:
                    self._take(row, column)
                    waiting.remove(row)
                    kept.append(row)
                    break
        return kept

    def _size(self, row: int) -> tuple[float, float]:
        """Return the largest magnitude of a row's entries, without weights and divided by the weights."""
        if row not in self.largest:
            entries, weights = self.rows[row], self.weights
            size = max(map(abs, entries.values()), default=0.0)
            self.largest[row] = (size, max((abs(one) / weights[j] for j, one in entries.items()), default=0.0))
        return self.largest[row]

    def _take(self, row: int, column: int) -> None:
        """Eliminate a column from all other rows by means of a pivot row."""
        pivot = self.rows[row]
        for j in pivot:
            self.columns[j].discard(row)
        value = pivot.pop(column)
        for other in self.columns[column]:
            self._subtract(other, self.rows[other].pop(column) / value, pivot)
        self.columns[column].clear()
        self.pivots.append(column)
        for j in pivot:
            heapq.heappush(self.heap, (len(self.columns[j]), j))

    def _subtract(self, other: int, factor: float, pivot: dict[int, float]) -> None:
        """Subtract a multiple of the pivot row from another row."""
        entries = self.rows[other]
        self.largest.pop(other, None)
        for j, value in pivot.items():
            before, change = entries.get(j, 0.0), factor * value
            after = before - change
            if abs(after) > _CANCELLED * (abs(before) + abs(change)):
                entries[j] = after
                self.columns[j].add(other)
            elif j in entries:
                del entries[j]
                self.columns[j].discard(other)
