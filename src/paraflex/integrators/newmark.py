"""The Newmark family as sets of numbers: how each named method fills them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paraflex.kernel.run_state import Tableau


@dataclass(frozen=True)
class NewmarkNumbers:
    """What makes a member of the family.

    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) v_1' + alpha_f v_0'
    q_1 = q_0 + h v_0 + h^2 ((1/2 - beta) a_0 + beta a_1),    v_1 = v_0 + h ((1 - gamma) a_0 + gamma a_1)

    Attributes
    ----------
    alpha_m, alpha_f : float
        Weights of the old algorithmic acceleration and of the old acceleration.
    beta, gamma : float
        Newmark's, of position and of velocity.
    theta : float
        Above one of Wilson's method: balance is asked for at theta h, acceleration being linear up to there.
    """

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    theta: float = 1.0

    @classmethod
    def damped(cls, alpha_m: float, alpha_f: float) -> NewmarkNumbers:
        """Of second order, and with the beta that damps high frequencies most."""
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (0.5 + gamma) ** 2, gamma)

    @classmethod
    def by_spectral_radius(cls, radius: float) -> NewmarkNumbers:
        """Generalised alpha by its spectral radius at infinite frequency (Chung and Hulbert 1993)."""
        return cls.damped((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0))

    @property
    def order(self) -> int:
        """Two, or one for a method that damps at the cost of accuracy."""
        return 2 if abs(self.gamma - 0.5 - self.alpha_f + self.alpha_m) < 1e-12 else 1


def newmark_numbers(method: str, parameters: Mapping[str, float]) -> NewmarkNumbers:
    """The numbers of a named method; all its parameters given (`methods.check_parameters`)."""
    if method == "newmark":
        return NewmarkNumbers(0.0, 0.0, parameters["beta"], parameters["gamma"])
    if method == "wilson-theta":
        return NewmarkNumbers(0.0, 0.0, 1.0 / 6.0, 0.5, parameters["theta"])
    if method == "hht-alpha":
        return NewmarkNumbers.damped(0.0, -parameters["alpha"])
    return NewmarkNumbers.by_spectral_radius(parameters["spectral_radius"])


def newmark_scheme(numbers: NewmarkNumbers) -> Tableau:
    """As the kernel takes it."""
    return Tableau(
        A=np.array([[0.0, 0.0], [0.5, 0.5]]),
        c=np.array([0.0, 1.0]),
        error=np.zeros(0),
        dense=np.array([0, 1]),
        nodes=np.array([0, 1]),
        order=numbers.order,
        newmark=np.array([numbers.alpha_m, numbers.alpha_f, numbers.beta, numbers.gamma, numbers.theta]),
    )
