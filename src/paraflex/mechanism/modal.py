"""Flexible body given by its matrices, from a finite-element program or entered by hand."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from paraflex.arguments import CheckedFields
from paraflex.errors import InputError
from paraflex.fem import ShapeIntegrals
from paraflex.fem.eigen import is_definite
from .damping import Damping
from .quantities import field_metadata, optional, positive

Row = Sequence[float]
Matrix = Sequence[Sequence[float]]

# Admissible asymmetry of a symmetric or skew matrix, relative to its largest entry: digits lost in files.
_ASYMMETRY = 1e-6
# Smallest positive eigenvalue of a matrix scaled to a unit diagonal; smaller ones are regarded as zero.
_SMALLEST_EIGENVALUE = 1e-12
# Descriptions of fields that all deformable bodies have.
MODES, DAMPING = "the number of modes of lowest frequency to keep", "a damping table"


@dataclass(frozen=True)
class ModalPoint(CheckedFields):
    """Material point of a body given by matrices, with nf flexible coordinates.

    Attributes
    ----------
    position : (x, y)
        Undeformed position in the body frame [m].
    shape : (2, nf) nested sequence
        Displacement per flexible coordinate in the body frame, N.
    slope : (nf,) sequence
        Rotation of the material per flexible coordinate, N2'.
    """

    _table = "point"

    _own = ("position", "shape", "slope")
    position: Row = field(metadata=field_metadata("[x, y] in the body frame in m"))
    shape: Matrix = field(metadata=field_metadata("two rows, displacement along x and y per flexible coordinate"))
    slope: Row = field(metadata=field_metadata("the rotation per flexible coordinate"))

    def __post_init__(self) -> None:
        super().__post_init__()
        _freeze(self, self._own)


class DeformableBody(CheckedFields):
    """Body with flexible coordinates, which are held at zero if its field `flexible` is False."""

    _table = "body"

    def as_rigid(self) -> Self:
        """Return the body without flexibility."""
        return replace(self, flexible=False)  # type: ignore[type-var]


@dataclass(frozen=True)
class ModalBody(DeformableBody):
    """Flexible body given by its constants, with displacements linear in nf flexible coordinates u of any kind.

    The symbols are those of the theory: s0 is the undeformed position of a mass element dm and N its displacement per
    coordinate. `inertia`, `mass_matrix` and `G1` include lumped moments of inertia. The coordinates must not contain a
    rigid motion of the body.

    Attributes
    ----------
    name : str
        Name of the body.
    mass : float
        Mass [kg].
    first_moment : (2,) sequence
        First moment S1, int s0 dm [kg m].
    inertia : float
        Moment of inertia about the origin of the body frame, I0 + J [kg m^2].
    mass_matrix : (nf, nf) nested sequence
        Mass matrix of the flexible coordinates, Mff.
    stiffness : (nf, nf) nested sequence
        Stiffness matrix of the flexible coordinates, K.
    S2 : (2, nf) nested sequence
        Inertia integral int N dm.
    I1 : (nf,) sequence
        Inertia integral int s0^T N dm.
    G1 : (nf,) sequence
        Inertia integral int (x N_y - y N_x) dm plus sum J N2' over lumped moments of inertia.
    G2 : (nf, nf) nested sequence
        Inertia integral int N_x^T N_y - N_y^T N_x dm, skew-symmetric.
    I2 : (nf, nf) nested sequence, optional
        Inertia integral int N^T N dm; by default the mass matrix, which is right without lumped moments of inertia.
    points : mapping of str to ModalPoint
        Named points; the first and the last are the ends, at which results report deflections.
    modes : int, optional
        Number of modes of lowest frequency retained as flexible coordinates; all by default.
    damping : RayleighDamping, ModalDamping or LossFactor, optional
        Structural damping; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: a rigid body of the same inertia.
    """

    _own = ("first_moment", "mass_matrix", "stiffness", "S2", "I1", "G1", "G2", "I2")
    name: str
    mass: float = field(metadata=field_metadata("the mass in kg", positive))
    first_moment: Row = field(metadata=field_metadata("[x, y], mass times the centre of mass in kg m"))
    inertia: float = field(
        metadata=field_metadata("the moment of inertia about the body frame's origin in kg m^2", positive)
    )
    mass_matrix: Matrix = field(metadata=field_metadata("rows of the mass matrix of the flexible coordinates"))
    stiffness: Matrix = field(metadata=field_metadata("rows of the stiffness matrix"))
    S2: Matrix = field(metadata=field_metadata("two rows, int N dm"))
    I1: Row = field(metadata=field_metadata("int s0^T N dm"))
    G1: Row = field(metadata=field_metadata("int (x N_y - y N_x) dm"))
    G2: Matrix = field(metadata=field_metadata("rows of the skew int (N_x^T N_y - N_y^T N_x) dm"))
    I2: Matrix | None = optional(None, "rows of int N^T N dm")
    points: Mapping[str, ModalPoint] = optional({}, "position, shape and slope of each named point")
    modes: int | None = optional(None, MODES)
    damping: Damping | None = optional(None, DAMPING)
    flexible: bool = optional(True, "false for a rigid body")

    def __post_init__(self) -> None:
        super().__post_init__()
        _freeze(self, self._own)

    @property
    def n_flexible(self) -> int:
        """Number of flexible coordinates before any reduction."""
        return len(self.stiffness)

    @property
    def integrals(self) -> ShapeIntegrals:
        """Shape integrals of the body, checked.

        Raises
        ------
        InputError
            Sizes are inconsistent, a number is not finite, or a matrix is not symmetric, skew or positive definite.
        """
        n = self.n_flexible
        if not n:
            raise InputError("has no flexible coordinates", field="stiffness", remedy="make it a rigid body")
        Mff = _symmetric(_array(self.mass_matrix, (n, n), "mass_matrix"), "mass_matrix")
        I2 = Mff if self.I2 is None else _symmetric(_array(self.I2, (n, n), "I2"), "I2")
        integrals = ShapeIntegrals(
            m=self.mass,
            S1=_array(self.first_moment, (2,), "first_moment"),
            S2=_array(self.S2, (2, n), "S2"),
            I0=self.inertia,
            I1=_array(self.I1, (n,), "I1"),
            I2=I2,
            G1=_array(self.G1, (n,), "G1"),
            G2=_symmetric(_array(self.G2, (n, n), "G2"), "G2", sign=-1.0),
            J=0.0,
            Jf=np.zeros(n),
            Jff=Mff - I2,
            K=_symmetric(_array(self.stiffness, (n, n), "stiffness"), "stiffness"),
            D=np.eye(n),
        )
        _check_definite(integrals)
        return integrals

    def point(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position (2,), shape (2, nf) and slope (nf,) of a named point.

        Raises
        ------
        InputError
            A size is inconsistent, or a number is not finite.
        """
        n, point, where = self.n_flexible, self.points[name], f"points.{name}"
        return (
            _array(point.position, (2,), f"{where}.position"),
            _array(point.shape, (2, n), f"{where}.shape"),
            _array(point.slope, (n,), f"{where}.slope"),
        )


def _check_definite(s: ShapeIntegrals) -> None:
    """Check that mass matrix and stiffness of the undeformed body and Mff - I2 are positive (semi-)definite."""
    _definite(s.Mff, "mass_matrix", "check it for coordinates that others make up")
    _definite(s.K, "stiffness", "leave out coordinates that move the body as a whole: its frame does that")
    whole = s.mass_matrix
    _definite(whole[:3, :3], "inertia", "check mass, first_moment and inertia: the latter is about the frame's origin")
    _definite(whole, "mass_matrix", "check S2 and G1: they couple too much")
    sizes = np.sqrt(np.diag(s.Mff))
    if np.linalg.eigvalsh(s.Jff / np.outer(sizes, sizes))[0] < -_ASYMMETRY:
        raise InputError(
            "is more than the mass matrix", field="I2", remedy="lumped moments of inertia only add to that"
        )


def _definite(matrix: np.ndarray, field: str, remedy: str) -> None:
    if not is_definite(matrix, _SMALLEST_EIGENVALUE):
        raise InputError("is not positive definite", field=field, remedy=remedy)


def _symmetric(matrix: np.ndarray, field: str, sign: float = 1.0) -> np.ndarray:
    """Return the symmetric part of a nearly symmetric matrix, or with sign -1 the skew part of a nearly skew one."""
    other = sign * matrix.T
    if np.max(np.abs(matrix - other)) > _ASYMMETRY * np.max(np.abs(matrix)):
        raise InputError(
            "is not symmetric" if sign > 0.0 else "is not skew-symmetric", field=field, remedy="check its entries"
        )
    return 0.5 * (matrix + other)


def _array(values: Any, shape: tuple[int, ...], field: str) -> np.ndarray:
    size = " x ".join(map(str, shape))
    try:
        array = np.array(values)
        array = array if array.dtype.kind == "c" else array.astype(float)
    except (TypeError, ValueError):
        raise InputError("is not a table of numbers", field=field, remedy=f"give {size} of them") from None
    if array.shape != shape:
        found = " x ".join(map(str, array.shape)) or "one"
        raise InputError(
            "not of the size of the stiffness matrix", field=field, value=found, remedy=f"give {size} numbers"
        )
    if not np.all(np.isfinite(array)):
        raise InputError("not all finite numbers", field=field, remedy=f"give {size} of them")
    return array


def _freeze(instance: Any, names: Iterable[str]) -> None:
    """Replace arrays and lists by tuples, which compare by value."""
    for name in names:
        object.__setattr__(instance, name, _tuples(getattr(instance, name)))


def _tuples(values: Any) -> Any:
    if isinstance(values, np.ndarray):
        values = values.tolist()
    return tuple(map(_tuples, values)) if isinstance(values, (list, tuple)) else values
