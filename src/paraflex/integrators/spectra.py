"""Numerical damping and period error of each method for x'' = -omega^2 x with step size h, over h omega.

A step multiplies a vector of values by a matrix (for multistep methods a companion matrix); its eigenvalues are the
method's characteristic roots. The principal root is the one that approximates exp(i h omega).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import ArrayLike, NDArray, Numbers
from paraflex.errors import InputError
from .methods import METHODS, NDF, RK45, Adams, Method, Radau, find_method
from .newmark import NewmarkMethod, NewmarkNumbers
from .tableaux import ESDIRK

Roots = NDArray[Any]

# Coefficients of NDF of orders 0 to 5, as in SciPy: Shampine and Reichelt (1997), Table 1.
_KAPPA = (0.0, -0.1850, -1.0 / 9.0, -0.0823, -0.0415, 0.0)
# Ratio of adjacent frequencies between which the principal root changes little, and the first frequency.
_DENSE, _FIRST_FREQUENCY = 1.02, 1e-3


@dataclass(frozen=True)
class Spectrum:
    """Characteristic roots of a method.

    Attributes
    ----------
    frequency : (k,) array
        Frequencies h omega, ascending [rad].
    principal : (k,) array
        Principal root, which approximates exp(i h omega).
    phase : (k,) array
        Phase of the principal root, continued from zero [rad].
    radius : (k,) array
        Spectral radius, the largest modulus of all roots; above 1 the method is unstable.
    """

    frequency: Numbers
    principal: Roots
    phase: Numbers
    radius: Numbers

    @property
    def damping_ratio(self) -> Numbers:
        """Damping ratio of the numerical vibration (Hughes 1987, 9.1); the exact one is zero."""
        with np.errstate(divide="ignore"):
            return -np.log(np.abs(self.principal)) / self.phase

    @property
    def amplitude_decay(self) -> Numbers:
        """Fraction of the amplitude lost in a period."""
        return 1.0 - np.exp(-2.0 * np.pi * self.damping_ratio)

    @property
    def period_error(self) -> Numbers:
        """Error of the vibration's period as a fraction of the exact one; positive if it is too long."""
        return self.frequency / self.phase - 1.0


def spectrum(method: Method | str, frequency: ArrayLike, *, order: int | None = None) -> Spectrum:
    """Compute the characteristic roots of a method.

    Parameters
    ----------
    method : Method or str
        Method with its parameters, or a name in `METHODS`.
    frequency : (k,) array
        Frequencies h omega, ascending from above zero [rad].
    order : int, optional
        Order of a multistep method, which is required: its roots depend on the order, which changes during a run. None
        for other methods.

    Raises
    ------
    InputError
        There is no such method or order, or the frequencies do not ascend from above zero.
    """
    requested = np.asarray(frequency, dtype=float).reshape(-1)
    if not (
        requested.size and np.all(np.isfinite(requested)) and requested[0] > 0.0 and np.all(np.diff(requested) > 0.0)
    ):
        raise InputError(
            "frequencies must be positive and ascend", field="frequency", remedy="say numpy.geomspace(0.01, 100, 200)"
        )
    roots = _roots(find_method(method), order)
    first = min(_FIRST_FREQUENCY, requested[0])
    steps = int(np.log(requested[-1] / first) / np.log(_DENSE)) + 2
    grid = np.union1d(np.geomspace(first, requested[-1], steps), requested)
    every = [roots(x) for x in grid]
    principal = _followed(every, np.exp(1j * first))
    here = np.searchsorted(grid, requested)
    return Spectrum(
        frequency=requested,
        principal=principal[here],
        phase=np.unwrap(np.angle(principal))[here],
        radius=np.array([np.max(np.abs(every[k])) for k in here]),
    )


def _followed(roots: list[Roots], near: complex) -> Roots:
    """Return from each set of roots the one nearest to the root chosen from the previous set."""
    out = np.zeros(len(roots), dtype=complex)
    for k, candidates in enumerate(roots):
        near = out[k] = candidates[np.argmin(np.abs(candidates - near))]
    return out


def _roots(method: Method, order: int | None) -> Callable[[float], Roots]:
    """Return the characteristic roots as a function of h omega."""
    if method.multistep:
        left, right = multistep_formula(method, order)
        return lambda x: np.roots(left - 1j * x * right)
    if order is not None:
        raise InputError(
            f"{method} has one order only", field="order", value=order,
            remedy=f"leave it out, or take {', '.join(each.name for each in METHODS.values() if each.multistep)}",
        )  # fmt: skip
    if isinstance(method, NewmarkMethod):
        numbers = method.numbers
        if numbers.theta > 1.0:
            return lambda x: np.linalg.eigvals(wilson_step(x, numbers.theta))
        return lambda x: np.linalg.eigvals(newmark_step(x, numbers))
    A, b = tableau_of(method)
    return lambda x: np.array([stability(A, b, 1j * x)])


def tableau_of(method: Method) -> tuple[Numbers, Numbers]:
    """Return the matrix A and weights b of a Runge-Kutta method.

    Raises
    ------
    InputError
        The method is not a Runge-Kutta method, or its tableau is not available here.
    """
    if isinstance(method, RK45):
        return np.pad(scipy.integrate.RK45.A, ((0, 0), (0, 1))), scipy.integrate.RK45.B
    if isinstance(method, Radau):
        return _collocation((4.0 - np.sqrt(6.0)) / 10.0, (4.0 + np.sqrt(6.0)) / 10.0, 1.0)
    if isinstance(method, ESDIRK):
        return method.tableau.A, method.tableau.A[-1]
    raise InputError(
        "the method has no Butcher tableau", field="method", value=method.name, remedy="take a Runge-Kutta method"
    )


def stability(A: Numbers, b: Numbers, z: complex) -> complex:
    """Return R(z) = 1 + z b (1 - z A)^-1 1 of a Runge-Kutta method, the factor of a step for x' = z/h x."""
    return complex(1.0 + z * (b @ np.linalg.solve(np.eye(b.size) - z * A, np.ones(b.size))))


def _collocation(*nodes: float) -> tuple[Numbers, Numbers]:
    """Return the tableau of collocation at nodes of which the last is 1: integrals of Lagrange polynomials."""
    A = np.zeros((len(nodes), len(nodes)))
    for j, own in enumerate(nodes):
        others = [node for node in nodes if node != own]
        basis = np.polynomial.Polynomial.fromroots(others) / np.prod([own - node for node in others])
        A[:, j] = basis.integ()(np.array(nodes))
    return A, A[-1]


def newmark_step(x: float, numbers: NewmarkNumbers) -> Numbers:
    """Return the matrix of a step for (x, h x', h^2 a), where a is the algorithmic acceleration.

    Balance holds at both ends of the step.
    """
    beta, gamma, alpha_m, alpha_f = numbers.beta, numbers.gamma, numbers.alpha_m, numbers.alpha_f
    stiffness = x**2
    new = np.array(
        [[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1.0 - alpha_f) * stiffness, 0.0, 1.0 - alpha_m]]
    )  # fmt: skip
    old = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1.0 - gamma], [-alpha_f * stiffness, 0.0, -alpha_m]])
    return np.linalg.solve(new, old)


def wilson_step(x: float, theta: float) -> Numbers:
    """Return the matrix of a step for (x, h x', h^2 x''): acceleration linear up to theta h, equilibrium there."""
    stiffness = (x * theta) ** 2
    # theta^2 a_theta = -stiffness x_theta,  x_theta = x + theta x' + theta^2 (2 a + a_theta) / 6
    at_theta = -np.array([1.0, theta, theta**2 / 3.0]) * stiffness / (theta**2 * (1.0 + stiffness / 6.0))
    acceleration = np.array([0.0, 0.0, 1.0 - 1.0 / theta]) + at_theta / theta
    return np.array(
        [
            np.array([1.0, 1.0, 1.0 / 3.0]) + acceleration / 6.0,
            np.array([0.0, 1.0, 0.5]) + 0.5 * acceleration,
            acceleration,
        ]
    )


def highest_formula(method: Method) -> int:
    """Return the highest order of a multistep method's formulas; a run may limit it further."""
    return int(method.parameters["max_order"].high) if "max_order" in method.parameters else method.order


def multistep_formula(method: Method, order: int | None) -> tuple[Numbers, Numbers]:
    """Return coefficients of new and old values and of their derivatives, the newest first, padded to one length."""
    highest = highest_formula(method)
    if order is None or not (isinstance(order, int) and 1 <= order <= highest):
        raise InputError(
            f"{method} needs an order", field="order", value=order, remedy=f"choose one from 1 to {highest}"
        )
    if isinstance(method, Adams):
        values, rates = _adams(order)
    else:
        values, rates = _backward_differences(order, isinstance(method, NDF))
    size = max(values.size, rates.size)
    return np.pad(values, (0, size - values.size)), np.pad(rates, (0, size - rates.size))


def _backward_differences(order: int, numerical: bool) -> tuple[Numbers, Numbers]:
    """Return the coefficients of sum_m (1/m) D^m x_1 - kappa gamma D^(k+1) x_1 = h x_1', D x_1 = x_1 - x_0.

    kappa = 0 gives Gear's formula.
    """
    difference = np.polynomial.Polynomial([1.0, -1.0])
    values = sum((difference**m / m for m in range(1, order + 1)), start=np.polynomial.Polynomial([0.0]))
    if numerical:
        gamma = sum(1.0 / m for m in range(1, order + 1))
        values = values - _KAPPA[order] * gamma * difference ** (order + 1)
    return values.coef, np.array([1.0])


def _adams(order: int) -> tuple[Numbers, Numbers]:
    """Return the coefficients of an Adams-Moulton formula.

    x_1 - x_0 is h times the integral of the polynomial through the newest `order` rates, including the new one.
    """
    nodes = 1.0 - np.arange(order)
    powers = np.arange(order)
    rates = np.linalg.solve(nodes[None, :] ** powers[:, None], 1.0 / (powers + 1.0))
    return np.array([1.0, -1.0]), rates
