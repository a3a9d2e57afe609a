"""Sparse mass matrix and constraint Jacobian, and the linear system they form.

A mechanism of thousands of bodies has a few entries per row. The cost of work at a single pose (closing loops, ranks,
frequencies) then grows with the number of entries, not with the square of the number of coordinates.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import scipy

from paraflex.arrays import Array, Indices, Numbers
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.constraints import constraint_values
from paraflex.kernel.packed import OMEGA2, PackedSystem, make_scratch
from paraflex.mechanism import is_hinge
from .joint_coordinates import own_coordinate
from .signals import no_signals
from .system import System

# Diagonal element in place of zero, as a fraction of entries of size one, so that a factor exists with dependent rows;
# iterative refinement removes its effect.
_REGULAR = 1e-10
_REFINEMENTS = 8
# With more right-hand sides at once BLAS starts threads, which on a busy machine take a thousand times as long.
_COLUMNS = 16
# Number of unknowns up to which a dense matrix takes milliseconds.
_MOST_DENSE = 1000
# Refinement continues while it reduces the residual at least by this factor.
_WORTH_WHILE = 0.5


def without_stiffness(packed: PackedSystem) -> PackedSystem:
    """Return the system with zero bending stiffness: beam stiffness, known exactly, would dominate all other terms."""
    modal = packed.modal.copy()
    modal[OMEGA2] = 0.0
    return packed._replace(modal=modal)


def body_masses(system: System, q: Array) -> list[Array]:
    """Return the mass matrix (3 + nf, 3 + nf) of every body at q.

    The equations of motion are linear in the accelerations, and those of a body do not depend on other bodies: a unit
    acceleration of one coordinate of every body gives a column of every matrix.
    """
    bare = without_stiffness(system.packed)
    bare = bare._replace(gravity=np.zeros(2), loads=bare.loads[:0], lines=bare.lines[:0])
    columns = max(3 + body.nf for body in system.bodies)
    a, forces = np.zeros((2, columns, system.n))
    for body in system.bodies:
        a[np.arange(3 + body.nf), np.arange(body.all.start, body.all.stop)] = 1.0
    poses = np.repeat(np.asarray(q, dtype=float)[None], columns, axis=0)
    motion_forces(bare, poses, np.zeros_like(poses), a, np.zeros((columns, 0)), forces, make_scratch(bare))
    return [forces[: 3 + body.nf, body.all].T for body in system.bodies]


def sparse_mass(system: System, q: Array) -> scipy.sparse.csr_matrix:
    """Return the mass matrix (n, n) at q, one block per body."""
    columns, starts = system.once("entries of the mass matrix", lambda: _blocks(system))
    values = np.concatenate([np.zeros(0), *(block.ravel() for block in body_masses(system, q))])
    # The matrix has copies of these, in fewer bits.
    return scipy.sparse.csr_matrix((values, columns, starts), shape=(system.n, system.n))


def _blocks(system: System) -> tuple[Indices, Indices]:
    """Return the columns of the entries of the bodies' blocks, row by row, and the first entry of each row."""
    columns = [np.tile(np.arange(body.all.start, body.all.stop), 3 + body.nf) for body in system.bodies]
    sizes = np.array([3 + body.nf for body in system.bodies], dtype=int)
    starts = np.concatenate([[0], np.cumsum(np.repeat(sizes, sizes))])
    return np.concatenate([np.zeros(0, dtype=int), *columns]), starts


def stiffness_diagonal(system: System) -> Array:
    """Return the elastic stiffness (n,) of each coordinate: omega^2 for modal ones, zero for rigid ones."""
    return np.concatenate([body.stiffness for body in system.bodies])


def elastic_stiffness(system: System, q: Array, *, every_spring: bool = False) -> scipy.sparse.csr_matrix:
    """Return the elastic stiffness (n, n) of links: omega^2 of modes, J^T k J of the springs between finite segments.

    `every_spring` adds the springs at other joints.
    """
    mechanism, stiffness = system.mechanism, scipy.sparse.diags(stiffness_diagonal(system))
    springs = [one for one in mechanism.springs if every_spring or is_hinge(mechanism.joint(one.joint))]
    if springs:
        J = sparse_joint_rows(system, [spring.joint for spring in springs], q)
        stiffness = stiffness + J.T @ scipy.sparse.diags([spring.stiffness for spring in springs]) @ J
    return scipy.sparse.csr_matrix(stiffness)


def sparse_joint_rows(system: System, joints: Iterable[str], q: Array) -> scipy.sparse.csr_matrix:
    """Return the derivatives (joints, n) of the coordinates of joints."""
    parts = [own_coordinate(system, joint, q[None]) for joint in joints]
    rows = np.repeat(np.arange(len(parts)), [columns.size for _, columns in parts])
    columns = np.concatenate([np.zeros(0, dtype=int), *(columns for _, columns in parts)])
    values = np.concatenate([np.zeros(0), *(found.rows[0] for found, _ in parts)])
    matrix = scipy.sparse.csr_matrix((values, (rows, columns)), shape=(len(parts), system.n))
    matrix.eliminate_zeros()
    return matrix


def jacobian_entries(system: System) -> tuple[Indices, Indices, list[tuple[Indices, Indices]]]:
    """Return rows and columns of the entries of Phi_q that may be nonzero, and groups of coordinates that share no row.

    A group is given by its coordinates and the rows of its entries; entries are in the order of the groups.
    """
    return system.once("entries of the Jacobian", lambda: _entries(system))


def _entries(system: System) -> tuple[Indices, Indices, list[tuple[Indices, Indices]]]:
    row, owner = tied_bodies(system)
    offset = np.array([body.offset for body in system.bodies])
    size = np.array([3 + body.nf for body in system.bodies])
    colour = greedy_colours(neighbours(system))
    rows, columns, groups = [row[:0]], [row[:0]], []
    for group in range(int(colour.max(initial=-1)) + 1):
        of_group = colour == group
        for local in range(int(size[of_group].max(initial=0))):
            here = of_group[owner] & (size[owner] > local)
            rows.append(row[here])
            columns.append(offset[owner[here]] + local)
            groups.append((offset[of_group & (size > local)] + local, row[here]))
    return np.concatenate(rows), np.concatenate(columns), groups


def jacobian_values(system: System, q: Array) -> Array:
    """Return the values of `jacobian_entries` at q.

    A column is Phi' with unit velocity of one coordinate. Bodies that share no row are moved at once, so that the
    number of evaluations does not grow with the number of bodies. This holds for all kinds of joints.
    """
    still, scratch = no_signals(system.packed), make_scratch(system.packed)
    phi, rate = np.zeros((2, system.m))
    values = [rate[:0]]
    for moved, rows in jacobian_entries(system)[2]:
        v = np.zeros(system.n)
        v[moved] = 1.0
        constraint_values(system.packed, still, 0.0, q, v, scratch, phi, rate)
        values.append(rate[rows])
    return np.concatenate(values)


def sparse_jacobian(system: System, q: Array) -> scipy.sparse.csr_matrix:
    """Return Phi_q (m, n) at q; zero in the rows of springs and dampers."""
    entries = jacobian_values(system, q), jacobian_entries(system)[:2]
    jacobian = scipy.sparse.csr_matrix(entries, shape=(system.m, system.n))
    jacobian.eliminate_zeros()
    return jacobian


def tied_bodies(system: System) -> tuple[Indices, Indices]:
    """Return the pairs of a constraint row and a body that it involves, as two arrays."""
    ports = system.packed.ports
    pairs: Indices = np.column_stack([ports["row"], system.packed.markers["body"][ports["marker"]]])
    second: Indices = pairs[ports["rows"] == 2] + np.array([1, 0])
    pairs = np.unique(np.concatenate([pairs, second]), axis=0)
    return pairs[:, 0], pairs[:, 1]


def neighbours(system: System, more: Iterable[Sequence[int]] = ()) -> list[set[int]]:
    """Return for each body the set of itself and of the bodies that share a row, or a group of `more`, with it."""
    rows: dict[int, list[int]] = {}
    for row, body in zip(*(part.tolist() for part in tied_bodies(system)), strict=True):
        rows.setdefault(row, []).append(body)
    found = [{i} for i in range(len(system.bodies))]
    for group in (*rows.values(), *more):
        for body in group:
            found[body].update(group)
    return found


def bodies_acted_on(system: System) -> list[set[int]]:
    """Return for each body the bodies on which its forces act, and those that forces on it depend on.

    These are itself, those tied to it by rows or springs, and those of the laws of loads.
    """
    index, mechanism = system.index, system.mechanism
    groups = [(spring.a, spring.b) for spring in mechanism.linear_springs]
    groups += [(one.a, one.b, *mechanism.points_of(law)) for one in mechanism.linear_springs for law in one.laws]
    groups += [(*load.points, *mechanism.points_of(law)) for load in mechanism.loads for law in load.laws]
    return neighbours(system, [[index[ref.body] for ref in group if not ref.on_ground] for group in groups])


def apart_colours(tied: list[set[int]]) -> Indices:
    """Return a colour for every body, such that two bodies of one colour act on no common body."""
    return greedy_colours([set().union(*(tied[other] for other in others)) for others in tied])


def greedy_colours(neighbours: list[set[int]]) -> Indices:
    """Return a colour for every body, different from those of its neighbours."""
    colours = np.full(len(neighbours), -1)
    for body, others in enumerate(neighbours):
        taken = {int(colours[other]) for other in others if other != body}
        colours[body] = next(colour for colour in range(len(taken) + 1) if colour not in taken)
    return colours


class Saddle:
    """Factorised saddle-point system [[W, C^T], [C, -damping]] [x; mu] = [f; r], W symmetric (n, n), C (m, n).

    Rows and columns are scaled to entries of one size. Rows of C may be dependent: the multipliers are then one
    solution of many, and for contradicting r, C x = r holds in the least-squares sense of the scaled rows.

    Parameters
    ----------
    W, C : sparse matrices
        Symmetric block and constraint rows.
    damping : (m,) array, optional
        Damping in the scale of C W^-1 C^T; none by default.
    """

    def __init__(self, W: scipy.sparse.csr_matrix, C: scipy.sparse.csr_matrix, damping: Array | None = None) -> None:
        diagonal = np.abs(W.diagonal())
        diagonal[diagonal == 0.0] = 1.0
        self._column = 1.0 / np.sqrt(diagonal)
        columns = scipy.sparse.dia_matrix(scipy.sparse.diags(self._column))
        scaled = scipy.sparse.csr_matrix(C @ columns)
        size = np.sqrt(np.asarray(scaled.multiply(scaled).sum(axis=1)).ravel())
        self._row = 1.0 / np.where(size > 0.0, size, 1.0)
        scaled = scipy.sparse.csr_matrix(scipy.sparse.diags(self._row) @ scaled)
        corner = np.zeros(self._row.size) if damping is None else damping * self._row**2
        blocks = [[columns @ W @ columns, scaled.T], [scaled, -scipy.sparse.diags(corner)]]
        self._matrix = scipy.sparse.csc_matrix(scipy.sparse.bmat(blocks))
        self._n = self._column.size
        regular = np.concatenate([np.zeros(self._n), np.full(self._row.size, -_REGULAR)])
        self._factor = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(self._matrix + scipy.sparse.diags(regular)))

    def solve(self, f: Array | float = 0.0, r: Array | float = 0.0) -> tuple[Array, Array]:
        """Solve for x (n,) and mu (m,) with right-hand sides f (n,) and r (m,); either may be zero.

        Both may have several columns, (n, k) and (m, k), and so then have x and mu.
        """
        right = np.concatenate([(self._column * np.transpose(f)).T, (self._row * np.transpose(r)).T])
        z = self._factor.solve(right)
        left = right - self._matrix @ z
        for _ in range(_REFINEMENTS):
            better = z + self._factor.solve(left)
            rest = right - self._matrix @ better
            if not np.linalg.norm(rest) < _WORTH_WHILE * np.linalg.norm(left):
                break
            z, left = better, rest
        return (self._column * z[: self._n].T).T, (self._row * z[self._n :].T).T


class Factor:
    """Factorisation of a square matrix that need not be symmetric, with rows scaled to size one.

    Parameters
    ----------
    matrix : (n, n) sparse matrix
        Matrix to factorise.
    units : (n,) array
        Unit of each unknown.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is singular.
    """

    def __init__(self, matrix: scipy.sparse.csr_matrix, units: Array) -> None:
        scaled = scipy.sparse.csr_matrix(matrix @ scipy.sparse.diags(units))
        size = np.asarray(abs(scaled).max(axis=1).todense()).ravel()
        self._units, self._rows = units, 1.0 / np.where(size > 0.0, size, 1.0)
        scaled = scipy.sparse.csc_matrix(scipy.sparse.diags(self._rows) @ scaled)
        scaled.eliminate_zeros()
        self._matrix = scaled
        # If there is no full set of pivots for any values, SuperLU occasionally writes beyond its memory.
        if scipy.sparse.csgraph.structural_rank(scipy.sparse.csr_matrix(abs(scaled))) < units.size:
            raise np.linalg.LinAlgError("structurally singular")
        try:
            self._factor = scipy.sparse.linalg.splu(scaled)
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

    def solve(self, right: Numbers) -> Numbers:
        """Solve for unknowns (n, k) with right-hand sides (n, k)."""
        right = (self._rows[:, None] * right).astype(self._matrix.dtype)
        parts = [self._factor.solve(right[:, k : k + _COLUMNS]) for k in range(0, right.shape[1], _COLUMNS)]
        return self._units[:, None] * np.hstack([right[:, :0], *parts])

    @property
    def condition(self) -> float:
        """Estimate of the condition number of the scaled matrix, in the 1-norm."""
        n = self._units.size
        inverse = scipy.sparse.linalg.LinearOperator(
            (n, n), matvec=self._factor.solve, rmatvec=lambda x: self._factor.solve(x, "T"), dtype=np.dtype(float)
        )
        return float(scipy.sparse.linalg.norm(self._matrix, 1) * scipy.sparse.linalg.onenormest(inverse, t=1))

    @property
    def sign(self) -> float:
        """Sign of the determinant; comparable only between matrices of the same sparsity pattern."""
        odd = sum(_is_odd(order) for order in (self._factor.perm_r, self._factor.perm_c))
        return float(np.prod(np.sign(self._factor.U.diagonal()))) * (-1.0) ** odd


def solved(matrix: scipy.sparse.csr_matrix, units: Array, right: Array) -> Array:
    """Solve for one right-hand side (n,) with a matrix that may be singular, densely if that is fast enough.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is singular, or not finite.
    """
    if not np.all(np.isfinite(matrix.data)):
        raise np.linalg.LinAlgError("not finite")
    if units.size > _MOST_DENSE:
        return Factor(matrix, units).solve(right[:, None])[:, 0]
    scaled = matrix.toarray() * units
    size = np.max(np.abs(scaled), axis=1)
    rows = 1.0 / np.where(size > 0.0, size, 1.0)
    return units * np.linalg.solve(rows[:, None] * scaled, rows * right)


def _is_odd(order: Indices) -> bool:
    """Return whether a permutation consists of an odd number of transpositions."""
    cycles = scipy.sparse.csgraph.connected_components(
        scipy.sparse.csr_matrix((np.ones(order.size), (np.arange(order.size), order)), shape=(order.size,) * 2)
    )[0]
    return bool((order.size - cycles) % 2)
