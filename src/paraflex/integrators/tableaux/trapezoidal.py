"""The trapezoidal rule: A-stable, of order 2, without any damping. Its error is estimated from the last step."""

from paraflex.integrators.tableaux.make import make_tableau

TRAPEZOIDAL = make_tableau([["0"], ["1/2", "1/2"]], error_order=2, nodes=[0, 1])
