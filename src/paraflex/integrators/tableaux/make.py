"""Base class of schemes with a Butcher tableau, and functions that make a tableau from its rows."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import ClassVar

import numpy as np

from paraflex.integrators.method import EQUATIONS_INDEX_1, Family, NativeMethod, Treatment
from paraflex.kernel.run_state import Tableau as Tableau

Number = str | float


class ESDIRK(NativeMethod):
    """Scheme with one diagonal element, an explicit first stage and a last stage at the end of the step.

    Attributes
    ----------
    tableau : Tableau
        Butcher tableau, from `make_tableau`.
    """

    family = Family.ESDIRK
    form = EQUATIONS_INDEX_1
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.BAUMGARTE, Treatment.PROJECTION, Treatment.GGL)
    tableau: ClassVar[Tableau]

    @property
    def scheme(self) -> Tableau:
        """Scheme as the kernel's tableau."""
        return self.tableau


def make_tableau(
    rows: Sequence[Sequence[Number]],
    companion: Sequence[Number] = (),
    *,
    error_order: int,
    nodes: Sequence[int],
    dense: Sequence[int] | None = None,
) -> Tableau:
    """Return a tableau from the lower triangle of A, whose last row is b.

    Parameters
    ----------
    rows : sequence of sequences
        Rows of A, with fractions as strings, or numbers; c is their sums.
    companion : sequence
        Weights b^ of the embedded formula; without them the error is estimated from the last step's acceleration.
    error_order : int
        Order of the estimated error per unit of time in h.
    nodes : sequence of int
        Stages at different times, ascending, through which multipliers are interpolated.
    dense : sequence of int, optional
        Stages accurate enough for interpolation of q and v; first and last by default.
    """
    stages = len(rows)
    A = np.zeros((stages, stages))
    for i, row in enumerate(rows):
        A[i, : len(row)] = [_value(entry) for entry in row]
    b_hat = np.array([_value(entry) for entry in companion])
    return Tableau(
        A=A,
        c=A.sum(axis=1),
        error=A[-1] - b_hat if companion else b_hat,
        dense=np.array([0, stages - 1] if dense is None else dense),
        nodes=np.array(nodes),
        order=error_order,
        newmark=np.zeros(0),
    )


def paired_rows(diagonal: Number, rows: Sequence[Sequence[Number]]) -> list[list[Number]]:
    """Return the rows of A for methods whose rows have two equal first entries, given once each from the third row on.

    The given rows have the entries before the diagonal. Methods of stage order two by Kennedy and Carpenter have such
    rows.
    """
    return [[0.0], [diagonal, diagonal], *([row[0], *row, diagonal] for row in rows)]


def _value(entry: Number) -> float:
    return float(Fraction(entry)) if isinstance(entry, str) else entry
