"""Types of numeric arrays for annotations; the docstrings give the shapes."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike as ArrayLike, NDArray as NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
# Real, or complex where a complex step carries a derivative.
Numbers = NDArray[Any]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Records of the kernels: arrays with named fields.
Records = NDArray[np.void]
