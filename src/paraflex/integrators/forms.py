"""Equations of motion for external solvers: functions of time and one vector, with Jacobian and tolerances.

An `OdeForm` has y = (q, v, work), with multipliers eliminated; the two forms for DAE solvers add them as unknowns. The
work done is integrated with the motion, but does not affect the step size.
"""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System, dependence, inputs_of
from paraflex.kernel import ode
from paraflex.kernel.error import MEMORY_PART
from paraflex.kernel.packed import OMEGA2, Signals
from paraflex.kernel.tangent import make_tangent
from .options import IntegrationOptions
from .run import DEPENDENT_PART, Problem

# Tolerance of a component whose error does not count [any unit].
_IGNORED = 1e20


class Solved(NamedTuple):
    """Accelerations (n,) and multipliers (m,) at one time, and the number of dependent rows there."""

    a: Array
    multipliers: Array
    dependent: int


class OdeForm:
    """ODE q' = v, v' = a(t, q, v), work' = power (Eqs. 59-60).

    Attributes
    ----------
    signals : Signals
        Inputs visible to the current steps; replaced at jumps.
    """

    def __init__(self, problem: Problem, options: IntegrationOptions) -> None:
        system = problem.system
        self.system = system
        self.signals: Signals = problem.signals
        self._weights = (1.0, 2.0 * options.alpha, options.beta**2)
        self._torques, self._ws = np.zeros(inputs_of(system.mechanism).acting), system.workspace()
        self._a, self._lam, self._tangent = np.zeros(system.n), np.zeros(system.m), make_tangent(system.packed)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 2 * self.system.n + 1

    def solve(self, t: float, q: Array, v: Array) -> Solved:
        """Return accelerations and multipliers."""
        a, lam = np.zeros(self.system.n), np.zeros(self.system.m)
        dependent = ode.accelerations(
            self.system.packed, self.signals, t, self._weights, np.ascontiguousarray(q), np.ascontiguousarray(v),
            a, lam, self._torques, self._ws, DEPENDENT_PART,
        )  # fmt: skip
        return Solved(a, lam, dependent)

    def rates(self, t: float, y: Array) -> Array:
        """Return y' at (t, y), in a new array."""
        dy = np.empty(y.size)
        ode.rates(
            self.system.packed, self.signals, t, self._weights, np.array(y), self._a, self._lam, self._torques,
            self._ws, DEPENDENT_PART, dy,
        )  # fmt: skip
        return dy

    def jacobian(self, t: float, y: Array) -> Array:
        """Return the derivative of `rates` by y, in a new array."""
        out = np.empty((y.size, y.size))
        self.rates(t, y)
        arguments = (self._a, self._lam, self._torques, self._ws, self._tangent, out)
        ode.rates_jacobian(self.system.packed, self._weights, np.array(y), *arguments)
        return out

    def pack(self, t: float, q: Array, v: Array, work: float) -> Array:
        """Return the vector y of a motion."""
        return np.concatenate([q, v, [work]])

    def unpack(self, y: Array) -> tuple[Array, Array, float]:
        """Return the motion of a vector y: q, v, work."""
        n = self.system.n
        return y[:n].copy(), y[n : 2 * n].copy(), float(y[-1])

    def tolerances(self, error: float, span: float) -> Array:
        """Return absolute tolerances (size,) for a norm that is the root mean square of errors over tolerances.

        With these the norm is at most one if, in the mass norm, the position error is at most `error` [m], and so is
        the effect of the velocity error until it reverses: after 1 / omega in a flexible coordinate, else after a
        quarter of the run. Off-diagonal terms of the mass matrix are neglected.
        """
        system = self.system
        q = error * np.sqrt(system.total_mass / (self.size * diagonal_mass(system)))
        frequency = np.full(system.n, 1.0 / (MEMORY_PART * span))
        for body, packed in zip(system.bodies, system.packed.bodies, strict=True):
            omega2 = system.packed.modal[OMEGA2, packed["flex"] : packed["flex"] + body.nf]
            frequency[body.flexible] = np.maximum(frequency[body.flexible], np.sqrt(np.maximum(omega2, 0.0)))
        out = np.full(self.size, _IGNORED)
        out[: 2 * system.n] = np.concatenate([q, frequency * q])
        return out


class DescriptorForm(OdeForm):
    """DAE of index 1 in y = (q, v, lambda, work), with Baumgarte's terms (Eqs. 56-57).

    Constraint rows that depend on others at the start are left out, their multipliers are zero.
    """

    multipliers = 1

    def __init__(self, problem: Problem, options: IntegrationOptions) -> None:
        super().__init__(problem, options)
        self._dropped = np.zeros(self.system.m, dtype=bool)
        self._dropped[dependence(self.system, problem.initial.q).dropped] = True

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 2 * self.system.n + self.multipliers * self.system.m + 1

    @property
    def algebraic(self) -> Indices:
        """Indices of the unknowns without a derivative."""
        return np.arange(2 * self.system.n, self.size - 1)

    def residual(self, t: float, y: Array, dy: Array, out: Array) -> None:
        """Compute the residual into out (size,)."""
        arguments = (np.array(y), np.array(dy), self._dropped, self._torques, self._ws, out)
        ode.descriptor_residual(self.system.packed, self.signals, t, self._weights, *arguments)

    def matrix(self, t: float, y: Array, dy: Array, c: float) -> Array:
        """Return the derivative of the residual by y, plus c times that by dy, in a new array."""
        out = np.empty((self.size, self.size))
        self.residual(t, y, dy, np.empty(self.size))
        arguments = (c, self._dropped, self._torques, self._ws, self._tangent, out)
        ode.descriptor_jacobian(self.system.packed, self._weights, np.array(y), np.array(dy), *arguments)
        return out

    def pack(self, t: float, q: Array, v: Array, work: float) -> Array:
        """Return the vector y of a motion, with the multipliers at this time."""
        lam = self.solve(t, q, v).multipliers
        return np.concatenate([q, v, lam, np.zeros((self.multipliers - 1) * self.system.m), [work]])

    def slopes(self, t: float, y: Array) -> Array:
        """Return the derivative of a packed y, zero for algebraic unknowns."""
        n, dy = self.system.n, np.zeros(self.size)
        found = self.rates(t, np.concatenate([y[: 2 * n], y[-1:]]))
        dy[: 2 * n], dy[-1] = found[:-1], found[-1]
        return dy


class StabilisedForm(DescriptorForm):
    """Stabilised form of index 2 in y = (q, v, lambda, mu, work): Gear, Gupta and Leimkuhler (1985)."""

    multipliers = 2

    def __init__(self, problem: Problem, options: IntegrationOptions) -> None:
        super().__init__(problem, options)
        system = self.system
        self._weight, self._idle = diagonal_mass(system), np.zeros(system.n + self._torques.size)
        self._phi, self._dphi = np.zeros(system.m), np.zeros(system.m)

    def residual(self, t: float, y: Array, dy: Array, out: Array) -> None:
        """Compute the residual into out (size,)."""
        arguments = (self._weight, self._torques, self._idle, self._ws, self._tangent, self._phi, self._dphi, out)
        packed, signals = self.system.packed, self.signals
        ode.stabilised_residual(packed, signals, t, np.array(y), np.array(dy), self._dropped, *arguments)

    def matrix(self, t: float, y: Array, dy: Array, c: float) -> Array:
        """Return the derivative of the residual by y, plus c times that by dy, in a new array."""
        out = np.empty((self.size, self.size))
        self.residual(t, y, dy, np.empty(self.size))
        arguments = (self._weight, self._torques, self._idle, self._ws, self._tangent, out)
        ode.stabilised_jacobian(self.system.packed, np.array(y), np.array(dy), c, self._dropped, *arguments)
        return out


def diagonal_mass(system: System) -> Array:
    """Return the mass (n,) of each coordinate: the body's mass, its moment of inertia, one for modes of unit mass."""
    mass = np.ones(system.n)
    for body, packed in zip(system.bodies, system.packed.bodies, strict=True):
        mass[body.offset : body.offset + 3] = packed["m"], packed["m"], packed["I0"]
    return mass
