"""States of a system: poses, consistent positions and velocities, momentum."""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Brief
from paraflex.errors import AssemblyError, InconsistentConstraintsError, Moment
from paraflex.kernel.packed import Signals
from paraflex.limits import solvable
from paraflex.mechanism import GROUND, Assembly, PointRef, approximate_poses
from .change_points import branches_from_rest, change_point_at
from .following import POSITION_STIFFNESS, follow_drives
from .points import marker_position
from .projection import assemble, closed, constraint_change, gap_texts, project, refuse_conflict, second_rates
from .signals import moment_signals
from .sparse import body_masses, sparse_mass
from .system import System, build_system

# If Newton's iteration fails, a damped one finds the smallest gap: its iterations, dampings and least gain.
_MAX_DESCENT, _FIRST_DAMPING, _LARGEST_DAMPING, _NO_GAIN = 200, 1e-2, 1e6, 1e-9
# Rotation of links at the start of the damped iteration [rad].
_ASIDE = 1e-2
# If loops close only with links deflected by more than this fraction of their size, the links do not fit together.
_LARGEST_DEFLECTION = 0.1
# Weight of stiffness in `link_metric` for velocities: rates of deflection are to be small against those of links.
VELOCITY_STIFFNESS = 1e9


@named_in_errors("a state", "a state, as dynamics.consistent_state makes it")
@dataclass(frozen=True)
class State(Brief):
    """State of a system: time [s], coordinates q (n,) and velocities v (n,)."""

    time: float
    q: Array
    v: Array


def mass_matrix(system: System, q: Array) -> Array:
    """Return the dense mass matrix (n, n) at q; for many bodies see `dynamics.sparse.sparse_mass`."""
    return np.asarray(scipy.linalg.block_diag(*body_masses(system, q)))


def momentum(system: System, state: State) -> tuple[Array, float]:
    """Return linear momentum (2,) [kg m/s] and angular momentum about the ground frame's origin [kg m^2/s]."""
    p = sparse_mass(system, state.q) @ state.v
    linear, angular = np.zeros(2), 0.0
    for body in system.bodies:
        linear += p[body.position]
        # A rigid rotation about the origin moves r by E r and phi by one.
        x, y = state.q[body.position]
        angular += float(p[body.angle] + x * p[body.offset + 1] - y * p[body.offset])
    return linear, angular


def undeformed(system: System, rigid: System, state: State) -> State:
    """Return the state of rest of a flexible system with its undeformed bodies at the positions of the rigid ones."""
    still = np.zeros_like(state.q)
    return State(state.time, undeformed_motion(system, rigid, state.q, still, still)[0], np.zeros(system.n))


def undeformed_motion(system: System, rigid: System, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    """Return coordinates (..., n) and their derivatives of undeformed bodies that move as the rigid ones.

    Parts of a divided beam are at their positions along it.
    """
    there = np.zeros((3, *q.shape[:-1], system.n))
    for body in system.bodies:
        name, along = system.carrier(body.name)
        (x, y, phi), (vx, vy, w), (ax, ay, dw) = (part.T[rigid.body(name).all] for part in (q, v, a))
        c, s = along * np.cos(phi), along * np.sin(phi)
        own = slice(body.offset, body.offset + 3)
        there[0].T[own] = x + c, y + s, phi
        there[1].T[own] = vx - w * s, vy + w * c, w
        there[2].T[own] = ax - dw * s - w * w * c, ay + dw * c - w * w * s, dw
    return there[0], there[1], there[2]


def carried(system: System, other: System, coordinates: Array) -> Array:
    """Return coordinates (k, n) for those (k, others) of another system of the same bodies, or their derivatives.

    Deflections have the least mass-weighted difference; constraints may be violated.
    """
    out = np.zeros((len(coordinates), system.n))
    for here, there in zip(system.bodies, other.bodies, strict=True):
        shapes = here.modes.vectors.T @ here.shape.integrals.Mff @ there.modes.vectors
        out[:, here.offset : here.offset + 3] = coordinates[:, there.offset : there.offset + 3]
        out[:, here.flexible] = coordinates[:, there.flexible] @ shapes.T
    return out


def nearest_state(system: System, other: System, state: State) -> State:
    """Return the state nearest to that of another system of the same bodies with other flexible coordinates.

    Deflections have the least mass-weighted difference, and constraints are satisfied.

    Raises
    ------
    AssemblyError, InconsistentConstraintsError
        The constraints cannot be satisfied near the state.
    """
    signals = moment_signals(system.mechanism, state.time)
    q, v = carried(system, other, np.array([state.q, state.v]))
    q = project_position(system, signals, state.time, q)
    return State(state.time, q, project_velocity(system, signals, state.time, q, v))


def reference_pose(system: System, assembly: Assembly) -> Array:
    """Return undeformed coordinates at an assembly's angles, with positions along a tree of joints from the ground.

    Positions that the assembly's points determine are used directly. Loops are not closed yet, except for a mechanism
    with divided beams: their parts follow the rigid links of the mechanism as described, loops closed, so that the pose
    does not depend on the number of parts.
    """
    cut = system.mechanism.cut
    if cut is not None and cut.carriers and assembly.name in [one.name for one in system.described.assemblies]:
        rigid = build_system(system.described.rigid())
        signals = moment_signals(rigid.mechanism, 0.0)
        start = reference_pose(rigid, rigid.mechanism.assembly(assembly.name))
        pose = assembled_position(rigid, signals, 0.0, start)
        return undeformed(system, rigid, State(0.0, pose, np.zeros(rigid.n))).q
    q = np.zeros(system.n)
    placed = set()
    for name, pose in approximate_poses(system.mechanism, assembly).items():
        body = system.body(name)
        q[body.angle] = pose.angle
        if pose.position is not None:
            q[body.position] = pose.position
            placed.add(name)
    # Joints that hold points together position the next body. Other joints are used only without these, a distance
    # last. Equal joints come in the mechanism's order: a gap is left where the last joints close the loops.
    joints: dict[str, list[tuple[int, int]]] = {body.name: [] for body in system.bodies} | {GROUND: []}
    for number, joint in enumerate(system.mechanism.joints):
        entry = (("points" not in joint.holds) + ("distance" in joint.holds), number)
        joints[joint.a.body].append(entry)
        joints[joint.b.body].append(entry)
    if not joints[GROUND] and not placed:
        placed.add(system.bodies[0].name)
    waiting = [entry for name in (GROUND, *sorted(placed)) for entry in joints[name]]
    heapq.heapify(waiting)
    while waiting:
        joint = system.mechanism.joints[heapq.heappop(waiting)[1]]
        known, new = (joint.a, joint.b) if joint.a.on_ground or joint.a.body in placed else (joint.b, joint.a)
        if not new.on_ground and new.body not in placed:
            target = point_position(system, q, known)
            # Points at a distance must not start from the same position, where the line between them has no direction.
            q[system.body(new.body).position] += target + [joint.length or 0.0, 0.0] - point_position(system, q, new)
            placed.add(new.body)
            for entry in joints[new.body]:
                heapq.heappush(waiting, entry)
    return q


def point_position(system: System, q: Array, ref: PointRef) -> Array:
    """Return the ground-frame position (2,) of a named point at q [m]."""
    return marker_position(system, system.marker(ref), q)


def assembled_position(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Return the coordinates (n,) of a closed assembly, followed from its approximate pose to the start of drives.

    Raises
    ------
    AssemblyError
        The loops do not close, or drives cannot be reached: see `follow_drives` and `project_position`.
    """
    return project_position(system, signals, t, follow_drives(system, signals, t, q))


def project_position(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Return the nearest coordinates, in the metric of mass and stiffness, that satisfy the constraints.

    Raises
    ------
    AssemblyError
        The loops cannot be closed from there; the partial result of the error is the pose with the smallest gaps.
    """
    change = partial(constraint_change, system, stiffness=POSITION_STIFFNESS)
    closest, phi = assemble(system, signals, t, q, change)
    if closed(system, closest, phi) and _keeps_shape(system, q, closest):
        return closest
    closest = _closest(system, signals, t, q)
    phi, _ = system.constraints(signals, t, closest)
    gap, where = gap_texts(system, phi)
    cause = f"the loops do not close: a gap of {gap} remains in {where}"
    raise AssemblyError(cause, Moment(t, 0), closest, "correct angles of the assembly, lengths or places of points")


def _keeps_shape(system: System, start: Array, q: Array) -> bool:
    """Return whether closure hardly changes the shape of links: in linear theory stretching closes any loop."""
    for body in system.bodies:
        markers = [system.marker(PointRef(body.name, point)) for point in system.mechanism.points[body.name]]
        if body.nf == 0 or not markers:
            continue
        places = np.array([marker.x0 for marker in markers])
        deflected = np.array(
            [marker.place(q[body.flexible]) - marker.place(start[body.flexible]) for marker in markers]
        )
        size = np.max(np.linalg.norm(places - places[:1], axis=1), initial=0.0)
        if size > 0.0 and np.max(np.linalg.norm(deflected, axis=1)) > _LARGEST_DEFLECTION * size:
            return False
    return True


def _closest(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Return coordinates at which loops that do not close have the smallest gaps, a local minimum found from q.

    All joints share the gap at the minimum. Undeformed bodies assembled along the tree of joints leave it in the joints
    that close loops.
    """
    # Collinear links may be at a maximum of the gap, where its gradient is zero.
    aside = q.copy()
    aside[[body.angle for body in system.bodies]] += _ASIDE * np.random.default_rng(0).standard_normal(
        len(system.bodies)
    )
    q = minimise_gaps(system, signals, t, aside)
    return reference_pose(system, Assembly("closest", {body.name: float(q[body.angle]) for body in system.bodies}))


def minimise_gaps(system: System, signals: Signals, t: float, q: Array) -> Array:
    """Return coordinates near q with the smallest gaps of all joints, by the Levenberg-Marquardt method.

    The method is slower and less accurate than `project_position`, but suits singular configurations and loops that
    cannot be closed.
    """
    phi, _ = system.constraints(signals, t, q)
    damping = _FIRST_DAMPING
    for _ in range(_MAX_DESCENT):
        if closed(system, q, phi) or damping > _LARGEST_DAMPING:
            break
        trial = q - constraint_change(system, q, POSITION_STIFFNESS, damping)(phi)
        gap, _ = system.constraints(signals, t, trial)
        gain = 1.0 - np.linalg.norm(gap / system.row_units) / np.linalg.norm(phi / system.row_units)
        if gain > 0.0:
            q, phi = trial, gap
        if 0.0 <= gain < _NO_GAIN:
            break
        damping *= 0.2 if gain > 0.0 else 5.0
    return q


def project_velocity(system: System, signals: Signals, t: float, q: Array, v: Array, stiffness: float = 0.0) -> Array:
    """Return the nearest velocities, in the mass metric, at which Phi' is zero.

    They are those after a plastic impact. With a weight of stiffness, see `link_metric`, links hardly start to bend.

    Raises
    ------
    InconsistentConstraintsError
        There are none: two prescribed motions contradict one another.
    """

    def left(v: Array) -> Array:
        return system.constraints(signals, t, q, v)[1]

    found = project(constraint_change(system, q, stiffness), v, left)
    refuse_conflict(system, "velocities", t, q, left(v), left(found))
    return found


@checked_arguments()
@solvable("a consistent pose")
def consistent_state(
    system: System,
    assembly: str | Assembly | None,
    *,
    deflection: Mapping[str, Array] | None = None,
    velocity: Array | None = None,
    time: float = 0.0,
) -> State:
    """Return a consistent start: a closed assembly, with the initial deflection and velocity if given.

    Parameters
    ----------
    system : System
        System of the mechanism.
    assembly : Assembly or str
        Assembly or its name; the first of the mechanism if None.
    deflection : mapping of str to (n_nodal,) array, optional
        Nodal coordinates of bodies by name (4 per node, then separate curvatures if any); their part that the mesh's
        reference condition allows is kept. Undeformed by default.
    velocity : (n,) array, optional
        Velocities, projected onto the constraints as by an impact. By default at rest, or moving with prescribed
        angles, without bending of links.
    time : float
        Time of prescribed joint angles [s]; zero by default.

    Raises
    ------
    AssemblyError
        The loops cannot be closed.
    InconsistentConstraintsError
        No velocities or accelerations satisfy all constraints.
    """
    chosen = assembly if isinstance(assembly, Assembly) else system.mechanism.assembly(assembly)
    q = reference_pose(system, chosen)
    for name, nodal in (deflection or {}).items():
        body = system.body(name)
        q[body.flexible] = np.linalg.lstsq(body.integrals.D, nodal, rcond=None)[0]
    signals = moment_signals(system.mechanism, time)
    q = assembled_position(system, signals, time, q)
    try:
        wanted, stiffness = (np.zeros(system.n), VELOCITY_STIFFNESS) if velocity is None else (velocity, 0.0)
        v = project_velocity(system, signals, time, q, wanted, stiffness)
        check_accelerations(system, signals, time, q, v)
    except InconsistentConstraintsError as error:
        target = -system.constraints(signals, time, q)[1]
        found = change_point_at(system, signals, time, q, system.jacobian(q), target)
        if not found.cause:
            raise
        raise InconsistentConstraintsError(f"{found.cause},", error.moment, remedy=found.remedy) from None
    return State(time, q, v)


def check_accelerations(system: System, signals: Signals, t: float, q: Array, v: Array) -> None:
    """Check that accelerations exist that satisfy all constraints at a consistent position and velocity.

    Raises
    ------
    InconsistentConstraintsError
        There are none: two prescribed motions contradict one another, or a singular configuration is in motion. Or
        there are two, from rest at a change point.
    """
    if not np.any(v) and branches_from_rest(system, signals, t, q):
        cause = "prescribed motions begin at rest at a change point, from which two branches lead on,"
        raise InconsistentConstraintsError(cause, Moment(t, 0), remedy="start beside this pose, or in motion")
    rest = np.zeros(system.n)
    target = second_rates(system, signals, t, q, v, rest)
    if np.any(target):
        left = partial(second_rates, system, signals, t, q, v)
        found = project(constraint_change(system, q), rest, left)
        refuse_conflict(system, "accelerations", t, q, target, left(found))
