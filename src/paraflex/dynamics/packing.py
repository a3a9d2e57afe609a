"""Records for the kernels from a system's constraints, motors and bodies; names of the rows."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from paraflex.arrays import Array, Indices, Records
from paraflex.expressions.program import OPERATIONS, TIME
from paraflex.fem import MassPoints
from paraflex.kernel import packed as codes
from paraflex.kernel.packed import (
    ANGLE,
    AXIS,
    AXIS_RECORD,
    BASE,
    BODY,
    FULL,
    GAUSS,
    LAW,
    LINE,
    LOAD,
    MARKER,
    MOTOR_SIDE,
    OF_ANGLE,
    OF_AXIS,
    OF_COORDINATE,
    OPERATION,
    POINT,
    PORT,
    QUANTITY_RECORD,
    ROW,
    TABLE,
    TRACK,
    PackedSystem,
)
from paraflex.kernel.sums import FIRST_MARKER
from paraflex.kernel.vectors import LANES, padded
from paraflex.mechanism import ForceLaw, Joint, Mechanism, MotionQuantity, PointRef, TimeProfile
from .constraints import Constraint, Term, coordinate
from .coordinates import BodyCoordinates, Marker, PlacedBodies, transverse_pieces
from .inputs import inputs_of
from .scale import mechanism_size
from .signals import InputSignals, table_curve

# Displacements of mass points in one direction below this part of those in the other are rounding.
_ROUNDING = 1e-8
# Codes of the operations of laws by their names in expressions.
_SIGNS = {"+": "ADD", "-": "SUBTRACT", "*": "MULTIPLY", "/": "DIVIDE", "**": "POWER", "negative": "NEGATE"}
_CODES = {name: getattr(codes, _SIGNS.get(name, name.upper())) for name in OPERATIONS}
# Fields of a line that a spring between points defines.
_OF_SPRINGS = ("stiffness", "length", "damping")


def pack_system(placed: PlacedBodies, constraints: list[Constraint]) -> tuple[PackedSystem, tuple[str, ...]]:
    """Return the records and arrays for the kernels, and the name of every constraint row."""
    mechanism, bodies = placed.mechanism, placed.bodies
    packer = _Packer(placed)
    for constraint in constraints:
        packer.add_constraint(constraint)
    for k, motor in zip(inputs_of(mechanism).motors, mechanism.motors, strict=True):
        packer.add_motor(mechanism.joint(motor.joint), k)
    lines = [
        packer.end(spring.a, "a") | packer.end(spring.b, "b") | {name: getattr(spring, name) for name in _OF_SPRINGS}
        | {"law": -1 if spring.force is None else packer.add_law(spring.force)}
        for spring in mechanism.linear_springs
    ]  # fmt: skip
    loads, curves = _load_records(mechanism, packer), packer.curves
    markers, columns = packer.markers, _columns(bodies, packer.markers)
    tracks, breaks, coefficients = _tracks([bodies[i] for i in packer.tracks])
    kinds = [_kinds(body) for body in bodies]
    bent = [marker.bending for marker in markers if marker.bending is not None]
    lanes = [_lanes(body.points) for body in bodies]
    points = [(p, each) for p, each in zip([body.points for body in bodies], lanes, strict=True) if p is not None]
    weights = [_weights_in_lanes(*each) for each in points]

    packed = PackedSystem(
        bodies=_body_records(bodies, packer.ports, packer.motor_sides, columns, kinds, lanes),
        markers=_marker_records(markers),
        ports=_port_records(packer.ports),
        motor_sides=records(MOTOR_SIDE, [side for group in packer.motor_sides for side in group]),
        loads=records(LOAD, loads),
        laws=records(LAW, packer.laws),
        operations=records(OPERATION, packer.operations),
        quantities=records(QUANTITY_RECORD, packer.quantities),
        curve_start=np.cumsum([0, *(curve.breaks.size for curve in curves)]),
        curve_breaks=np.concatenate([np.zeros(0), *(curve.breaks for curve in curves)]),
        curve_coefficients=np.vstack([np.zeros((0, 6)), *(curve.coefficients for curve in curves)]),
        lines=records(LINE, lines),
        axes=records(AXIS_RECORD, packer.axes),
        tracks=records(TRACK, tracks),
        track_breaks=breaks,
        track_coefficients=coefficients,
        rows=records(ROW, _with_envelope(packer.rows, packer.ports)),
        modal=np.concatenate([_modal_rows(body) for body in bodies], axis=1),
        damping=_flat([_coupled_damping(body) for body in bodies]),
        I2=_flat([body.integrals.I2 for body in bodies]),
        G2=_flat([body.integrals.G2 for body in bodies]),
        shape=np.concatenate([np.zeros((3, 0)), *(np.vstack([m.N, m.slope]) for m in markers)], axis=1),
        columns=_flat(columns),
        # Per body: columns of G2 and of I2, one after the other (nf, 2 stride).
        products=_flat([np.hstack([_padded(b.integrals.G2.T), _padded(b.integrals.I2.T)]) for b in bodies]),
        bending=_flat([_padded(each) for each in bent]) if any(_is_full(body) for body in bodies) else None,
        # All mass points of a body: Nx, Ny and N2' by coordinate (nf, 3 pitch); position along the beam, mass and
        # moment of inertia (3, pitch).
        places=_flat(
            [np.hstack([_in_lanes(rows, at).T for rows in (p.N[:, 0], p.N[:, 1], p.slope)]) for p, at in points]
        ),
        spans=_flat([spans for spans, _ in weights]),
        weights=_flat([own for _, own in weights]),
        inertias=_flat([_in_lanes(np.stack([p.x, p.mass, p.inertia], axis=1), at).T for p, at in points]),
        kinds=np.concatenate([numbers for each in kinds for numbers in each]),
        total_mass=np.sum([body.integrals.m for body in bodies]).item(),
        size=packer.size,
        gravity=np.array(mechanism.gravity) * 1.0,
    )
    return packed, tuple(packer.labels)


class _Packer:
    """Builder of a system's records, joint by joint."""

    def __init__(self, placed: PlacedBodies) -> None:
        self.placed, self.size = placed, mechanism_size(placed.bodies)
        self.ground, self.index = placed.mechanism.ground, placed.index
        self.markers: list[Marker] = []
        self.ports: list[list[dict]] = [[] for _ in placed.bodies]
        self.motor_sides: list[list[dict]] = [[] for _ in placed.bodies]
        self.axes: list[dict] = []
        self.laws: list[dict] = []
        self.curves: list[InputSignals] = []
        self.operations: list[dict] = []
        self.quantities: list[dict] = []
        self.tracks: list[int] = []
        self.rows: list[dict] = []
        self.labels: list[str] = []

    def add_marker(self, ref: PointRef) -> int:
        self.markers.append(self.placed.marker(ref))
        return len(self.markers) - 1

    def end(self, ref: PointRef, end: str) -> dict[str, float]:
        """Return one end of a line or an axis: a marker, or a position on the ground."""
        if ref.on_ground:
            x, y = self.ground[ref.point]
            return {end: -1, f"{end}x": x, f"{end}y": y}
        return {end: self.add_marker(ref), f"{end}x": 0.0, f"{end}y": 0.0}

    def add_constraint(self, constraint: Constraint) -> None:
        first = len(self.rows)
        self.labels += constraint.labels
        record = {
            "kind": constraint.row,
            "signal": constraint.signal,
            "compliance": constraint.compliance,
            "limit": constraint.limit,
            "unit": 1.0 if constraint.terms[0].kind == ANGLE else self.size,
            "ground": -constraint.rest,
        }
        self.rows += [dict(record) for _ in constraint.labels]
        for term in constraint.terms:
            self.add_term(term, first)

    def add_term(self, term: Term, row: int) -> None:
        """Add the ports of a term, and the contribution of its ends on the ground to its rows."""
        axis, rows = -1, 2 if term.kind == POINT else 1
        if term.kind == AXIS:
            axis = self.add_axis(term, row=row)
        for ref, weight in ((term.a, -term.weight), (term.b, term.weight)):
            if ref.on_ground:
                if term.kind == POINT:
                    for coordinate in range(2):
                        self.rows[row + coordinate]["ground"] += weight * self.ground[ref.point][coordinate]
                continue
            if axis < 0:
                marker, parts = self.add_marker(ref), rows
            elif ref is term.b:
                marker, parts = self.axes[axis]["b"], 2
            else:
                marker, parts = self.axes[axis]["a"], {"nothing": 2, "track": 4}.get(term.carrier, 3)
            port = {"marker": marker, "kind": term.kind, "row": row, "rows": rows, "parts": parts, "axis": axis}
            self.ports[self.index[ref.body]].append(port | {"weight": weight})

    def ends(self, term: Term) -> dict[str, float]:
        """Return both ends of a term, and the angle of its axis."""
        ends, carrier = self.end(term.a, "a") | self.end(term.b, "b"), term.carrier
        if carrier in ("frame", "track"):
            # The frame has no slope of its own, and a track is measured from the frame's origin.
            fixed = self.markers[int(ends["a"])].on_frame
            self.markers[int(ends["a"])] = fixed if carrier == "frame" else replace(fixed, x0=np.zeros(2))
        return ends | {"angle": term.direction, "between": int(carrier == "nothing")}

    def add_axis(self, term: Term, row: int = -1, signal: int = -1) -> int:
        ends, track = self.ends(term), -1
        if term.carrier == "track":
            self.tracks.append(self.index[term.a.body])
            track = len(self.tracks) - 1
        self.axes.append(ends | {"row": row, "weight": term.weight, "signal": signal, "track": track})
        return len(self.axes) - 1

    def add_law(self, law: ForceLaw, clock: int = -1) -> int:
        """Add a law with its operations and table, and return its number; `clock` is the signal of the time."""
        first = len(self.operations)
        for each in law.operations:
            a = each.a
            if each.quantity:
                a = self.add_quantity(law.quantities[each.quantity])
            record = {"code": _CODES[each.name], "a": clock if each.name == TIME else a, "b": each.b}
            self.operations.append(record | {"number": each.number})
        if law.table is not None:
            self.operations.append({"code": TABLE, "a": len(law.operations) - 1, "b": len(self.curves)})
            self.curves.append(table_curve(law.table))
        self.laws.append({"first": first, "end": len(self.operations)})
        return len(self.laws) - 1

    def add_quantity(self, quantity: MotionQuantity) -> int:
        if quantity.point is not None:
            ends, kind = {"a": -1} | self.end(quantity.point, "b"), OF_COORDINATE
        elif quantity.spring:
            (spring,) = (one for one in self.placed.mechanism.linear_springs if one.name == quantity.spring)
            ends, kind = self.end(spring.a, "a") | self.end(spring.b, "b") | {"between": 1}, OF_AXIS
        else:
            term = coordinate(self.placed.mechanism.joint(quantity.joint))
            ends, kind = self.ends(term), OF_AXIS if term.kind == AXIS else OF_ANGLE
        axis, rate = int(quantity.word.endswith("y")), int(quantity.word in ("rate", "length_rate", "vx", "vy"))
        self.quantities.append(ends | {"kind": kind, "axis": axis, "rate": rate})
        return len(self.quantities) - 1

    def add_motor(self, joint: Joint, signal: int) -> None:
        if joint.slides:
            self.add_axis(coordinate(joint), signal=signal)
            return
        for ref, sign in ((joint.a, -1.0), (joint.b, 1.0)):
            if not ref.on_ground:
                record: dict[str, float] = {"marker": self.add_marker(ref), "signal": signal, "sign": sign}
                self.motor_sides[self.index[ref.body]].append(record)


def _tracks(bodies: list[BodyCoordinates]) -> tuple[list[dict], Array, Array]:
    """Return records, breaks and coefficients of the deflections of beams that points slide on."""
    records, breaks, coefficients = [], np.zeros(0), np.zeros(0)
    for body in bodies:
        assert body.mesh is not None
        pieces = transverse_pieces(body)
        records.append({"first": breaks.size, "pieces": len(pieces), "coefficients": coefficients.size})
        breaks, coefficients = np.append(breaks, body.mesh.nodes), np.append(coefficients, pieces)
    return records, breaks, coefficients


def _load_records(mechanism: Mechanism, packer: _Packer) -> list[dict[str, float]]:
    """Return records of loads, then of their reactions.

    Constant components are numbers, profiles in time the numbers of signals, laws -2 less their numbers.
    """
    signals, found = iter(inputs_of(mechanism).loads), []
    for load in mechanism.loads:
        record: dict[str, float] = dict.fromkeys(("x_signal", "y_signal", "torque_signal"), -1) | {"sign": 1.0}
        record["marker"] = packer.add_marker(load.point)
        names = (("fx", "x_signal"), ("fy", "y_signal")) if load.kind == "force" else (("torque", "torque_signal"),)
        for (number, signal), given in zip(names, load.components, strict=True):
            if isinstance(given, ForceLaw):
                record[signal] = -2 - packer.add_law(given, next(signals) if given.in_time else -1)
            elif isinstance(given, TimeProfile):
                record[signal] = next(signals)
            else:
                record[number] = given
        found.append(record)
    reactions = [
        record | {"marker": packer.add_marker(load.reaction), "sign": -1.0}
        for load, record in zip(mechanism.loads, found, strict=True) if load.reaction is not None
    ]  # fmt: skip
    return [*found, *reactions]


def _modal_rows(body: BodyCoordinates) -> Array:
    s = body.integrals
    return np.vstack([s.S2, s.I1, s.G1 + s.Jf, body.modes.omega**2, np.diag(body.damping)])


def _is_full(body: BodyCoordinates) -> bool:
    """Return whether the iteration matrix of a body is dense."""
    return body.points is not None or _coupled_damping(body).size > 0


def _coupled_damping(body: BodyCoordinates) -> Array:
    """Return a body's damping matrix without its diagonal, rows padded; no rows if it is diagonal."""
    rest = body.damping - np.diag(np.diag(body.damping))
    return _padded(rest) if np.any(rest) else np.zeros((0, padded(body.nf)))


def _flat(matrices: list[Array]) -> Array:
    """Return all entries of the matrices, row by row, one matrix after the other."""
    return np.concatenate([np.zeros(0), *(matrix.ravel() for matrix in matrices)])


def _padded(matrix: Array) -> Array:
    """Return the matrix padded with columns of zeros to whole vectors."""
    rows, columns = matrix.shape
    out = np.zeros((rows, padded(columns)), dtype=matrix.dtype)
    out[:, :columns] = matrix
    return out


def _lanes(points: MassPoints | None) -> Indices:
    """Return the mass point in each lane of each element (elements, lanes), -1 for none: Gauss points, then lumps."""
    if points is None:
        return np.zeros((0, 0), dtype=int)
    elements = points.weights.shape[1] // GAUSS
    of_each = [np.flatnonzero(points.element == element) for element in range(elements)]
    lanes = np.full((elements, padded(max(map(len, of_each)))), -1)
    for row, own in zip(lanes, of_each, strict=True):
        row[: own.size] = own
    return lanes


def _in_lanes(rows: Array, lanes: Indices) -> Array:
    """Return rows (points, any) in the order of `_lanes`, zero where there is no point."""
    return np.concatenate([rows, np.zeros_like(rows[:1])])[lanes.ravel()]


def _weights_in_lanes(points: MassPoints, lanes: Indices) -> tuple[Array, Array]:
    """Return the parts (pitch, LANES) of `spans` and of `weights`."""
    weights, step = _in_lanes(points.weights, lanes), lanes.shape[1]
    spans, own = np.zeros((2, len(weights) // LANES, LANES, LANES), dtype=weights.dtype)
    for k, lane in enumerate(range(0, len(weights), LANES)):
        first = lane // step * GAUSS
        own[k, :, :GAUSS] = weights[lane : lane + LANES, first : first + GAUSS]
        spans[k, :GAUSS], spans[k, BASE] = own[k, :, :GAUSS].T, 1.0
        # All points of a later element have the weights at the end of this one.
        after = weights[(lane // step + 1) * step :, first : first + GAUSS][:1]
        spans[k, FULL, :GAUSS] = after[0] if after.size else 0.0
    return spans, own


def _kinds(body: BodyCoordinates) -> tuple[Indices, Indices]:
    """Return the flexible coordinates that move mass points of a beam along it, and those that move them across it."""
    if body.points is None:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    x, y = np.max(np.abs(body.points.N), axis=0)
    # Modes do either, up to rounding; other coordinates, and modes of one frequency, may do both.
    if body.points.mixed or np.any(np.minimum(x, y) > _ROUNDING * np.maximum(x, y)):
        return np.arange(x.size), np.arange(x.size)
    return np.flatnonzero(x > y), np.flatnonzero(x <= y)


def _columns(bodies: tuple[BodyCoordinates, ...], markers: list[Marker]) -> list[Array]:
    """Return the contribution of the coordinates to the sums of each body, (nf, width): see `kernel.sums`."""
    rows = [[_modal_rows(body)[:FIRST_MARKER]] for body in bodies]
    for marker in markers:
        rows[marker.body].append(np.vstack([marker.N, marker.slope]))
    return [_padded(np.vstack(parts).T) for parts in rows]


def records(dtype: np.dtype, values: list[dict[str, Any]]) -> Records:
    """Convert dictionaries by field to records, zero for missing fields; complex if any number is."""
    blank = dict.fromkeys(dtype.names or (), 0)
    rows = [tuple((blank | value).values()) for value in values]
    if any(isinstance(number, complex) for row in rows for number in row):
        dtype = np.dtype([(name, complex if dtype[name].kind == "f" else dtype[name]) for name in blank])
    return np.array(rows, dtype=dtype)


def _body_records(bodies, ports, motor_sides, columns, kinds, point_lanes) -> Records:
    values: list[dict] = []
    start: Counter[str] = Counter()
    parts_of = zip(bodies, ports, motor_sides, columns, kinds, point_lanes, strict=True)
    for body, body_ports, body_motors, matrix, (along, across), by_element in parts_of:
        s, nf, size, full = body.integrals, body.nf, 3 + body.nf, _is_full(body)
        parts = sum(port["parts"] for port in body_ports)
        # The lanes of the body's Jacobian rows have three more for its rigid coordinates.
        stride, pitch, lanes = padded(nf), by_element.size, padded(parts + 3)
        # Length of the body's part of each array, by the field that holds its start.
        own = {
            "flex": nf,
            "square": nf**2,
            "products": 2 * nf * stride,
            "damping": _coupled_damping(body).size,
            "block": parts * lanes,
            "jac": size * lanes,
            "places": 3 * nf * pitch,
            "spans": pitch * LANES,
            "along": along.size + across.size,
            "inertias": 3 * pitch,
            "dense": size * padded(size) if full else 0,
            "port": len(body_ports),
            "motor": len(body_motors),
            "columns": matrix.size,
        }
        starts = {name: start[name] for name in own}
        start.update(own)
        numbers = {
            "offset": body.offset,
            "nf": nf,
            "width": matrix.shape[1],
            "stride": stride,
            "damping": starts["damping"] if own["damping"] else -1,
            "parts": parts,
            "lanes": lanes,
            "slopes": GAUSS * len(by_element),
            "pitch": pitch,
            "step": by_element.shape[1],
            "across": starts["along"] + along.size,
            "across_end": start["along"],
            "full": int(full),
            "port_end": start["port"],
            "motor_end": start["motor"],
            "m": s.m,
            "S1x": s.S1[0],
            "S1y": s.S1[1],
            "I0": s.I0 + s.J,
        }
        values.append(starts | numbers)
    return records(BODY, values)


def _marker_records(markers: list[Marker]) -> Records:
    values, shape, bending = [], 0, 0
    column: dict[int, int] = {}
    for marker in markers:
        column[marker.body] = column.get(marker.body, FIRST_MARKER - 3) + 3
        bends = marker.bending is not None
        values.append(
            {
                "body": marker.body,
                "shape": shape,
                "column": column[marker.body],
                "bending": bending if bends else -1,
                "x": marker.x0[0],
                "y": marker.x0[1],
            }
        )
        shape += marker.slope.size
        bending += marker.slope.size * padded(marker.slope.size) if bends else 0
    return records(MARKER, values)


def _port_records(ports) -> Records:
    values = []
    for body_ports in ports:
        local = 0
        for port in body_ports:
            values.append(port | {"local": local})
            local += port["parts"]
    return records(PORT, values)


def _with_envelope(rows: list[dict], ports: list[list[dict]]) -> list[dict]:
    """Add the envelope of the Schur complement to constraint rows: rows of one body are coupled."""
    first = list(range(len(rows)))
    for body_ports in ports:
        low = min((port["row"] for port in body_ports), default=0)
        for port in body_ports:
            for row in range(port["row"], port["row"] + port["rows"]):
                first[row] = min(first[row], low)
    second = {port["row"] + 1 for body_ports in ports for port in body_ports if port["rows"] == 2}
    out, start = [], 0
    for i, row in enumerate(rows):
        out.append(row | {"second": i in second, "first": first[i], "start": start})
        start += i + 1 - first[i]
    return out
