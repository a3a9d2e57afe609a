"""Closure of a mechanism for a given motion of the end-effector: positions, velocities and accelerations."""

from typing import Annotated, NamedTuple

from . import joints
from .arrays import Floats, Ints, allocated, copy, fill
from .axes import apply_axes
from .compiling import by_reference, inlined, releases_lock, routine, unoptimised
from .constraints import constraint_values, fill_jacobian
from .dense import factor_dense, solve_factored
from .packed import INDEX_1, PackedSystem, Scratch, make_scratch, sizes_of

MAX_ITERATIONS = 20
# Number of iterations with the factors of the previous sample.
CHORDS = 8
# Newton's iteration has converged if no body turns by more than this [rad], or shifts by more than this part of the
# mechanism's size.
SMALLEST_MOVE = 1e-13
# A body that deviates from its prediction by a larger rotation [rad], or by a shift of this many sizes of the
# mechanism, may have jumped to another assembly.
LARGEST_TURN, LARGEST_SHIFT = 0.3, 1.2
# A pivot below this fraction of the largest entry of the dimensionless Jacobian marks a singular position.
SINGULAR_PIVOT = 1e-11
LOOPS_CLOSED, LOOPS_OPEN, TOO_COARSE, LOOPS_SINGULAR = range(4)


@by_reference
class ClosureScratch(NamedTuple):
    """Work arrays of the closure."""

    single: Annotated[Floats, "n", 1]  # residual of positions, then their correction; also for accelerations
    right: Annotated[Floats, "n", "columns"]  # right-hand sides of velocities and the basis
    jacobian: Annotated[Floats, "n", "n"]  # dimensionless Jacobian at this sample
    before: Annotated[Floats, "n", "n"]  # dimensionless Jacobian at the previous sample
    factors: Annotated[Floats, "n", "n"]  # factors of `before`
    order: Annotated[Ints, "n"]
    fresh: Annotated[Floats, "n", "n"]  # factors at the current pose
    fresh_order: Annotated[Ints, "n"]
    change: Annotated[Floats, "n", "n"]
    here: Annotated[Floats, 3, "tasks"]  # task coordinates, their rates and accelerations
    phi: Annotated[Floats, "m"]
    dphi: Annotated[Floats, "m"]
    lam: Annotated[Floats, "m"]  # zero, like `zero` and `idle`
    zero: Annotated[Floats, "n"]
    idle: Annotated[Floats, "signals"]  # motors have no effect here, but axes read their forces
    unused: Annotated[Floats, "n"]  # forces that are not used
    body: Scratch


def make_closure_scratch(system: PackedSystem, tasks: int, signals: int) -> ClosureScratch:
    """Allocate the work arrays of `close_path`."""
    sizes = {**sizes_of(system), "tasks": tasks, "columns": 1 + tasks, "signals": signals}
    return allocated(ClosureScratch, sizes, body=make_scratch(system))


@unoptimised
def task_values(system, marker, coordinates, q, v, a, out):
    """Compute value, rate and acceleration of each task coordinate of a marker into out (3, tasks).

    `coordinates` (tasks,) are 0 for x, 1 for y, 2 for the angle.
    """
    px, py, vx, vy, ax, ay, _, _ = joints.marker_motion(system, marker, q, v, a)
    for i in range(coordinates.size):
        if coordinates[i] == 0:
            out[0, i], out[1, i], out[2, i] = px, vx, ax
        elif coordinates[i] == 1:
            out[0, i], out[1, i], out[2, i] = py, vy, ay
        else:
            out[0, i], out[1, i], out[2, i] = joints.marker_angles(system, marker, q, v, a)


@routine
def closure_jacobian(system, marker, coordinates, q, jacobian):
    """Compute [Phi_q; task_q] at q."""
    m = system.rows.size
    fill_jacobian(system, q, jacobian)
    for i in range(coordinates.size):
        fill(jacobian[m + i], 0.0)
    _, _, _, _, _, _, rx, ry = joints.marker_motion(system, marker, q, q, q)
    for i in range(coordinates.size):
        if coordinates[i] == 2:
            joints.apply_torque(system, marker, 1.0, jacobian[m + i])
        else:
            unit = 1.0 if coordinates[i] == 0 else 0.0
            joints.apply_force(system, marker, q, unit, 1.0 - unit, rx, ry, jacobian[m + i])


@routine
def row_unit(system, coordinates, r):
    """Return the unit of row r: the size of the mechanism for a length, 1 for an angle."""
    if r < system.rows.size:
        return system.rows[r].unit
    return 1.0 if coordinates[r - system.rows.size] == 2 else system.size


@routine
def scaled_jacobian(system, marker, coordinates, q, jacobian):
    """Compute the dimensionless [Phi_q; task_q] at q.

    Rows are in their units, positions of bodies in sizes of the mechanism.
    """
    closure_jacobian(system, marker, coordinates, q, jacobian)
    for r in range(jacobian.shape[0]):
        unit = row_unit(system, coordinates, r)
        for j in range(jacobian.shape[1]):
            jacobian[r, j] /= unit
        for i in range(system.bodies.size):
            for j in range(system.bodies[i].offset, system.bodies[i].offset + 2):
                jacobian[r, j] *= system.size


@routine
def solve_scaled(system, coordinates, factors, order, right):
    """Solve for coordinates [m, rad] with the factors of a dimensionless Jacobian, in place."""
    for r in range(right.shape[0]):
        unit = row_unit(system, coordinates, r)
        for k in range(right.shape[1]):
            right[r, k] /= unit
    solve_factored(factors, order, right)
    for i in range(system.bodies.size):
        for j in range(system.bodies[i].offset, system.bodies[i].offset + 2):
            for k in range(right.shape[1]):
                right[j, k] *= system.size


@routine
def largest_shift(system, x):
    """Return the largest change of position among changes of coordinates, in sizes of the mechanism."""
    shift = 0.0
    for i in range(system.bodies.size):
        first = system.bodies[i].offset
        shift = max(shift, abs(x[first]) / system.size, abs(x[first + 1]) / system.size)
    return shift


@routine
def largest_turn(system, x):
    """Return the largest rotation of a body among changes of coordinates [rad]."""
    turn = 0.0
    for i in range(system.bodies.size):
        turn = max(turn, abs(x[system.bodies[i].offset + 2]))
    return turn


@routine
def relative_change(work):
    """Return the norm of before^-1 (jacobian - before): below one, no matrix between the two is singular.

    Assemblies meet where the Jacobian is singular, and a step across such a position may end in another assembly. A
    step that is short enough does not, and no step across a singularity is short enough. The sign of the determinant is
    not sufficient: two loops may be singular at once, such as an arm and the parallelogram beside it.
    """
    n, columns = work.jacobian.shape[0], 0
    for j in range(n):
        moves = False
        for i in range(n):
            work.change[i, columns] = work.jacobian[i, j] - work.before[i, j]
            moves = moves or work.change[i, columns] != 0.0
        # Most columns are the same in all positions.
        if moves:
            columns += 1
    change = work.change[:, :columns]
    solve_factored(work.factors, work.order, change)
    norm = 0.0
    for i in range(n):
        total = 0.0
        for j in range(columns):
            total += abs(change[i, j])
        norm = max(norm, total)
    return norm


@routine
def close_loops(system, signals, marker, coordinates, t, goal, known, q, work):
    """Close the loops at one time by Newton's method, from the pose in q; return the status.

    `known` is True if work.factors are those of a pose nearby; they are used as long as the iteration converges
    quickly.
    """
    for iteration in range(MAX_ITERATIONS):
        constraint_values(system, signals, t, q, work.zero, work.body, work.phi, work.dphi)
        task_values(system, marker, coordinates, q, work.zero, work.zero, work.here)
        for r in range(work.phi.size):
            work.single[r, 0] = work.phi[r]
        for i in range(coordinates.size):
            work.single[work.phi.size + i, 0] = work.here[0, i] - goal[i]
        if known and iteration < CHORDS:
            solve_scaled(system, coordinates, work.factors, work.order, work.single)
        else:
            scaled_jacobian(system, marker, coordinates, q, work.fresh)
            if factor_dense(work.fresh, work.fresh_order) < SINGULAR_PIVOT:
                return LOOPS_SINGULAR
            solve_scaled(system, coordinates, work.fresh, work.fresh_order, work.single)
        for j in range(q.size):
            q[j] -= work.single[j, 0]
        move = max(largest_shift(system, work.single[:, 0]), largest_turn(system, work.single[:, 0]))
        if move < SMALLEST_MOVE * (1.0 + max(largest_shift(system, q), largest_turn(system, q))):
            return LOOPS_CLOSED
    return LOOPS_OPEN


@inlined
def second_derivatives(system, signals, marker, coordinates, t, q, v, a, work):
    """Compute Phi'' into work.phi, and the task coordinates with two derivatives into work.here."""
    joints.start_rows(system, signals, t, INDEX_1, work.phi)
    for i in range(system.bodies.size):
        joints.body_joints(system, i, q, v, a, work.lam, INDEX_1, work.body, work.unused, work.phi)
    apply_axes(system, q, v, a, work.lam, INDEX_1, work.idle, work.unused, work.phi)
    task_values(system, marker, coordinates, q, v, a, work.here)


@routine
def move_loops(system, signals, marker, coordinates, t, target, q, v, a, basis, work):
    """Compute velocities, accelerations and basis of closed loops, with the factors at their pose."""
    m, tasks = work.phi.size, coordinates.size
    constraint_values(system, signals, t, q, work.zero, work.body, work.phi, work.dphi)
    for r in range(q.size):
        fill(work.right[r], 0.0)
    for r in range(m):
        work.right[r, 0] = -work.dphi[r]
    for i in range(tasks):
        work.right[m + i, 0] = target[1, i]
        work.right[m + i, 1 + i] = 1.0
    solve_scaled(system, coordinates, work.factors, work.order, work.right)
    for j in range(q.size):
        v[j] = work.right[j, 0]
        for i in range(tasks):
            basis[j, i] = work.right[j, 1 + i]
    # Part of Phi'' and of the task's acceleration that does not depend on the accelerations.
    second_derivatives(system, signals, marker, coordinates, t, q, v, work.zero, work)
    for r in range(m):
        work.single[r, 0] = -work.phi[r]
    for i in range(tasks):
        work.single[m + i, 0] = target[2, i] - work.here[2, i]
    solve_scaled(system, coordinates, work.factors, work.order, work.single)
    for j in range(q.size):
        a[j] = work.single[j, 0]


@releases_lock
def close_path(system, signals, marker_index, coordinates, times, target, q, v, a, basis, work):
    """Close the loops along a path, starting at each sample from the previous one.

    Parameters
    ----------
    target : (times, 3, tasks) array
        Task coordinates, their rates and accelerations.
    q, v, a : (times, n) arrays
        Coordinates, velocities and accelerations. Written; q[0] holds the starting pose.
    basis : (times, n, tasks) array
        Change of the coordinates per change of the task coordinates, the null space of Phi_q in task coordinates.
        Written.
    work : ClosureScratch
        Work arrays.

    Returns
    -------
    status, index
        Status; if it is not LOOPS_CLOSED, index of the last sample. Other values are LOOPS_OPEN, LOOPS_SINGULAR, and
        TOO_COARSE if a singular position may lie between this sample and the previous one.
    """
    marker = system.markers[marker_index]
    for k in range(times.size):
        if k > 0:
            dt = times[k] - times[k - 1]
            for j in range(q.shape[1]):
                q[k, j] = q[k - 1, j] + dt * (v[k - 1, j] + 0.5 * dt * a[k - 1, j])
        copy(q[k], work.unused)
        status = close_loops(system, signals, marker, coordinates, times[k], target[k, 0], k > 0, q[k], work)
        if status != LOOPS_CLOSED:
            return status, k
        for j in range(q.shape[1]):
            work.unused[j] -= q[k, j]
        if k > 0 and (
            largest_turn(system, work.unused) > LARGEST_TURN or largest_shift(system, work.unused) > LARGEST_SHIFT
        ):
            return TOO_COARSE, k
        scaled_jacobian(system, marker, coordinates, q[k], work.jacobian)
        if k > 0 and relative_change(work) >= 1.0:
            return TOO_COARSE, k
        for j in range(q.shape[1]):
            copy(work.jacobian[j], work.before[j])
            copy(work.jacobian[j], work.factors[j])
        if factor_dense(work.factors, work.order) < SINGULAR_PIVOT:
            return LOOPS_SINGULAR, k
        move_loops(system, signals, marker, coordinates, times[k], target[k], q[k], v[k], a[k], basis[k], work)
    return LOOPS_CLOSED, times.size
