"""Butcher tableaux of ESDIRK schemes: explicit first stage, one diagonal, stiffly accurate."""

from __future__ import annotations

from math import sqrt

import numpy as np

from paraflex.kernel.run_state import Tableau

# TR-BDF2 (Bank et al. 1985, as an ESDIRK by Hosea and Shampine 1996). The trapezoidal rule leads to gamma h, the
# second backward difference formula from there to h; gamma = 2 - sqrt 2 gives both stages one diagonal,
# d = gamma / 2, and makes the scheme L-stable.
_GAMMA = 2.0 - sqrt(2.0)
_D = _GAMMA / 2.0
_W = sqrt(2.0) / 4.0
_B = np.array([_W, _W, _D])
# The companion of order 3.
_B_HAT = np.array([(1.0 - _W) / 3.0, (3.0 * _W + 1.0) / 3.0, _D / 3.0])

TR_BDF2 = Tableau(
    A=np.array([[0.0, 0.0, 0.0], [_D, _D, 0.0], _B]),
    c=np.array([0.0, _GAMMA, 1.0]),
    error=_B - _B_HAT,
    dense=np.array([0, 1, 2]),
    order=2,
)
