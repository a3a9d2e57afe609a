"""ESDIRK3(2)4L[2]SA of Kennedy and Carpenter (2003), Appl. Numer. Math. 44, 139-181: order 3, L-stable."""

from typing import ClassVar

from paraflex.integrators.tableaux.make import ESDIRK, Tableau, make_tableau

_D = "1767732205903/4055673282236"


class ESDIRK3(ESDIRK):
    """ESDIRK3(2)4L[2]SA: L-stable."""

    name = "esdirk3"
    title = "ESDIRK 3(2)"
    order = 3
    source = "Kennedy and Carpenter (2003), Appl. Numer. Math. 44, 139-181"
    newton_fraction: ClassVar[float] = 1e-3

    tableau: ClassVar[Tableau] = make_tableau(
        [
            ["0"],
            [_D, _D],
            ["2746238789719/10658868560708", "-640167445237/6845629431997", _D],
            ["1471266399579/7840856788654", "-4482444167858/7529755066697", "11266239266428/11593286722821", _D],
        ],
        [
            "2756255671327/12835298489170", "-10771552573575/22201958757719", "9247589265047/10645013368117",
            "2193209047091/5459859503100",
        ],
        error_order=2,
        nodes=[0, 2, 3],
    )  # fmt: skip
