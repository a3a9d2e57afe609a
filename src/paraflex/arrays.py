"""Arrays of numbers in annotations; docstrings have their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Real, or complex where a complex step carries a derivative.
Numbers = NDArray[Any]


def side_by_side(columns: Sequence[Numbers], rows: int, *inner: int) -> Numbers:
    """Columns (rows, ...) as an array (rows, columns, ...), of whose last dimensions `inner` are the sizes."""
    return np.stack(columns, axis=1) if columns else np.zeros((rows, 0, *inner))
