"""ESDIRK4(3)6L[2]SA of Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244: order 4, L-stable."""

from typing import ClassVar

from paraflex.integrators.tableaux.make import ESDIRK, Tableau, make_tableau, paired_rows

_HAT = "-71925161075/3900939759889"


class ESDIRK4(ESDIRK):
    """ESDIRK4(3)6L[2]SA: L-stable."""

    name = "esdirk4"
    title = "ESDIRK 4(3)"
    order = 4
    source = "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"
    newton_fraction: ClassVar[float] = 1e-3

    tableau: ClassVar[Tableau] = make_tableau(
        paired_rows("1/4", [
            ["-1356991263433/26208533697614"],
            ["-1778551891173/14697912885533", "7325038566068/12797657924939"],
            ["-24076725932807/39344244018142", "9344023789330/6876721947151", "11302510524611/18374767399840"],
            ["657241292721/9909463049845", "1290772910128/5804808736437", "1103522341516/2197678446715", "-3/28"],
        ]),
        [
            _HAT, _HAT, "2973346383745/8160025745289", "3972464885073/7694851252693", "-263368882881/4213126269514",
            "3295468053953/15064441987965",
        ],
        error_order=3,
        nodes=[0, 2, 3, 5],
    )  # fmt: skip
