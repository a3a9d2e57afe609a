"""ESDIRK schemes with their Butcher tableaux: explicit first stage, one diagonal element, stiffly accurate."""

from collections.abc import Sequence
from fractions import Fraction
from math import sqrt
from typing import ClassVar

import numpy as np

from paraflex.kernel.run_state import Tableau
from .method import EQUATIONS_INDEX_1, Family, NativeMethod, Treatment

Number = str | float


class ESDIRK(NativeMethod):
    """Scheme with one diagonal element, an explicit first stage and a last stage at the end of the step.

    Attributes
    ----------
    tableau : Tableau
        Butcher tableau, from `make_tableau`.
    """

    family = Family.ESDIRK
    form = EQUATIONS_INDEX_1
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.BAUMGARTE, Treatment.PROJECTION, Treatment.GGL)
    tableau: ClassVar[Tableau]

    @property
    def scheme(self) -> Tableau:
        """Scheme as the kernel's tableau."""
        return self.tableau


def make_tableau(
    rows: Sequence[Sequence[Number]],
    companion: Sequence[Number] = (),
    *,
    error_order: int,
    nodes: Sequence[int],
    dense: Sequence[int] | None = None,
) -> Tableau:
    """Return a tableau from the lower triangle of A, whose last row is b.

    Parameters
    ----------
    rows : sequence of sequences
        Rows of A, with fractions as strings, or numbers; c is their sums.
    companion : sequence
        Weights b^ of the embedded formula; without them the error is estimated from the last step's acceleration.
    error_order : int
        Order of the estimated error per unit of time in h.
    nodes : sequence of int
        Stages at different times, ascending, through which multipliers are interpolated.
    dense : sequence of int, optional
        Stages accurate enough for interpolation of q and v; first and last by default.
    """
    stages = len(rows)
    A = np.zeros((stages, stages))
    for i, row in enumerate(rows):
        A[i, : len(row)] = [_value(entry) for entry in row]
    b_hat = np.array([_value(entry) for entry in companion])
    return Tableau(
        A=A,
        c=A.sum(axis=1),
        error=A[-1] - b_hat if companion else b_hat,
        dense=np.array([0, stages - 1] if dense is None else dense),
        nodes=np.array(nodes),
        order=error_order,
        newmark=np.zeros(0),
    )


def paired_rows(diagonal: Number, rows: Sequence[Sequence[Number]]) -> list[list[Number]]:
    """Return the rows of A for methods whose rows have two equal first entries, given once each from the third row on.

    The given rows have the entries before the diagonal. Methods of stage order two by Kennedy and Carpenter have such
    rows.
    """
    return [[0.0], [diagonal, diagonal], *([row[0], *row, diagonal] for row in rows)]


def _value(entry: Number) -> float:
    return float(Fraction(entry)) if isinstance(entry, str) else entry


_D2 = 1.0 - sqrt(2.0) / 2.0
_W2 = sqrt(2.0) / 4.0
_D3 = "1767732205903/4055673282236"
_HAT4 = "-71925161075/3900939759889"
_HAT5 = "-582099335757/7214068459310"


class Trapezoidal(ESDIRK):
    """Trapezoidal rule: A-stable, without any damping."""

    name = "trapezoidal"
    title = "Trapezoidal rule"
    order = 2
    source = "Hairer and Wanner (1996), Solving ODEs II, IV.3"

    tableau: ClassVar[Tableau] = make_tableau([["0"], ["1/2", "1/2"]], error_order=2, nodes=[0, 1])


class TRBDF2(ESDIRK):
    """Trapezoidal rule followed by the second backward difference formula: L-stable.

    The trapezoidal rule leads to gamma h, the second backward difference formula from there to h; gamma = 2 - sqrt 2
    gives both stages the same diagonal element, d = gamma / 2, and makes the scheme L-stable. The embedded formula has
    order 3.
    """

    name = "tr-bdf2"
    title = "TR-BDF2"
    order = 2
    source = "Hosea and Shampine (1996), Appl. Numer. Math. 20, 21-37"
    newton_fraction: ClassVar[float] = 0.5

    tableau: ClassVar[Tableau] = make_tableau(
        [[0.0], [_D2, _D2], [_W2, _W2, _D2]],
        [(1.0 - _W2) / 3.0, (3.0 * _W2 + 1.0) / 3.0, _D2 / 3.0],
        error_order=2,
        nodes=[0, 1, 2],
        dense=[0, 1, 2],
    )


class HighOrderESDIRK(ESDIRK):
    """Scheme of order three or more, whose error estimate is small beside what Newton's iteration may leave."""

    newton_fraction: ClassVar[float] = 3e-3
    fixed_newton_fraction: ClassVar[float] = 1e-3


class ESDIRK3(HighOrderESDIRK):
    """ESDIRK3(2)4L[2]SA: L-stable."""

    name = "esdirk3"
    title = "ESDIRK 3(2)"
    order = 3
    source = "Kennedy and Carpenter (2003), Appl. Numer. Math. 44, 139-181"

    tableau: ClassVar[Tableau] = make_tableau(
        [
            ["0"],
            [_D3, _D3],
            ["2746238789719/10658868560708", "-640167445237/6845629431997", _D3],
            ["1471266399579/7840856788654", "-4482444167858/7529755066697", "11266239266428/11593286722821", _D3],
        ],
        [
            "2756255671327/12835298489170", "-10771552573575/22201958757719", "9247589265047/10645013368117",
            "2193209047091/5459859503100",
        ],
        error_order=2,
        nodes=[0, 2, 3],
    )  # fmt: skip


class ESDIRK4(HighOrderESDIRK):
    """ESDIRK4(3)6L[2]SA: L-stable."""

    name = "esdirk4"
    title = "ESDIRK 4(3)"
    order = 4
    source = "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"

    tableau: ClassVar[Tableau] = make_tableau(
        paired_rows("1/4", [
            ["-1356991263433/26208533697614"],
            ["-1778551891173/14697912885533", "7325038566068/12797657924939"],
            ["-24076725932807/39344244018142", "9344023789330/6876721947151", "11302510524611/18374767399840"],
            ["657241292721/9909463049845", "1290772910128/5804808736437", "1103522341516/2197678446715", "-3/28"],
        ]),
        [
            _HAT4, _HAT4, "2973346383745/8160025745289", "3972464885073/7694851252693", "-263368882881/4213126269514",
            "3295468053953/15064441987965",
        ],
        error_order=3,
        nodes=[0, 2, 3, 5],
    )  # fmt: skip


class ESDIRK5(HighOrderESDIRK):
    """ESDIRK5(4)7L[2]SA2: L-stable."""

    name = "esdirk5"
    title = "ESDIRK 5(4)"
    order = 5
    source = "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"

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
            _HAT5, _HAT5, "615023338567/3362626566945", "3192122436311/6174152374399", "6156034052041/14430468657929",
            "-1011318518279/9693750372484", "1914490192573/13754262428401",
        ],
        error_order=4,
        nodes=[0, 3, 1, 4, 6],
    )  # fmt: skip
