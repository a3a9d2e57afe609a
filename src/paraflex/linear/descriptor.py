"""Linearised equations at a value of s in descriptor form: without elimination, as sparse as the mechanism.

With dq = q, dv = s q + c and da = s^2 q + d, where c and d are due to the velocities of the nominal motion,

    [s^2 M + s D + K, H^T] [q; lambda] = [S u - D c - M d; u_d + s x_1 + x_2]
    [H, 0]
    G c + G' q = [0; -x_1],    G d + G''_q q + G''_v (s q + c) = [0; -s x_1 - x_2]

G is [Phi_q; T], and H has the rows of the constraints and of the driven coordinates, the latter times s^2. (x_1, x_2)
is added to the derivatives of the states: s x = A x + B u + (x_1, x_2). At rest G' and G'' are zero, and c and d known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arrays import Array, Complex, Indices, Numbers
from paraflex.dynamics.sensors import SensorRows
from paraflex.dynamics.sparse import Factor
from .minimal import MinimalEquations

# Seed of the starting vector of Arnoldi's method.
_SEED = 0


class SmallMotion(NamedTuple):
    """Amplitudes of a small motion: coordinates and their derivatives (n, k), and multipliers (m, k)."""

    q: Numbers
    v: Numbers
    a: Numbers
    multipliers: Numbers


class Descriptor:
    """Factorised descriptor equations at a value of s, real for a real s.

    Parameters
    ----------
    minimal : MinimalEquations
        Linearised equations, of which only sparse matrices are used.
    s : complex or float
        Laplace variable [rad/s].
    """

    def __init__(self, minimal: MinimalEquations, s: complex) -> None:
        self.minimal: MinimalEquations = minimal
        self.s: complex = s
        whole, rows = minimal.tangents.whole, minimal.held_rows
        mass, damping, stiffness = whole.mass, whole.damping, whole.stiffness
        weight = np.ones(rows.number.size, dtype=np.result_type(s))
        weight[weight.size - minimal.driven :] = s**2
        square = abs(s) ** 2 * mass.diagonal() + np.abs(stiffness.diagonal())
        column = 1.0 / np.sqrt(np.where(square > 0.0, square, mass.diagonal()))
        size = 1.0 / scipy.sparse.linalg.norm(rows.jacobian @ scipy.sparse.diags(column), axis=1)
        held, corner = scipy.sparse.diags(weight) @ rows.jacobian, csr_matrix((rows.number.size, rows.number.size))
        blocks = [[s**2 * mass + s * damping + stiffness, rows.jacobian.T], [held, corner]]
        units = [column, size]
        if not minimal.point.at_rest:
            # Matrices G, G', G''_q and G''_v; bodies that are states have rows of the unit matrix in G.
            own = csr_matrix(scipy.sparse.eye(minimal.system.n))[minimal.chosen.bodies]
            parts = zip(minimal.constraints[:4], minimal.joints[:4], [own, *[csr_matrix(own.shape)] * 3], strict=True)
            along, first, place, rate = (csr_matrix(scipy.sparse.vstack(part)) for part in parts)
            blocks[0] += [damping, mass]
            blocks[1] += [None, None]
            blocks += [[first, None, along, None], [place + s * rate, None, rate, along]]
            units += [column, column]
        self._factor = Factor(csr_matrix(scipy.sparse.bmat(blocks)), np.concatenate(units))

    def response(self, inputs: Indices) -> SmallMotion:
        """Compute the amplitudes of the motion for unit amplitudes of the given inputs."""
        minimal, held = self.minimal, self.minimal.held_rows.number.size
        driven = scipy.sparse.eye(held, minimal.driven, minimal.driven - held)
        right = csr_matrix(scipy.sparse.block_diag([minimal.forces, driven]))
        return self._solved(right[:, inputs].toarray(), np.zeros((2, minimal.chosen.freedoms, inputs.size)))

    def states(self, added: Array) -> Array:
        """Solve for the states (2f,) with `added` (2f,) added to their derivatives, for a real s."""
        minimal = self.minimal
        x = np.reshape(added, (2, -1, 1))
        joints = minimal.chosen.joints.size
        right = np.zeros((minimal.system.n + minimal.held_rows.number.size, 1))
        if minimal.driven:
            right[-minimal.driven :] = (self.s * x[0] + x[1])[joints - minimal.driven : joints]
        q = self._solved(right, x).q
        y = np.concatenate([minimal.joints.jacobian @ q, q[minimal.chosen.bodies]])
        return np.concatenate([y, self.s * y - x[0]]).ravel()

    def _solved(self, right: Numbers, added: Array) -> SmallMotion:
        """Solve for the motion, with the right-hand side of the first two equations and additions to x'."""
        minimal, s, n = self.minimal, self.s, self.minimal.system.n
        whole = minimal.tangents.whole
        # Zeros stay real for any s, as the right-hand side of a response is.
        of_rates = np.stack([added[0], s * added[0] + added[1]]) if np.any(added) else added
        if minimal.point.at_rest:
            c, d = (-minimal.coordinates(np.zeros((minimal.chosen.constraints.size, each.shape[1])), each)
                    for each in of_rates)  # fmt: skip
            right[:n] -= whole.damping @ c + whole.mass @ d
            q, lam = np.split(self._factor.solve(right), [n])
        else:
            more = np.zeros((2, n, right.shape[1]), dtype=of_rates.dtype)
            more[:, n - minimal.chosen.freedoms :] = -of_rates
            found = self._factor.solve(np.vstack([right, *more]))
            q, lam, c, d = np.split(found, np.cumsum([n, minimal.held_rows.number.size, n]))
        v, a = s * q + c, s**2 * q + d
        multipliers = np.zeros((minimal.system.m, q.shape[1]), dtype=q.dtype)
        multipliers[minimal.held_rows.number] = lam
        multipliers[minimal.tangents.compliant] = whole.compliant_place @ q + whole.compliant_rate @ v
        return SmallMotion(q, v, a, multipliers)


def response_at(minimal: MinimalEquations, rows: SensorRows, inputs: Indices, s: complex) -> Complex:
    """Compute the response (outputs, inputs) of sensors to the given inputs at s."""
    found = Descriptor(minimal, complex(s)).response(inputs)
    out = rows.q @ found.q + rows.v @ found.v + rows.a @ found.a + rows.multipliers @ found.multipliers
    own = np.nonzero(inputs < minimal.motors.size)[0]
    out[:, own] += rows.torques[:, minimal.motors[inputs[own]]].toarray()
    return out


def poles_near(minimal: MinimalEquations, distance: float, count: int) -> Complex:
    """Compute the `count` poles nearest to a point on the positive real axis [rad/s], by inverse Arnoldi iteration."""
    at = Descriptor(minimal, distance)
    n = 2 * minimal.chosen.freedoms
    inverse = scipy.sparse.linalg.LinearOperator((n, n), matvec=lambda x: at.states(x.ravel()), dtype=np.dtype(float))
    start = np.random.default_rng(_SEED).standard_normal(n)
    theta = scipy.sparse.linalg.eigs(inverse, k=count, v0=at.states(start), return_eigenvectors=False)
    return np.asarray(distance - 1.0 / np.asarray(theta), dtype=complex)
