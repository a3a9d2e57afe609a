"""Layout of the kernels' input (`PackedSystem`, `Signals`) and work arrays (`Workspace`).

There is one record per body, port, marker, side of a motor and constraint row; data of variable length are in flat
arrays. A *marker* is a material point of a body with its shape rows. A constraint row is a weighted sum over *ports*;
each port is an end on a moving body, and several may be on one body. A rotary motor has a *side* on each moving body of
its joint; a linear motor is an axis.
"""

from typing import Annotated, NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices, Records
from .arrays import Floats, allocated, apart
from .compiling import by_reference
from .vectors import padded

# Rows of PackedSystem.modal.
S2X, S2Y, I1, GJ, OMEGA2, DAMPING = range(6)
# Rows of PackedSystem.shape.
NX, NY, SLOPE = range(3)
# Port kinds: both coordinates of a point, an angle, one end of an axis.
POINT, ANGLE, AXIS = range(3)
# Row kinds: Phi = 0, or a row whose multiplier is the torque or force of a spring, a damper or dry friction.
CONSTRAINT, SPRING, DAMPER, FRICTION = range(4)
# Kinds of quantities of a motion, on which forces depend.
OF_ANGLE, OF_AXIS, OF_COORDINATE = range(3)
# Operations of laws: without operands, of one operand, of two.
NUMBER, QUANTITY, TIME, TABLE, NEGATE, ABS, SIN, COS, TAN, ASIN, ACOS, ATAN, SINH, COSH, TANH, EXP, LOG, SQRT = range(
    18
)
ADD, SUBTRACT, MULTIPLY, DIVIDE, MIN, MAX, POWER = range(18, 25)
# Weights of Phi'', Phi' and Phi for constraints on accelerations, without Baumgarte's terms.
INDEX_1 = (1.0, 0.0, 0.0)
# Number of Gauss points of an element. Beside their terms in a vector stands, in BASE, the sum over the elements
# before; FULL is a row of PackedSystem.spans.
GAUSS, BASE, FULL = 6, 6, 7
# Rows of Workspace.flex: M_phif and 1/(1 + b omega^2).
MPF, DINV = range(2)


def _record(*fields: tuple[str, type]) -> np.dtype[np.void]:
    return np.dtype(list(fields), align=True)


BODY = _record(
    ("offset", np.int64),  # first coordinate of the body in q
    ("nf", np.int64),
    ("flex", np.int64),  # first column of the body in `modal` and `Workspace.flex`
    ("square", np.int64),  # first entry of its nf x nf matrices
    ("port", np.int64),  # first of its ports, port .. port_end - 1
    ("port_end", np.int64),
    ("motor", np.int64),  # first of its sides of rotary motors, motor .. motor_end - 1
    ("motor_end", np.int64),
    ("columns", np.int64),  # first entry of its nf x width matrix in `columns`
    ("width", np.int64),
    ("products", np.int64),  # first entry of its nf x 2 stride matrix in `products`
    ("stride", np.int64),
    ("damping", np.int64),  # first entry of its nf x stride matrix in `damping`, -1 where damping is diagonal
    ("block", np.int64),  # first entry of its parts x lanes block J M^-1 J^T in Workspace.blocks
    ("parts", np.int64),  # rows of its ports' Jacobians
    ("lanes", np.int64),  # columns of `Workspace.jac` and `Workspace.response`: these rows and three more, padded
    ("jac", np.int64),  # first entry of its (3 + nf) x lanes matrices there
    ("slopes", np.int64),  # number of its Gauss points in second-order geometry, 0 in linear geometry
    ("pitch", np.int64),  # lanes of its mass points, by element
    ("step", np.int64),  # lanes of an element: its GAUSS Gauss points, then its lumps, padded
    ("places", np.int64),  # first entry of its nf x 3 pitch matrix in `places`
    ("spans", np.int64),  # first entry of its pitch x LANES matrices in `spans` and `weights`
    # First entries of its coordinates in `kinds`: of those that move mass points along it, and across it.
    ("along", np.int64),
    ("across", np.int64),
    ("across_end", np.int64),
    ("inertias", np.int64),  # first entry of its 3 x pitch matrix in `inertias`
    # 1 if its iteration matrix is dense: in second-order geometry, or if damping couples its modes.
    ("full", np.int64),
    ("dense", np.int64),  # first entry of its (3 + nf) x (3 + nf) matrices in the workspace, with padded rows
    ("m", np.float64),
    ("S1x", np.float64),
    ("S1y", np.float64),
    ("I0", np.float64),  # I0 + J, with the lumped moments of inertia
)
MARKER = _record(
    ("body", np.int64),
    ("shape", np.int64),  # first column of its rows in `shape`
    ("column", np.int64),  # its column x in `columns`, followed by y and slope
    ("bending", np.int64),  # first entry of its matrix in `bending`, -1 if it has none
    ("x", np.float64),
    ("y", np.float64),
)
PORT = _record(
    ("marker", np.int64),
    ("kind", np.int64),
    ("row", np.int64),  # first constraint row
    ("rows", np.int64),  # 2 for a point, else 1
    # Number of rows in the body frame that these are computed from: x and y of a point; an angle; x and y of an
    # axis, and if the body carries the axis also the angle, and the deflection along a track.
    ("parts", np.int64),
    ("local", np.int64),  # index of the first of them among those of its body
    ("axis", np.int64),  # axis of which it is an end, -1 for none
    # Factor of its contribution to the row: for a joint +1 on side b, -1 on side a.
    ("weight", np.float64),
)
MOTOR_SIDE = _record(("marker", np.int64), ("signal", np.int64), ("sign", np.float64))
LOAD = _record(
    ("marker", np.int64),
    ("fx", np.float64),  # in the ground frame
    ("fy", np.float64),
    ("torque", np.float64),
    ("sign", np.float64),  # 1, or -1 for the reaction to a load
    # Signals of the time-dependent components, -1 for constant ones, -2 - k for law k.
    ("x_signal", np.int64),
    ("y_signal", np.int64),
    ("torque_signal", np.int64),
)
# Fields of elements between two ends, a and b.
_ENDS = [
    ("a", np.int64),  # marker of end a, -1 on the ground; it carries an axis, along which b is measured
    ("b", np.int64),  # marker of end b, -1 on the ground
    ("ax", np.float64),  # positions of ends on the ground
    ("ay", np.float64),
    ("bx", np.float64),
    ("by", np.float64),
]
LINE = _record(
    *_ENDS,
    ("stiffness", np.float64),
    ("length", np.float64),
    ("damping", np.float64),
    ("law", np.int64),  # characteristic, -1 for none
)
# A law has the operations first .. end - 1, whose operands a and b are numbers of its operations. The operand a of a
# quantity or of the time is the number of the quantity or of the signal; b of a table is that of the curve.
LAW = _record(("first", np.int64), ("end", np.int64))
OPERATION = _record(("code", np.int64), ("a", np.int64), ("b", np.int64), ("number", np.float64))
QUANTITY_RECORD = _record(
    *_ENDS,
    ("angle", np.float64),  # as for an axis
    ("between", np.int64),
    ("kind", np.int64),  # angle of b less that of a, travel of b along an axis of a, coordinate of b
    ("axis", np.int64),  # 0 for x, 1 for y
    ("rate", np.int64),  # 1 for the rate of the quantity, else 0
)
AXIS_RECORD = _record(
    *_ENDS,
    ("angle", np.float64),  # angle of the axis relative to the marker that carries it
    ("row", np.int64),  # constraint row, -1 for the axis of a motor
    ("weight", np.float64),  # factor of its value in that row
    ("signal", np.int64),  # signal of the motor, -1 for none
    ("track", np.int64),  # deflection that a sliding point follows, -1 for none
    ("between", np.int64),  # 1 if it points from a to b, so that its value is their distance, else 0
)
TRACK = _record(
    ("first", np.int64),  # first of its breaks
    ("pieces", np.int64),
    ("coefficients", np.int64),  # first of its coefficients, ordered by piece, power and flexible coordinate
)
ROW = _record(
    ("kind", np.int64),
    ("signal", np.int64),  # prescribed value in time, -1 for none
    ("ground", np.float64),  # contribution of points on the ground to Phi, less the rest angle of a spring
    # Compliance of a spring, angle - rest = compliance * lambda, or of a damper, rate = compliance * lambda; for
    # friction the inverse of its steepest slope; else zero.
    ("compliance", np.float64),
    ("limit", np.float64),  # limit of friction, lambda = limit tanh(rate / (compliance limit))
    ("unit", np.float64),  # scale of Phi: the size of the mechanism for a length, 1 for an angle
    ("second", np.int64),  # 1 if it is the second of two rows that hold one point, else 0
    ("first", np.int64),  # first column of the row in the envelope of the Schur complement
    ("start", np.int64),  # storage index of that column
)


@by_reference
class PackedSystem(NamedTuple):
    """Constants of a system."""

    bodies: Records
    markers: Records
    ports: Records
    motor_sides: Records
    loads: Records
    laws: Records  # laws of loads over the motion, with their operations, quantities and tables
    operations: Records
    quantities: Records
    curve_start: Indices  # first break of each table, then the number of all breaks; pieces as in `Signals`
    curve_breaks: Array
    curve_coefficients: Array
    lines: Records  # springs and dampers between points
    axes: Records
    tracks: Records
    track_breaks: Array
    track_coefficients: Array
    rows: Records
    modal: Array  # (6, total nf): S2x, S2y, I1, G1 + Jf, omega^2, diagonal of the damping matrix
    damping: Array  # nf x stride, off-diagonal part of the damping matrix of bodies that have one
    I2: Array  # nf x nf matrix of every body, row by row
    G2: Array
    shape: Array  # (3, total): Nx, Ny, N2' of every marker
    # The same data laid out for vectors: contributions of a body's coordinates to its sums (see `kernel.sums`), and
    # columns of G2 and I2.
    columns: Array
    products: Array
    # Data of second-order geometry. `bending` is None without second-order geometry and dense iteration matrices;
    # kernels are then compiled without the code for these.
    bending: Array | None  # nf x stride matrix of every marker that bending displaces: f = u . bending u
    # Data of every body's mass points: Nx, Ny and N2' of all points by coordinate; x, mass and moment of inertia;
    # numbers of the coordinates with Nx, and of those with Ny and N2'. By vector of points of one element: in `spans`
    # the weights of these points by Gauss point, in the row BASE the weights of the sum over the elements before, and
    # in the row FULL those of the Gauss points at the element's end; in `weights` those of the Gauss points by point.
    places: Array
    spans: Array
    weights: Array
    inertias: Array
    kinds: Indices
    total_mass: float
    size: float  # size of the mechanism [m], a power of two, see `dynamics.scale`
    gravity: Array  # (2,) gravity in the ground frame [m/s^2]


@by_reference
class Signals(NamedTuple):
    """Time profiles as piecewise quintics: motor torques first, then loads, then prescribed values."""

    start: Indices  # first break of each signal, then the number of all breaks
    breaks: Array
    coefficients: Array  # (breaks, 6), ascending powers of t - break; a signal's last piece is unused


@by_reference
class PointScratch(NamedTuple):
    """Additional work arrays, by mass point, of one body of second-order geometry."""

    q: Annotated[Floats, "sums"]  # Nx u, Ny u and slopes
    v: Annotated[Floats, "sums"]
    a: Annotated[Floats, "sums"]
    shares: Annotated[Floats, "sums"]  # force on each
    axial: Annotated[Floats, "pitch"]  # axial forces at the Gauss points
    shortening: Annotated[Floats, "sums"]  # -w^2/2 for the slopes w, two derivatives; see `bending.note_bases`
    rows: Annotated[Floats, "tangents"]  # ds/du: x and y of all points by coordinate
    B_q: Annotated[Floats, "stride"]  # a marker's bending matrix times u
    B_v: Annotated[Floats, "stride"]


@by_reference
class Scratch(NamedTuple):
    """Work arrays for the terms of one body: sums of u, u' and u'' and results computed from them."""

    q: Annotated[Floats, "width"]  # sums of u
    v: Annotated[Floats, "width"]
    a: Annotated[Floats, "width"]
    shares: Annotated[Floats, "width"]  # force on each sum
    G2_q: Annotated[Floats, "stride"]  # G2 u
    G2_v: Annotated[Floats, "stride"]
    I2_q: Annotated[Floats, "stride"]
    lanes: Annotated[Floats, "lanes"]
    rigid: Annotated[Floats, "coordinates"]
    turn: Annotated[Floats, 2]  # cosine and sine of the body's angle
    registers: Annotated[Floats, "registers"]  # values of the operations of a law
    points: PointScratch | None  # None for linear geometry


@by_reference
class Workspace(NamedTuple):
    """All work arrays of the kernels, made once per run."""

    f: Annotated[Floats, "n"]  # residual of the equations of motion
    x: Annotated[Floats, "n"]  # solution of a linear system
    rows: Annotated[Floats, "m"]  # constraint residual
    mu: Annotated[Floats, "m"]  # solution for the multipliers
    q: Annotated[Floats, "n"]
    v: Annotated[Floats, "n"]
    scratch: Scratch
    step: Annotated[Floats, 1]  # coefficient b of the factor
    axes: Annotated[Floats, "axes", 4]  # e, n . d and the place of a sliding point at the last `orient`
    compliance: Annotated[Floats, "m"]  # compliance of the rows, of friction at the last `note_friction`
    frame: Annotated[Floats, "bodies", 12]  # cos, sin, s, M_phiphi and the factor of the rigid block, at the factor
    flex: Annotated[Floats, 2, "flexible"]
    # By body, coordinate and lane: the Jacobian rows of the body's ports in its frame; these rows times the inverse of
    # the iteration matrix, then the part of a force on the coordinate that is passed to the three rigid coordinates.
    jac: Annotated[Floats, "lanes"]
    response: Annotated[Floats, "lanes"]
    blocks: Annotated[Floats, "blocks"]  # J M^-1 J^T of every body, in its frame
    schur: Annotated[Floats, "envelope"]  # envelope of the Schur complement, then its Cholesky factor
    redundant: Annotated[Floats, "m"]  # relative pivot up to which a row redundant at the start is dependent, else 0
    least: Annotated[Floats, 2]  # smallest relative pivot of the other rows, and index of its row
    # Matrices of bodies with a dense iteration matrix; None if `PackedSystem.bending` is None:
    mass: Array | None  # M, rows padded, as in the next two
    dense: Array | None  # Cholesky factor of M + b (K + K_g)
    inverse: Array | None  # inverse of M + b (K + K_g)
    geometric: Array | None  # K_g, nf^2 entries per body


def sizes_of(system: PackedSystem) -> dict[str, int]:
    """Return the number of coordinates n, of constraint rows m, and of operations of the longest law."""
    longest = int(np.max(system.laws["end"] - system.laws["first"], initial=0))
    return {"n": int(np.sum(3 + system.bodies["nf"])), "m": system.rows.size, "registers": longest}


def make_workspace(system: PackedSystem) -> Workspace:
    """Allocate the workspace of a system."""
    bodies, rows, width = system.bodies, system.rows, 3 + system.bodies["nf"]
    sizes = {
        **sizes_of(system),
        "axes": system.axes.size,
        "bodies": bodies.size,
        "flexible": system.modal.shape[1],
        "lanes": int(np.sum(width * bodies["lanes"])),
        "blocks": int(np.sum(bodies["parts"] * bodies["lanes"])),
        "envelope": int(np.sum(1 + np.arange(rows.size) - rows["first"])),
    }
    full = width[bodies["full"] > 0]
    dense = dict.fromkeys(("mass", "dense", "inverse"), sum(size * padded(int(size)) for size in full))
    matrices = {
        name: None if system.bending is None else apart(int(size))
        for name, size in {**dense, "geometric": system.I2.size}.items()
    }
    work = allocated(Workspace, sizes, scratch=make_scratch(system), **matrices)
    work.compliance[:] = rows["compliance"]
    return work


def make_scratch(system: PackedSystem) -> Scratch:
    """Allocate the work arrays for the terms of one body."""
    names = ("nf", "width", "stride", "lanes", "pitch")
    nf, width, stride, lanes, pitch = (int(system.bodies[name].max(initial=0)) for name in names)
    sizes = {"width": width, "stride": stride, "lanes": lanes, "coordinates": padded(3 + nf), **sizes_of(system)}
    points = None
    if system.bending is not None:
        points = allocated(
            PointScratch, {"sums": 3 * pitch, "pitch": pitch, "tangents": 2 * pitch * nf, "stride": stride}
        )
    return allocated(Scratch, sizes, points=points)
