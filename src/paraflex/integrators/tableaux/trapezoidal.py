"""Trapezoidal rule: A-stable, of order 2, without any damping. Its error is estimated from the last step."""

from typing import ClassVar

from paraflex.integrators.tableaux.make import ESDIRK, Tableau, make_tableau


class Trapezoidal(ESDIRK):
    """Trapezoidal rule: A-stable, without any damping."""

    name = "trapezoidal"
    title = "Trapezoidal rule"
    order = 2
    source = "Hairer and Wanner (1996), Solving ODEs II, IV.3"

    tableau: ClassVar[Tableau] = make_tableau([["0"], ["1/2", "1/2"]], error_order=2, nodes=[0, 1])
