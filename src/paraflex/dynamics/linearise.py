"""Small vibrations of a mechanism about a pose: natural frequencies and mode shapes of the assembled system at rest.

With lambda the constraint forces at rest, admissible displacements x, C x = 0, satisfy

    M x'' + K x + C^T mu = 0,   K = d/dq (K_elastic u + springs - weight - loads + Phi_q^T lambda), lambda constant
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.limits import solvable
from .rank import dependence
from .sparse import Saddle, sparse_jacobian, sparse_joint_rows, sparse_mass, stiffness_diagonal
from .state import State
from .stiffness import RestingForces, pose_stiffness
from .system import System

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix as Sparse


# Beyond this number of coordinates a dense eigenvalue problem takes minutes: only the lowest are computed.
DENSE_COORDINATES, LOWEST = 600, 10
# Acceleration after release below which a mechanism counts as balanced [m/s^2].
BALANCED = 1e-5
# A squared frequency below this fraction of the typical one is that of a free motion.
_FREE = 1e-9
# Scaled constraint rows with a smaller singular value than this fraction of the largest are redundant.
_DEPENDENT = 1e-10
# Up to this number of degrees of freedom random displacements are the basis, as Lanczos' method needs more; directions
# blocked by held motors are recognised by their size, squared.
_FEW, _INDEPENDENT = 30, 1e-12
# First shift in typical squares; a shift of one could cancel the diagonal entry of a negative stiffness.
_ABOVE = 2.0
# Factor that reduces the shift while many squares are below it, and its least fraction of the typical square.
_DESCENT, _LEAST = 1e-2, 1e-13
# Rounding error of the square of a free motion, as a fraction of its terms.
_ROUNDING = 1e-14
# Largest number of tenfold increases of the shift until the shifted stiffness is positive definite.
_SHIFTS = 15


@dataclass(frozen=True)
class Vibration:
    """Small vibrations about a pose.

    Attributes
    ----------
    squares : (k,) array
        Squares of the natural frequencies, ascending [rad^2/s^2]. Zero for a free motion, negative for an unstable one.
    shapes : (n, k) array
        Mode shapes: displacements of the coordinates, of unit modal mass.
    acceleration : float
        Initial acceleration of the mechanism if released, root mean square over the mass [m/s^2]; zero at an
        equilibrium. Elsewhere the frequencies are those of a mechanism held in place by constant forces.
    complete : bool
        Whether these are all vibrations, not only the lowest.
    """

    squares: Array
    shapes: Array
    acceleration: float
    complete: bool

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (k,) [rad/s], zero for free and unstable motions."""
        return np.sqrt(np.maximum(self.squares, 0.0))


@checked_arguments()
@solvable("natural frequencies")
def natural_frequencies(
    system: System,
    state: State,
    held: Sequence[str] = (),
    *,
    torque_at: Sequence[str] = (),
    count: int | None = None,
) -> Vibration:
    """Compute the undamped small vibrations about a pose, as if at rest there.

    Parameters
    ----------
    system : System
        System of the mechanism.
    state : State
        Closed pose: its q, and its time for prescribed angles. Its v has no effect.
    held : sequence of str
        Joints whose angles, slopes of beams included, are kept.
    torque_at : sequence of str
        Joints with motors of constant torque that holds the pose: they rotate freely about it.
    count : int, optional
        Number of the lowest vibrations; all by default, or ten for more than 600 coordinates.
    """
    return vibration_about(system, state, pose_matrices(system, state, [*held, *torque_at]), held, count=count)


class PoseMatrices(NamedTuple):
    """Matrices of small vibrations about a pose, for any choice of held joints.

    Attributes
    ----------
    mass, stiffness : (n, n) sparse matrices
        Mass and stiffness, that of beams included.
    rows : (m, n) sparse matrix
        Constraint rows Phi_q.
    elastic : (n,) array
        Diagonal stiffness of beams.
    typical : float
        Reference for squared frequencies [rad^2/s^2].
    acceleration : float
        Acceleration after release: see `Vibration`.
    """

    mass: Sparse
    stiffness: Sparse
    rows: Sparse
    elastic: Array
    typical: float
    acceleration: float


@solvable("natural frequencies")
def pose_matrices(system: System, state: State, motors: Sequence[str]) -> PoseMatrices:
    """Return the matrices of small vibrations about a pose at rest, held there by motors at joints."""
    M, J = sparse_mass(system, state.q), sparse_jacobian(system, state.q)
    efforts = sparse_joint_rows(system, dict.fromkeys(motors), state.q)
    lam, _, acceleration = forces_at_rest(system, state, M, J, efforts)
    elastic, other = stiffness_diagonal(system), pose_stiffness(system, state.time, state.q, lam)
    typical = typical_square(elastic, other, M)
    K = scipy.sparse.csr_matrix(other + scipy.sparse.diags(elastic))
    return PoseMatrices(M, K, J, elastic, typical, acceleration)


@solvable("natural frequencies")
def vibration_about(
    system: System, state: State, at: PoseMatrices, held: Sequence[str], *, count: int | None = None
) -> Vibration:
    """Compute the small vibrations of `pose_matrices` with joints held; see `natural_frequencies`."""
    rows = sparse_joint_rows(system, dict.fromkeys(held), state.q)
    C = scipy.sparse.csr_matrix(scipy.sparse.vstack([at.rows, rows]))
    if system.n <= DENSE_COORDINATES:
        squares, shapes = all_modes(at.stiffness, at.mass, C, at.elastic, at.typical)
    else:
        freedoms = system.n - dependence(system, state.q).rank
        many = LOWEST if count is None else count
        squares, shapes, _ = slowest(at.stiffness, at.mass, C, at.typical, many, freedoms)
    kept = slice(squares.size if count is None else count)
    complete = system.n <= DENSE_COORDINATES and (count is None or count >= squares.size)
    return Vibration(squares[kept], shapes[:, kept], at.acceleration, complete)


def compliance(system: System, state: State, at: PoseMatrices, held: Sequence[str], rows: Array) -> Array:
    """Return the displacements (k, k) of points by unit forces there, about a pose with joints held.

    Parameters
    ----------
    system, state, at, held
        See `vibration_about`.
    rows : (k, n) array
        Derivatives of the points' positions by the coordinates.
    """
    joints = sparse_joint_rows(system, dict.fromkeys(held), state.q)
    C = scipy.sparse.csr_matrix(scipy.sparse.vstack([at.rows, joints]))
    return rows @ Saddle(at.stiffness, C).solve(rows.T, np.zeros((system.m + len(dict.fromkeys(held)), len(rows))))[0]


def slowest_deflection(system: System, q: Array) -> float:
    """Return the lowest angular frequency of an assembled mechanism by the stiffness of its beams alone [rad/s].

    Springs, loads and weight are left out. The result is infinite if nothing vibrates. For more than 600 coordinates it
    is the lowest frequency of a single beam. That of the last pose is cached, from which other runs may start.
    """
    last, pose = system.once("slowest deflection", dict), q.tobytes()
    found = last.get(pose)
    if found is None:
        found = _slowest_deflection(system, q)
        last.clear()
        last[pose] = found
    return found


def _slowest_deflection(system: System, q: Array) -> float:
    elastic = stiffness_diagonal(system)
    if not np.any(elastic > 0.0):
        return np.inf
    if system.n > DENSE_COORDINATES:
        return system.slowest
    M, typical = sparse_mass(system, q), float(np.min(elastic[elastic > 0.0]))
    basis = admissible(sparse_jacobian(system, q), M, elastic, typical)
    mass = basis.T @ (M @ basis)
    inverse = scipy.linalg.eigvalsh(mass, basis.T @ (elastic[:, None] * basis) + typical * mass) if mass.size else mass
    squares = 1.0 / inverse - typical
    return float(np.sqrt(np.min(squares[squares > _FREE * typical], initial=np.inf)))


class RestForces(NamedTuple):
    """Forces that hold a mechanism at a pose.

    Attributes
    ----------
    multipliers : (m,) array
        Multipliers of joints and springs.
    efforts : (joints,) array
        Torques and forces of motors at joints.
    acceleration : float
        Acceleration after release: see `Vibration`.
    """

    multipliers: Array
    efforts: Array
    acceleration: float


def forces_at_rest(system: System, state: State, M: Sparse, constraints: Sparse, joints: Sparse) -> RestForces:
    """Return the constraint forces at a pose at rest, held by motors at joints.

    Parameters
    ----------
    system, state
        System, and the state at the pose.
    M, constraints, joints : (n, n), (m, n) and (joints, n) sparse matrices
        Mass matrix, Phi_q, and derivatives of the coordinates of the joints with motors.
    """
    forces, lam = RestingForces(system, state.time), np.zeros(system.m)
    springs = forces.springs
    lam[springs] = forces(state.q, lam)[1] / system.packed.rows["compliance"][springs]
    f = forces(state.q, lam)[0] + stiffness_diagonal(system) * state.q
    a, mu = Saddle(M, scipy.sparse.csr_matrix(scipy.sparse.vstack([constraints, joints]))).solve(-f)
    acceleration = float(np.sqrt(max(a @ (M @ a), 0.0) / system.total_mass))
    return RestForces(lam + mu[: system.m], -mu[system.m :], acceleration)


def typical_square(elastic: Array, other: Sparse, M: Sparse) -> float:
    """Return a reference for squared frequencies: the lowest of any body, else that by springs and weight, else one."""
    if np.any(elastic > 0.0):
        return float(np.min(elastic[elastic > 0.0]))
    largest = float(np.max(np.abs(other.diagonal()) / np.asarray(M.diagonal()), initial=0.0))
    return largest if largest > 0.0 else 1.0


def all_modes(K: Sparse, M: Sparse, C: Sparse, elastic: Array, typical: float) -> tuple[Array, Array]:
    """Return all squares (f,), ascending, and shapes (n, f), from the `admissible` motions: see `undamped_modes`."""
    basis = admissible(C, M, elastic, typical)
    squares, shapes = undamped_modes(basis.T @ (M @ basis), basis.T @ (K @ basis), typical)
    return squares, basis @ shapes


def admissible(C: Sparse, M: Sparse, elastic: Array, typical: float) -> Array:
    """Return a basis (n, f) of the displacements that rows C (m, n) allow, with stiff coordinates scaled down.

    Positions and angles are scaled by the root of their mass, as elastic coordinates are, for any size of the
    mechanism.
    """
    scale = 1.0 / np.sqrt(np.asarray(M.diagonal()) + elastic / typical)
    rows = C.toarray() * scale
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0.0] / size[size > 0.0, None]
    return scale[:, None] * scipy.linalg.null_space(rows, rcond=_DEPENDENT)


def undamped_modes(mass: Array, stiffness: Array, typical: float) -> tuple[Array, Array]:
    """Return squared natural frequencies (f,), ascending, and shapes (f, f) of unit mass, for symmetric matrices.

    The eigenvalues computed are 1 / (square + shift), so that low frequencies keep all their digits beside high ones.
    Squares below a fraction of the typical square are set to zero.
    """
    if not mass.size:
        return np.zeros(0), np.zeros((0, 0))
    shift = _shift(mass, stiffness, typical)
    inverse, vectors = scipy.linalg.eigh(mass, stiffness + shift * mass)
    inverse, vectors = inverse[::-1], vectors[:, ::-1]
    squares = 1.0 / inverse - shift
    return np.where(np.abs(squares) < _FREE * typical, 0.0, squares), vectors / np.sqrt(inverse)


def _shift(mass: Array, stiffness: Array, typical: float) -> float:
    """Return a multiple of the mass that makes the stiffness positive definite when added to it."""
    shift = typical
    for _ in range(_SHIFTS):
        if np.linalg.eigvalsh(stiffness + shift * mass)[0] > 0.0:
            break
        shift *= 10.0
    return shift


def _inverse(solver: Saddle, n: int) -> scipy.sparse.linalg.LinearOperator:
    """Return the linear map from forces to admissible displacements."""
    return scipy.sparse.linalg.LinearOperator(
        (n, n), matvec=lambda x: solver.solve(x.ravel())[0], dtype=np.dtype(float)
    )


class LowestModes(NamedTuple):
    """Lowest squares, ascending, their shapes of unit modal mass, and the shift used to find them [rad^2/s^2]."""

    squares: Array
    shapes: Array
    shift: float


def slowest(K: Sparse, M: Sparse, C: Sparse, typical: float, count: int, freedoms: int) -> LowestModes:
    """Return the lowest squares of a mechanism with a given number of degrees of freedom.

    Lanczos' method is applied to the shifted inverse; few degrees of freedom are solved in a basis of all of them.
    """
    n, random = int(np.asarray(M.diagonal()).size), np.random.default_rng(0)
    if not freedoms:
        return LowestModes(np.zeros(0), np.zeros((n, 0)), typical)
    if freedoms > _FEW and K.count_nonzero():
        shift, inverse = _low_shift(K, M, C, typical, min(count + 2, _FEW))
        start = inverse.matvec(M @ random.standard_normal(n))
        squares, shapes = scipy.sparse.linalg.eigsh(K, k=count, M=M, sigma=-shift, OPinv=inverse, v0=start)
        order = np.argsort(squares)
        rounding = _ROUNDING * np.sum(np.abs(shapes) * (abs(K) @ np.abs(shapes)), axis=0)
        squares = np.where(np.abs(squares) < np.maximum(_FREE * shift, rounding), 0.0, squares)
        return LowestModes(squares[order], shapes[:, order], shift)
    inverse = _inverse(Saddle(scipy.sparse.csr_matrix(K + _ABOVE * typical * M), C), n)
    wishes = random.standard_normal((min(freedoms, _FEW), n))
    basis = np.column_stack([inverse.matvec(M @ wish) for wish in wishes])
    size, directions = np.linalg.eigh(basis.T @ (M @ basis))
    kept = size > _INDEPENDENT * np.mean([wish @ (M @ wish) for wish in wishes]) / typical**2
    basis = basis @ (directions[:, kept] / np.sqrt(size[kept]))
    squares, vectors = np.linalg.eigh(basis.T @ (K @ basis))
    squares = np.where(np.abs(squares) < _FREE * typical, 0.0, squares)
    return LowestModes(squares[:count], basis @ vectors[:, :count], typical)


def _low_shift(
    K: Sparse, M: Sparse, C: Sparse, typical: float, count: int
) -> tuple[float, scipy.sparse.linalg.LinearOperator]:
    """Return a shift with few squares below it, and the shifted inverse.

    The lowest squares of a chain of a thousand links are so far below those of one link that Lanczos' method could not
    separate them from a shift of that size.
    """
    n = int(np.asarray(M.diagonal()).size)
    block, shift = np.random.default_rng(0).standard_normal((n, count)), _ABOVE * typical
    while True:
        inverse = _inverse(Saddle(scipy.sparse.csr_matrix(K + shift * M), C), n)
        for _ in range(2):
            block = np.linalg.qr(np.column_stack([inverse.matvec(M @ one) for one in block.T]))[0]
        largest = scipy.linalg.eigh(block.T @ (K @ block), block.T @ (M @ block), eigvals_only=True)[-1]
        if largest >= shift or shift <= _LEAST * typical:
            return shift, inverse
        shift *= _DESCENT
