"""TR-BDF2 (Bank et al. 1985, as an ESDIRK by Hosea and Shampine 1996).

The trapezoidal rule leads to gamma h, the second backward difference formula from there to h; gamma = 2 - sqrt 2 gives
both stages the same diagonal element, d = gamma / 2, and makes the scheme L-stable. The embedded formula has order 3.
"""

from math import sqrt
from typing import ClassVar

from paraflex.integrators.tableaux.make import ESDIRK, Tableau, make_tableau

_D = 1.0 - sqrt(2.0) / 2.0
_W = sqrt(2.0) / 4.0


class TRBDF2(ESDIRK):
    """Trapezoidal rule followed by the second backward difference formula: L-stable."""

    name = "tr-bdf2"
    title = "TR-BDF2"
    order = 2
    source = "Hosea and Shampine (1996), Appl. Numer. Math. 20, 21-37"

    tableau: ClassVar[Tableau] = make_tableau(
        [[0.0], [_D, _D], [_W, _W, _D]],
        [(1.0 - _W) / 3.0, (3.0 * _W + 1.0) / 3.0, _D / 3.0],
        error_order=2,
        nodes=[0, 1, 2],
        dense=[0, 1, 2],
    )
