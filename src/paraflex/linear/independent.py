"""Independent rows of sparse matrices, and the columns that follow from the others.

Of few coordinates by QR factorisations with pivots, of many by Gaussian elimination: next is the column with the fewest
entries (Markowitz 1957), in the shortest row where its entry is not small. The branches of a tree are so taken off from
their ends, and loops one by one, so that chains and rows of loops cost what their entries cost.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from paraflex.arrays import Array

Numbers = NDArray[np.int64]
# A row of size one of which no more than this is independent of others follows from them.
DEPENDENT = 1e-8
# A pivot is at least this part of the largest entry of its row.
_PIVOT = 0.1
# Rows of which less than this is left wait until no others are left: their elimination makes others grow.
_WAITING = (1e-2, 1e-4, 1e-6, DEPENDENT)
# What is left of an entry that cancels, as a part of it.
_CANCELLED = 1e-14


class Independent(NamedTuple):
    """Rows that are independent, and the columns that they determine.

    Attributes
    ----------
    groups : tuple of arrays of int
        Rows of each group, ascending.
    columns : array of int
        As many, ascending: with these the rows form a regular matrix.
    """

    groups: tuple[Numbers, ...]
    columns: Numbers


def independent_dense(groups: Sequence[csr_matrix], weights: Array) -> Independent:
    """Independent rows by QR factorisations; of the first group any, of the others each that does not follow before.

    Parameters
    ----------
    groups : sequence of (rows, n) sparse matrices
        Rows of size one.
    weights : (n,) array
        The larger, the later a column is taken.
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
    """Rows (h, n) of size one that follow neither from a basis (n, k) nor from those before; the basis with them."""
    kept: list[int] = []
    for k, row in enumerate(rows):
        left = row - basis @ (basis.T @ row)
        if np.linalg.norm(left) > DEPENDENT:
            left -= basis @ (basis.T @ left)
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
            kept.append(k)
    return kept, basis


def unit_rows(rows: Array) -> Array:
    """Rows of size one, those of zeros as they are."""
    return rows / sizes(rows, 1)


def sizes(matrix: NDArray[Any], axis: int) -> Array:
    """Sizes of a matrix' rows (rows, 1), along axis 1, or of its columns (1, columns); one for those of zeros."""
    size = np.linalg.norm(matrix, axis=axis, keepdims=True)
    return np.where(size > 0.0, size, 1.0)


def independent_sparse(groups: Sequence[csr_matrix], weights: Array) -> Independent:
    """The same by elimination; of rows of one group that follow from one another any are kept."""
    work = _Elimination(scipy.sparse.csr_matrix(scipy.sparse.vstack(groups)), weights)
    found, first = [], 0
    for group in groups:
        rows = range(first, first := first + group.indptr.size - 1)
        found.append(np.array(sorted(work.eliminate(rows)), dtype=int) - rows.start)
    return Independent(tuple(found), np.array(sorted(work.pivots), dtype=int))


class _Elimination:
    """Rows as dictionaries of their entries, and for each column the rows that have one."""

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
        """Take some rows as pivots: those that are independent of all that were taken."""
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
        """Take rows of which at least so much is left, by columns with few entries first."""
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
        """The largest entry of a row, as it is and over the weight."""
        if row not in self.largest:
            entries, weights = self.rows[row], self.weights
            size = max(map(abs, entries.values()), default=0.0)
            self.largest[row] = (size, max((abs(one) / weights[j] for j, one in entries.items()), default=0.0))
        return self.largest[row]

    def _take(self, row: int, column: int) -> None:
        """Eliminate a column from all other rows by a row."""
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
        """Subtract a multiple of a pivot's row from another row."""
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
