"""Arrays of numbers, as annotations name them; docstrings say their shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
