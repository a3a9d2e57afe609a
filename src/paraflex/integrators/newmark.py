"""Newmark family: coefficients of its members, from the parameters of each method."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from paraflex.errors import InputError
from paraflex.kernel.run_state import Tableau
from .method import EQUATIONS_INDEX_3, Family, NativeMethod, Treatment, parameter


@dataclass(frozen=True)
class NewmarkNumbers:
    """Coefficients of a member of the family.

    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) v_1' + alpha_f v_0'
    q_1 = q_0 + h v_0 + h^2 ((1/2 - beta) a_0 + beta a_1),    v_1 = v_0 + h ((1 - gamma) a_0 + gamma a_1)

    Attributes
    ----------
    alpha_m, alpha_f : float
        Weights of the old algorithmic acceleration and of the old acceleration.
    beta, gamma : float
        Newmark's coefficients of position and of velocity.
    theta : float
        Above one for Wilson's method: equilibrium holds at theta h, and acceleration is linear up to there. One by
        default.
    """

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    theta: float = 1.0

    @classmethod
    def damped(cls, alpha_m: float, alpha_f: float) -> "NewmarkNumbers":
        """Return coefficients of second order with the beta of the largest damping at high frequencies."""
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (0.5 + gamma) ** 2, gamma)

    def weight(self, step: float) -> float:
        """Return the coefficient b of the new acceleration in q_1 = q* + b v_1' [s^2]."""
        return self.beta * step**2 * (1.0 - self.alpha_f) / (1.0 - self.alpha_m)

    @property
    def order(self) -> int:
        """Order of the method: two, or one with numerical damping of first order."""
        return 2 if abs(self.gamma - 0.5 - self.alpha_f + self.alpha_m) < 1e-12 else 1


class NewmarkMethod(NativeMethod):
    """Member of the family, given by its coefficients."""

    family = Family.NEWMARK
    form = EQUATIONS_INDEX_3
    order = 2
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.POSITION,)

    @property
    @abstractmethod
    def numbers(self) -> NewmarkNumbers:
        """Coefficients of the method."""

    @property
    def scheme(self) -> Tableau:
        """Scheme as the kernel's tableau."""
        numbers = self.numbers
        return Tableau(
            A=np.array([[0.0, 0.0], [0.5, 0.5]]),
            c=np.array([0.0, 1.0]),
            error=np.zeros(0),
            dense=np.array([0, 1]),
            nodes=np.array([0, 1]),
            order=numbers.order,
            newmark=np.array([numbers.alpha_m, numbers.alpha_f, numbers.beta, numbers.gamma, numbers.theta]),
        )


@dataclass(frozen=True)
class Newmark(NewmarkMethod):
    """Newmark's method; by default beta is that of the largest damping at high frequencies."""

    name = "newmark"
    title = "Newmark"
    order = 1
    source = "Newmark (1959), J. Eng. Mech. 85, 67-94"

    gamma: float = parameter(0.6, 0.5, 1.0, "velocity weight: 1/2 does not damp, above that the order is 1")
    beta: float | None = parameter(0.3025, 0.25, 1.0, "position weight, at least (gamma + 1/2)^2 / 4", follows=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        least = 0.25 * (self.gamma + 0.5) ** 2
        if self.beta is None:
            object.__setattr__(self, "beta", least)
        elif self.beta < least * (1.0 - 1e-12):
            raise InputError(
                "too small for unconditional stability", field="beta", value=self.beta,
                remedy=f"at least (gamma + 1/2)^2 / 4 = {least:.6g}",
            )  # fmt: skip

    @property
    def numbers(self) -> NewmarkNumbers:
        """Coefficients of the method."""
        return NewmarkNumbers(0.0, 0.0, self.values["beta"], self.gamma)


@dataclass(frozen=True)
class Wilson(NewmarkMethod):
    """Wilson's method: acceleration linear up to theta h, where equilibrium holds."""

    name = "wilson-theta"
    title = "Wilson theta"
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.PROJECTION,)
    source = "Wilson, Farhoomand and Bathe (1973), Earthq. Eng. Struct. Dyn. 1, 241-252"

    theta: float = parameter(1.42, 1.366025403784439, 2.0, "where equilibrium is asked for")

    @property
    def numbers(self) -> NewmarkNumbers:
        """Coefficients of the method."""
        return NewmarkNumbers(0.0, 0.0, 1.0 / 6.0, 0.5, self.theta)


@dataclass(frozen=True)
class HHT(NewmarkMethod):
    """Method of Hilber, Hughes and Taylor: forces at both ends of the step are averaged with alpha."""

    name = "hht-alpha"
    title = "HHT alpha"
    source = "Hilber, Hughes and Taylor (1977), Earthq. Eng. Struct. Dyn. 5, 283-292"

    alpha: float = parameter(-0.1, -1.0 / 3.0, 0.0, "damping of high frequencies, most at -1/3")

    @property
    def numbers(self) -> NewmarkNumbers:
        """Coefficients of the method."""
        return NewmarkNumbers.damped(0.0, -self.alpha)


@dataclass(frozen=True)
class GeneralisedAlpha(NewmarkMethod):
    """Generalised-alpha method: least damping of low frequencies for a given spectral radius."""

    name = "generalised-alpha"
    title = "Generalised alpha"
    source = "Chung and Hulbert (1993), J. Appl. Mech. 60, 371-375"

    spectral_radius: float = parameter(0.7, 0.0, 1.0, "at infinite frequency: 0 annihilates, 1 keeps")

    @property
    def numbers(self) -> NewmarkNumbers:
        """Coefficients of the method."""
        radius = self.spectral_radius
        return NewmarkNumbers.damped((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0))
