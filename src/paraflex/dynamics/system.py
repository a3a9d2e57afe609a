"""Mechanism -> System: everything that does not depend on the coordinates, computed once.

The one owner of index arithmetic: which slice of q is whose, which row is which joint's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.fem import (
    BeamMesh,
    Lump,
    ModalBasis,
    ShapeIntegrals,
    SpanProperties,
    beam_integrals,
    mesh_beam,
    modal_basis,
    rigid_integrals,
)
from paraflex.kernel.joints import constraint_values, fill_jacobian
from paraflex.kernel.packed import (
    ANGLE,
    BODY,
    EFFORT,
    MARKER,
    POINT,
    PORT,
    ROW,
    PackedSystem,
    Signals,
    Workspace,
    make_workspace,
)
from paraflex.mechanism import Body, Mechanism, PointRef, RigidBody

GROUND_INDEX = -1


@dataclass(frozen=True)
class BodyCoordinates:
    """Where a body's coordinates stand and what they mean.

    Attributes
    ----------
    name : str
    offset : int
        Of r in q; phi follows at offset + 2, flexible coordinates from offset + 3.
    integrals : ShapeIntegrals
        In modal coordinates: u of the formulation is `modes.vectors @ q[flexible]`.
    modes : ModalBasis
    mesh : BeamMesh or None
        None for a rigid body.
    """

    name: str
    offset: int
    integrals: ShapeIntegrals
    modes: ModalBasis
    mesh: BeamMesh | None

    @property
    def nf(self) -> int:
        """Number of flexible coordinates."""
        return self.integrals.nf

    @property
    def angle(self) -> int:
        """Index of phi in q."""
        return self.offset + 2

    @property
    def position(self) -> slice:
        """Of r in q."""
        return slice(self.offset, self.offset + 2)

    @property
    def flexible(self) -> slice:
        """Of the modal coordinates in q."""
        return slice(self.offset + 3, self.offset + 3 + self.nf)

    @property
    def all(self) -> slice:
        """Of every coordinate of the body in q."""
        return slice(self.offset, self.offset + 3 + self.nf)


@dataclass(frozen=True)
class Marker:
    """A material point: its place in the undeformed body and its shape rows in modal coordinates.

    Attributes
    ----------
    body : int
        Index of the body.
    x0 : (2,) array
        Body-frame position [m].
    N : (2, nf) array
        Displacement per modal coordinate.
    slope : (nf,) array
        Turn of the beam there per modal coordinate.
    """

    body: int
    x0: NDArray[np.float64]
    N: NDArray[np.float64]
    slope: NDArray[np.float64]


@dataclass(frozen=True)
class System:
    """A mechanism as constant arrays. Made by `build_system`.

    Attributes
    ----------
    mechanism : Mechanism
    bodies : tuple of BodyCoordinates
    packed : PackedSystem
        What the kernels read.
    rows : tuple of str
        The name of each constraint row ("B1 x", "crank angle"), in the order of the multipliers.
    """

    mechanism: Mechanism
    bodies: tuple[BodyCoordinates, ...]
    packed: PackedSystem
    rows: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of generalised coordinates."""
        return sum(3 + body.nf for body in self.bodies)

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return len(self.rows)

    @property
    def n_flexible(self) -> int:
        """Number of flexible coordinates."""
        return sum(body.nf for body in self.bodies)

    @property
    def total_mass(self) -> float:
        """Of all bodies [kg]."""
        return float(self.packed.total_mass)

    @cached_property
    def index(self) -> dict[str, int]:
        """Index of each body by name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    def body(self, name: str) -> BodyCoordinates:
        """Coordinates of a body by name."""
        return self.bodies[self.index[name]]

    def marker(self, ref: PointRef) -> Marker:
        """The material point of that name."""
        return _marker(self.mechanism, self.bodies, self.index, ref)

    def workspace(self) -> Workspace:
        """A fresh workspace for the kernels."""
        return make_workspace(self.packed)

    def constraints(self, signals: Signals, t: float, q: NDArray, v: NDArray) -> tuple[NDArray, NDArray]:
        """Phi and Phi' at (t, q, v), each (m,)."""
        phi, rate = np.zeros(self.m), np.zeros(self.m)
        constraint_values(self.packed, signals, t, q, v, phi, rate)
        return phi, rate

    def jacobian(self, q: NDArray) -> NDArray[np.float64]:
        """Phi_q at q, dense (m, n)."""
        jacobian = np.zeros((self.m, self.n))
        fill_jacobian(self.packed, q, jacobian)
        return jacobian


def build_system(mechanism: Mechanism) -> System:
    """Turn a mechanism into a system; flexible coordinates are diagonalised per body.

    Parameters
    ----------
    mechanism : Mechanism

    Returns
    -------
    System

    Raises
    ------
    InputError
        A body whose mass matrix is not positive definite.
    """
    bodies, offset = [], 0
    for body in mechanism.bodies:
        coordinates = _coordinates(body, offset)
        bodies.append(coordinates)
        offset += 3 + coordinates.nf
    index = {body.name: i for i, body in enumerate(bodies)}
    order = _row_order(mechanism, index)
    packed, rows = _pack(mechanism, tuple(bodies), index, order)
    return System(mechanism=mechanism, bodies=tuple(bodies), packed=packed, rows=rows)


def _coordinates(body: Body, offset: int) -> BodyCoordinates:
    if isinstance(body, RigidBody):
        integrals = rigid_integrals(body.mass, body.centre_of_mass, body.inertia)
        return BodyCoordinates(body.name, offset, integrals, modal_basis(integrals), None)
    mesh = mesh_beam(body.length, body.points, body.elements)
    span = SpanProperties(
        mass_per_length=body.material.density * body.section.area,
        axial_stiffness=body.material.youngs_modulus * body.section.area,
        bending_stiffness=body.material.youngs_modulus * body.section.second_moment,
    )
    spans = [span] * (int(mesh.spans[-1]) + 1)
    lumps = [Lump(mesh.points[lump.point], lump.mass, lump.inertia) for lump in body.lumps]
    try:
        integrals = beam_integrals(mesh, spans, lumps, body.reference)
        if not body.flexible:
            integrals = integrals.without_flexibility()
        modes = modal_basis(integrals)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "its mass matrix is not positive definite",
            field=f"body.{body.name}",
            remedy="check section, material and lumped masses for values many orders of magnitude apart",
        ) from error
    return BodyCoordinates(body.name, offset, integrals.in_basis(modes.vectors), modes, mesh)


def _marker(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], ref: PointRef
) -> Marker:
    if ref.on_ground:
        return Marker(GROUND_INDEX, np.array(mechanism.ground[ref.point], dtype=float), np.zeros((2, 0)), np.zeros(0))
    i = index[ref.body]
    body = mechanism.bodies[i]
    if isinstance(body, RigidBody):
        return Marker(i, np.array(body.points[ref.point], dtype=float), np.zeros((2, 0)), np.zeros(0))
    mesh = bodies[i].mesh
    assert mesh is not None
    x = float(mesh.nodes[mesh.points[ref.point]])
    N, slope = mesh.shape_at(x)
    D = bodies[i].integrals.D
    return Marker(i, np.array([x, 0.0]), N @ D, slope @ D)


@dataclass(frozen=True)
class _Constraint:
    """A joint or a prescribed angle before packing: two points, and a signal where it is driven in time."""

    name: str
    kind: int
    a: PointRef
    b: PointRef
    signal: int

    @property
    def labels(self) -> tuple[str, ...]:
        return (f"{self.name} angle",) if self.kind == ANGLE else (f"{self.name} x", f"{self.name} y")


def _constraints(mechanism: Mechanism) -> list[_Constraint]:
    constraints = [_Constraint(joint.name, POINT, joint.a, joint.b, -1) for joint in mechanism.joints]
    # Signals are the motors' torques first, then the prescribed angles.
    for k, prescribed in enumerate(mechanism.prescribed):
        joint = mechanism.joint(prescribed.joint)
        constraints.append(_Constraint(prescribed.name, ANGLE, joint.a, joint.b, len(mechanism.motors) + k))
    return constraints


def _row_order(mechanism: Mechanism, index: dict[str, int]) -> list[_Constraint]:
    """Constraints in an order that keeps the envelope of the Schur complement small (reverse Cuthill-McKee)."""
    constraints = _constraints(mechanism)
    touched = np.zeros((len(constraints), len(index)))
    for i, constraint in enumerate(constraints):
        for ref in (constraint.a, constraint.b):
            if not ref.on_ground:
                touched[i, index[ref.body]] = 1.0
    incidence = scipy.sparse.csr_matrix(touched)
    graph = scipy.sparse.csr_matrix(incidence @ incidence.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    return [constraints[i] for i in order]


def _pack(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], constraints: list[_Constraint]
) -> tuple[PackedSystem, tuple[str, ...]]:
    markers: list[Marker] = []
    ports: list[list[dict]] = [[] for _ in bodies]
    efforts: list[list[dict]] = [[] for _ in bodies]
    labels: list[str] = []
    ground: list[float] = []
    signals: list[int] = []

    def add_marker(ref: PointRef) -> int:
        markers.append(_marker(mechanism, bodies, index, ref))
        return len(markers) - 1

    for constraint in constraints:
        row, n_rows = len(labels), len(constraint.labels)
        labels += constraint.labels
        signals += [constraint.signal] * n_rows
        ground += [0.0] * n_rows
        for ref, sign in ((constraint.a, -1.0), (constraint.b, 1.0)):
            if ref.on_ground:
                if constraint.kind == POINT:
                    for axis in range(2):
                        ground[row + axis] += sign * mechanism.ground[ref.point][axis]
                continue
            ports[index[ref.body]].append(
                {"marker": add_marker(ref), "kind": constraint.kind, "row": row, "rows": n_rows, "sign": sign}
            )
    for k, motor in enumerate(mechanism.motors):
        joint = mechanism.joint(motor.joint)
        for ref, sign in ((joint.a, -1.0), (joint.b, 1.0)):
            if not ref.on_ground:
                efforts[index[ref.body]].append({"marker": add_marker(ref), "signal": k, "sign": sign})

    packed = PackedSystem(
        bodies=_body_records(bodies, ports, efforts),
        markers=_marker_records(markers),
        ports=_port_records(bodies, ports),
        efforts=_records(EFFORT, [effort for group in efforts for effort in group]),
        rows=_row_records(signals, ground, ports),
        modal=np.concatenate([_modal_rows(body) for body in bodies], axis=1),
        I2=np.concatenate([body.integrals.I2.ravel() for body in bodies]),
        G2=np.concatenate([body.integrals.G2.ravel() for body in bodies]),
        shape=np.concatenate([np.zeros((3, 0)), *(np.vstack([m.N, m.slope]) for m in markers)], axis=1),
        total_mass=float(sum(body.integrals.m for body in bodies)),
    )
    return packed, tuple(labels)


def _modal_rows(body: BodyCoordinates) -> NDArray[np.float64]:
    s = body.integrals
    return np.vstack([s.S2, s.I1, s.G1 + s.Jf, body.modes.omega**2])


def _records(dtype: np.dtype, values: list[dict]) -> NDArray[np.void]:
    out = np.zeros(len(values), dtype=dtype)
    for record, value in zip(out, values, strict=True):
        for key, entry in value.items():
            record[key] = entry
    return out


def _body_records(bodies, ports, efforts) -> NDArray[np.void]:
    values = []
    flex = square = port = effort = block = 0
    for body, body_ports, body_efforts in zip(bodies, ports, efforts, strict=True):
        s = body.integrals
        rows = sum(port["rows"] for port in body_ports)
        values.append(
            {
                "offset": body.offset,
                "nf": body.nf,
                "flex": flex,
                "square": square,
                "port": port,
                "port_end": port + len(body_ports),
                "effort": effort,
                "effort_end": effort + len(body_efforts),
                "block": block,
                "rows": rows,
                "m": s.m,
                "S1x": s.S1[0],
                "S1y": s.S1[1],
                "I0": s.I0 + s.J,
            }
        )
        flex += body.nf
        square += body.nf**2
        port += len(body_ports)
        effort += len(body_efforts)
        block += rows**2
    return _records(BODY, values)


def _marker_records(markers: list[Marker]) -> NDArray[np.void]:
    values, shape = [], 0
    for marker in markers:
        values.append({"body": marker.body, "shape": shape, "x": marker.x0[0], "y": marker.x0[1]})
        shape += marker.slope.size
    return _records(MARKER, values)


def _port_records(bodies, ports) -> NDArray[np.void]:
    values, jac = [], 0
    for body, body_ports in zip(bodies, ports, strict=True):
        local = 0
        for port in body_ports:
            values.append(port | {"jac": jac, "local": local})
            local += port["rows"]
            jac += port["rows"] * (3 + body.nf)
    return _records(PORT, values)


def _row_records(signals: list[int], ground: list[float], ports: list[list[dict]]) -> NDArray[np.void]:
    """Constraint rows with the envelope of the Schur complement: rows of one body are coupled."""
    first = list(range(len(signals)))
    for body_ports in ports:
        low = min((port["row"] for port in body_ports), default=0)
        for port in body_ports:
            for row in range(port["row"], port["row"] + port["rows"]):
                first[row] = min(first[row], low)
    values, start = [], 0
    for row, (signal, value) in enumerate(zip(signals, ground, strict=True)):
        values.append({"signal": signal, "ground": value, "first": first[row], "start": start})
        start += row + 1 - first[row]
    return _records(ROW, values)
