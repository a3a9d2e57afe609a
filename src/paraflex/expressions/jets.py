"""Jets: values with their first and second time derivatives, computed exactly by truncated Taylor arithmetic."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from paraflex.arrays import Array, ArrayLike


@dataclass(frozen=True)
class Jet:
    """Value, rate and acceleration of a function of time at given times, arrays of one shape.

    Sums, products, quotients and powers of jets, and of jets and numbers, are jets, by the chain rule to second order.
    A derivative that does not exist at some time is not finite there.
    """

    value: Array
    rate: Array
    acceleration: Array

    # NumPy must leave `array * jet` to `__rmul__`.
    __array_ufunc__ = None

    @classmethod
    def time(cls, t: ArrayLike) -> "Jet":
        """Return the jet of the time itself at times t [s]."""
        t = np.asarray(t, dtype=float)
        return cls(t, np.ones_like(t), np.zeros_like(t))

    @classmethod
    def constant(cls, value: float, like: Array) -> "Jet":
        """Return the jet of a constant, in the shape of an array."""
        return cls(np.full_like(like, value), np.zeros_like(like), np.zeros_like(like))

    def through(self, f: Array, df: Array, ddf: Array) -> "Jet":
        """Return the jet of f(self), from f and its first two derivatives at the value."""
        return Jet(f, df * self.rate, ddf * self.rate**2 + df * self.acceleration)

    def _other(self, other: Any) -> "Jet":
        return other if isinstance(other, Jet) else Jet.constant(float(other), self.value)

    def __add__(self, other: Any) -> "Jet":
        o = self._other(other)
        return Jet(self.value + o.value, self.rate + o.rate, self.acceleration + o.acceleration)

    def __mul__(self, other: Any) -> "Jet":
        o = self._other(other)
        return Jet(
            self.value * o.value,
            self.rate * o.value + self.value * o.rate,
            self.acceleration * o.value + 2.0 * self.rate * o.rate + self.value * o.acceleration,
        )

    def __pow__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return exp(log(self) * other)
        n, x = float(other), self.value

        def term(factor: float, power: float) -> Array:
            # A zero factor is not multiplied out: 0 * 0^-1 is NaN and would spoil t^1 at t = 0.
            return factor * x**power if factor else np.zeros_like(x)

        return self.through(x**n, term(n, n - 1.0), term(n * (n - 1.0), n - 2.0))

    def __rpow__(self, base: Any) -> "Jet":
        return exp(self * np.log(float(base)))

    def __truediv__(self, other: Any) -> "Jet":
        return self * self._other(other) ** -1.0

    def __rtruediv__(self, other: Any) -> "Jet":
        return self._other(other) / self

    def __sub__(self, other: Any) -> "Jet":
        return self + self._other(other) * -1.0

    def __rsub__(self, other: Any) -> "Jet":
        return self._other(other) - self

    def __neg__(self) -> "Jet":
        return self * -1.0

    def __pos__(self) -> "Jet":
        return self

    __radd__ = __add__
    __rmul__ = __mul__


def exp(x: Jet) -> Jet:
    """Return the exponential of a jet."""
    f = np.exp(x.value)
    return x.through(f, f, f)


def log(x: Jet) -> Jet:
    """Return the natural logarithm of a jet."""
    return x.through(np.log(x.value), 1.0 / x.value, -1.0 / x.value**2)


def sqrt(x: Jet) -> Jet:
    """Return the square root of a jet."""
    f = np.sqrt(x.value)
    return x.through(f, 0.5 / f, -0.25 / f**3)


def sin(x: Jet) -> Jet:
    """Return the sine of a jet."""
    s = np.sin(x.value)
    return x.through(s, np.cos(x.value), -s)


def cos(x: Jet) -> Jet:
    """Return the cosine of a jet."""
    c = np.cos(x.value)
    return x.through(c, -np.sin(x.value), -c)


def tan(x: Jet) -> Jet:
    """Return the tangent of a jet."""
    f = np.tan(x.value)
    return x.through(f, 1.0 + f**2, 2.0 * f * (1.0 + f**2))


def asin(x: Jet) -> Jet:
    """Return the arc sine of a jet."""
    root = np.sqrt(1.0 - x.value**2)
    return x.through(np.arcsin(x.value), 1.0 / root, x.value / root**3)


def acos(x: Jet) -> Jet:
    """Return the arc cosine of a jet."""
    return 0.5 * np.pi - asin(x)


def atan(x: Jet) -> Jet:
    """Return the arc tangent of a jet."""
    df = 1.0 / (1.0 + x.value**2)
    return x.through(np.arctan(x.value), df, -2.0 * x.value * df**2)


def sinh(x: Jet) -> Jet:
    """Return the hyperbolic sine of a jet."""
    f = np.sinh(x.value)
    return x.through(f, np.cosh(x.value), f)


def cosh(x: Jet) -> Jet:
    """Return the hyperbolic cosine of a jet."""
    f = np.cosh(x.value)
    return x.through(f, np.sinh(x.value), f)


def tanh(x: Jet) -> Jet:
    """Return the hyperbolic tangent of a jet."""
    f = np.tanh(x.value)
    return x.through(f, 1.0 - f**2, -2.0 * f * (1.0 - f**2))


# Functions allowed in expressions; each is smooth where it is finite.
FUNCTIONS: dict[str, Callable[[Jet], Jet]] = {
    f.__name__: f for f in (sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, log, sqrt)
}
