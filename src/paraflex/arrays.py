"""Types of numeric arrays for annotations; the docstrings give the shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Indices = NDArray[np.int64]
# Real, or complex where a complex step carries a derivative.
Numbers = NDArray[Any]
