"""ESDIRK5(4)7L[2]SA2 of Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244: order 5, L-stable."""

from typing import ClassVar

from paraflex.integrators.tableaux.make import ESDIRK, Tableau, make_tableau, paired_rows

_HAT = "-582099335757/7214068459310"


class ESDIRK5(ESDIRK):
    """ESDIRK5(4)7L[2]SA2: L-stable."""

    name = "esdirk5"
    title = "ESDIRK 5(4)"
    order = 5
    source = "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"
    newton_fraction: ClassVar[float] = 1e-3

    tableau: ClassVar[Tableau] = make_tableau(
        paired_rows("23/125", [
            ["791020047304/3561426431547"],
            ["-158159076358/11257294102345", "-85517644447/5003708988389"],
            ["-1653327111580/4048416487981", "1514767744496/9099671765375", "14283835447591/12247432691556"],
            [
                "-4540011970825/8418487046959", "-1790937573418/7393406387169", "10819093665085/7266595846747",
                "4109463131231/7386972500302",
            ],
            [
                "-188593204321/4778616380481", "2809310203510/10304234040467", "1021729336898/2364210264653",
                "870612361811/2470410392208", "-1307970675534/8059683598661",
            ],
        ]),
        [
            _HAT, _HAT, "615023338567/3362626566945", "3192122436311/6174152374399", "6156034052041/14430468657929",
            "-1011318518279/9693750372484", "1914490192573/13754262428401",
        ],
        error_order=4,
        nodes=[0, 3, 1, 4, 6],
    )  # fmt: skip
