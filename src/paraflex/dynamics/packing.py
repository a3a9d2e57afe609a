"""A system's joints, motors and bodies as the records the kernels read; which row is which joint's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from paraflex.dynamics.coordinates import BodyCoordinates, Marker, make_marker
from paraflex.kernel.packed import (
    ANGLE,
    BODY,
    CONSTRAINT,
    DAMPER,
    EFFORT,
    LINE,
    LOAD,
    MARKER,
    MASS,
    POINT,
    PORT,
    ROW,
    SPRING,
    PackedSystem,
)
from paraflex.mechanism import Load, Mechanism, PointForce, PointRef


@dataclass(frozen=True)
class Constraint:
    """A joint, a prescribed angle or a spring before packing: two points, and a signal where it is driven in time.

    A spring is a compliant constraint: angle - rest = compliance * multiplier; so is a damper, of the angle's rate.
    """

    name: str
    kind: int
    a: PointRef
    b: PointRef
    signal: int
    row: int = CONSTRAINT
    compliance: float = 0.0
    rest: float = 0.0

    @property
    def labels(self) -> tuple[str, ...]:
        """One name a row."""
        return (f"{self.name} angle",) if self.kind == ANGLE else (f"{self.name} x", f"{self.name} y")


def _constraints(mechanism: Mechanism) -> list[Constraint]:
    constraints = [Constraint(joint.name, POINT, joint.a, joint.b, -1) for joint in mechanism.joints]
    # Signals are the motors' torques first, then the prescribed angles.
    for k, prescribed in enumerate(mechanism.prescribed):
        joint = mechanism.joint(prescribed.joint)
        constraints.append(Constraint(prescribed.name, ANGLE, joint.a, joint.b, len(mechanism.motors) + k))
    for spring in mechanism.springs:
        joint = mechanism.joint(spring.joint)
        constraints.append(
            Constraint(spring.name, ANGLE, joint.a, joint.b, -1, SPRING, 1.0 / spring.stiffness, spring.rest)
        )
    for damper in mechanism.dampers:
        joint = mechanism.joint(damper.joint)
        constraints.append(Constraint(damper.name, ANGLE, joint.a, joint.b, -1, DAMPER, 1.0 / damper.coefficient))
    return constraints


def row_order(mechanism: Mechanism, index: dict[str, int]) -> list[Constraint]:
    """Constraints in an order that keeps the envelope of the Schur complement small (reverse Cuthill-McKee)."""
    constraints = _constraints(mechanism)
    if not constraints:
        return []
    touched = np.zeros((len(constraints), len(index)))
    for i, constraint in enumerate(constraints):
        for ref in (constraint.a, constraint.b):
            if not ref.on_ground:
                touched[i, index[ref.body]] = 1.0
    incidence = scipy.sparse.csr_matrix(touched)
    graph = scipy.sparse.csr_matrix(incidence @ incidence.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    return [constraints[i] for i in order]


def pack_system(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], constraints: list[Constraint]
) -> tuple[PackedSystem, tuple[str, ...]]:
    """Records and arrays for the kernels, and the name of every constraint row."""
    markers: list[Marker] = []
    ports: list[list[dict]] = [[] for _ in bodies]
    efforts: list[list[dict]] = [[] for _ in bodies]
    labels: list[str] = []
    ground: list[float] = []
    signals: list[int] = []
    kinds: list[int] = []
    compliance: list[float] = []

    def add_marker(ref: PointRef) -> int:
        markers.append(make_marker(mechanism, bodies, index, ref))
        return len(markers) - 1

    for constraint in constraints:
        row, n_rows = len(labels), len(constraint.labels)
        labels += constraint.labels
        signals += [constraint.signal] * n_rows
        kinds += [constraint.row] * n_rows
        compliance += [constraint.compliance] * n_rows
        ground += [-constraint.rest] * n_rows
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
    lines = [
        {
            "a": -1 if spring.a.on_ground else add_marker(spring.a),
            "b": -1 if spring.b.on_ground else add_marker(spring.b),
            **_ground_place(mechanism, spring.a, "a"),
            **_ground_place(mechanism, spring.b, "b"),
            "stiffness": spring.stiffness,
            "length": spring.length,
            "damping": spring.damping,
        }
        for spring in mechanism.linear_springs
    ]
    loads = [_load_record(load) | {"marker": add_marker(load.point)} for load in mechanism.loads]

    packed = PackedSystem(
        bodies=_body_records(bodies, ports, efforts),
        markers=_marker_records(markers),
        ports=_port_records(bodies, ports),
        efforts=_records(EFFORT, [effort for group in efforts for effort in group]),
        loads=_records(LOAD, loads),
        lines=_records(LINE, lines),
        rows=_row_records(kinds, signals, ground, compliance, ports),
        modal=np.concatenate([_modal_rows(body) for body in bodies], axis=1),
        I2=np.concatenate([body.integrals.I2.ravel() for body in bodies]),
        G2=np.concatenate([body.integrals.G2.ravel() for body in bodies]),
        shape=np.concatenate([np.zeros((3, 0)), *(np.vstack([m.N, m.slope]) for m in markers)], axis=1),
        bending=_bending(bodies, markers),
        masses=_mass_records(bodies),
        mass_shape=np.concatenate([np.zeros((3, 0)), *(_mass_rows(body) for body in bodies)], axis=1),
        mass_weights=np.concatenate([np.zeros(0), *(w for body in bodies for w in _mass_weights(body))]),
        total_mass=float(sum(body.integrals.m for body in bodies)),
        gravity=np.array(mechanism.gravity, dtype=float),
    )
    return packed, tuple(labels)


def _ground_place(mechanism: Mechanism, ref: PointRef, end: str) -> dict[str, float]:
    x, y = mechanism.ground[ref.point] if ref.on_ground else (0.0, 0.0)
    return {f"{end}x": x, f"{end}y": y}


def _load_record(load: Load) -> dict[str, float]:
    if isinstance(load, PointForce):
        return {"fx": load.force[0], "fy": load.force[1]}
    return {"torque": load.torque}


def _modal_rows(body: BodyCoordinates) -> NDArray[np.float64]:
    s = body.integrals
    return np.vstack([s.S2, s.I1, s.G1 + s.Jf, body.modes.omega**2])


def _bending(bodies: tuple[BodyCoordinates, ...], markers: list[Marker]) -> NDArray[np.float64] | None:
    if all(body.points is None for body in bodies):
        return None
    return np.concatenate([np.zeros(0), *(m.bending.ravel() for m in markers if m.bending is not None)])


def _mass_weights(body: BodyCoordinates) -> list[NDArray[np.float64]]:
    """Weights of each mass point, as far as they are not zero."""
    if body.points is None:
        return []
    return [row[: 1 + int(np.max(np.nonzero(row)[0], initial=-1))] for row in body.points.weights]


def _mass_rows(body: BodyCoordinates) -> NDArray[np.float64]:
    if body.points is None:
        return np.zeros((3, 0))
    rows = np.concatenate([body.points.N, body.points.slope[:, None]], axis=1)
    return rows.transpose(1, 0, 2).reshape(3, -1)


def _mass_records(bodies: tuple[BodyCoordinates, ...]) -> NDArray[np.void]:
    values = []
    shape = start = 0
    for body in bodies:
        for k, weights in enumerate(_mass_weights(body)):
            points = body.points
            assert points is not None
            values.append(
                {
                    "shape": shape,
                    "weights": start,
                    "reach": weights.size,
                    "x": points.x[k],
                    "mass": points.mass[k],
                    "inertia": points.inertia[k],
                }
            )
            shape += body.nf
            start += weights.size
    return _records(MASS, values)


def _records(dtype: np.dtype, values: list[dict]) -> NDArray[np.void]:
    out = np.zeros(len(values), dtype=dtype)
    for record, value in zip(out, values, strict=True):
        for key, entry in value.items():
            record[key] = entry
    return out


def _body_records(bodies, ports, efforts) -> NDArray[np.void]:
    values = []
    flex = square = port = effort = block = mass = dense = 0
    for body, body_ports, body_efforts in zip(bodies, ports, efforts, strict=True):
        s = body.integrals
        rows = sum(port["rows"] for port in body_ports)
        masses, slopes = (0, 0) if body.points is None else body.points.weights.shape
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
                "mass": mass,
                "mass_end": mass + masses,
                "slopes": slopes,
                "dense": dense,
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
        mass += masses
        dense += (3 + body.nf) ** 2 if slopes else 0
    return _records(BODY, values)


def _marker_records(markers: list[Marker]) -> NDArray[np.void]:
    values, shape, bending = [], 0, 0
    for marker in markers:
        bends = marker.bending is not None
        values.append(
            {
                "body": marker.body,
                "shape": shape,
                "bending": bending if bends else -1,
                "x": marker.x0[0],
                "y": marker.x0[1],
            }
        )
        shape += marker.slope.size
        bending += marker.slope.size**2 if bends else 0
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


def _row_records(
    kinds: list[int], signals: list[int], ground: list[float], compliance: list[float], ports: list[list[dict]]
) -> NDArray[np.void]:
    """Constraint rows with the envelope of the Schur complement: rows of one body are coupled."""
    first = list(range(len(signals)))
    for body_ports in ports:
        low = min((port["row"] for port in body_ports), default=0)
        for port in body_ports:
            for row in range(port["row"], port["row"] + port["rows"]):
                first[row] = min(first[row], low)
    values, start = [], 0
    for row, (signal, value) in enumerate(zip(signals, ground, strict=True)):
        values.append(
            {
                "kind": kinds[row],
                "signal": signal,
                "ground": value,
                "compliance": compliance[row],
                "first": first[row],
                "start": start,
            }
        )
        start += row + 1 - first[row]
    return _records(ROW, values)
