"""Jets: values with their first and second derivative in time, exact by truncated Taylor arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from paraflex.arrays import Array


@dataclass(frozen=True)
class Jet:
    """A function of time at some instants: value, rate and acceleration, arrays of one shape.

    Sums, products, quotients and powers of jets, and of jets with numbers, are jets: the chain rule to second order.
    What has no derivative at an instant comes out as no finite number there.
    """

    value: Array
    rate: Array
    acceleration: Array

    # NumPy must leave `array * jet` to the jet.
    __array_ufunc__ = None

    @classmethod
    def time(cls, t: ArrayLike) -> Jet:
        """Time itself at instants t [s]."""
        t = np.asarray(t, dtype=float)
        return cls(t, np.ones_like(t), np.zeros_like(t))

    @classmethod
    def constant(cls, value: float, like: Array) -> Jet:
        """What does not change, at as many instants as an array has."""
        return cls(np.full_like(like, value), np.zeros_like(like), np.zeros_like(like))

    def through(self, f: Array, df: Array, ddf: Array) -> Jet:
        """The jet of f(self), from f and its first two derivatives at the value."""
        return Jet(f, df * self.rate, ddf * self.rate**2 + df * self.acceleration)

    def _other(self, other: Any) -> Jet:
        return other if isinstance(other, Jet) else Jet.constant(float(other), self.value)

    def __add__(self, other: Any) -> Jet:
        o = self._other(other)
        return Jet(self.value + o.value, self.rate + o.rate, self.acceleration + o.acceleration)

    def __mul__(self, other: Any) -> Jet:
        o = self._other(other)
        return Jet(
            self.value * o.value,
            self.rate * o.value + self.value * o.rate,
            self.acceleration * o.value + 2.0 * self.rate * o.rate + self.value * o.acceleration,
        )

    def __pow__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return exp(log(self) * other)
        n, x = float(other), self.value

        def term(factor: float, power: float) -> Array:
            # A factor of zero ends the row of derivatives: 0 * 0^-1 would spoil t^1 at t = 0.
            return factor * x**power if factor else np.zeros_like(x)

        return self.through(x**n, term(n, n - 1.0), term(n * (n - 1.0), n - 2.0))

    def __rpow__(self, base: Any) -> Jet:
        return exp(self * np.log(float(base)))

    def __truediv__(self, other: Any) -> Jet:
        return self * self._other(other) ** -1.0

    def __rtruediv__(self, other: Any) -> Jet:
        return self._other(other) / self

    def __sub__(self, other: Any) -> Jet:
        return self + self._other(other) * -1.0

    def __rsub__(self, other: Any) -> Jet:
        return self._other(other) - self

    def __neg__(self) -> Jet:
        return self * -1.0

    def __pos__(self) -> Jet:
        return self

    __radd__ = __add__
    __rmul__ = __mul__


def exp(x: Jet) -> Jet:
    """The exponential of a jet."""
    f = np.exp(x.value)
    return x.through(f, f, f)


def log(x: Jet) -> Jet:
    """The natural logarithm of a jet."""
    return x.through(np.log(x.value), 1.0 / x.value, -1.0 / x.value**2)


def sqrt(x: Jet) -> Jet:
    """The square root of a jet."""
    f = np.sqrt(x.value)
    return x.through(f, 0.5 / f, -0.25 / f**3)


def sin(x: Jet) -> Jet:
    """The sine of a jet."""
    s = np.sin(x.value)
    return x.through(s, np.cos(x.value), -s)


def cos(x: Jet) -> Jet:
    """The cosine of a jet."""
    c = np.cos(x.value)
    return x.through(c, -np.sin(x.value), -c)


def tan(x: Jet) -> Jet:
    """The tangent of a jet."""
    f = np.tan(x.value)
    return x.through(f, 1.0 + f**2, 2.0 * f * (1.0 + f**2))


def asin(x: Jet) -> Jet:
    """The arc sine of a jet."""
    root = np.sqrt(1.0 - x.value**2)
    return x.through(np.arcsin(x.value), 1.0 / root, x.value / root**3)


def acos(x: Jet) -> Jet:
    """The arc cosine of a jet."""
    return 0.5 * np.pi - asin(x)


def atan(x: Jet) -> Jet:
    """The arc tangent of a jet."""
    df = 1.0 / (1.0 + x.value**2)
    return x.through(np.arctan(x.value), df, -2.0 * x.value * df**2)


def sinh(x: Jet) -> Jet:
    """The hyperbolic sine of a jet."""
    f = np.sinh(x.value)
    return x.through(f, np.cosh(x.value), f)


def cosh(x: Jet) -> Jet:
    """The hyperbolic cosine of a jet."""
    f = np.cosh(x.value)
    return x.through(f, np.sinh(x.value), f)


def tanh(x: Jet) -> Jet:
    """The hyperbolic tangent of a jet."""
    f = np.tanh(x.value)
    return x.through(f, 1.0 - f**2, -2.0 * f * (1.0 - f**2))


# The functions an expression may call: each smooth where it is finite.
FUNCTIONS: dict[str, Callable[[Jet], Jet]] = {
    f.__name__: f for f in (sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, log, sqrt)
}
