"""Structural damping of a flexible body: by ratios of its modes, by Rayleigh's coefficients, or by a loss factor."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from paraflex.arguments import CheckedFields, given_as
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.mechanism.quantities import in_unit, not_negative, positive


@dataclass(frozen=True)
class RayleighDamping(CheckedFields):
    """Damping in proportion to mass and stiffness: D = mass M + stiffness K.

    The part in proportion to mass is that of the body's vibration as its joints hold it (`ModalDamping`); the part in
    proportion to stiffness depends on nothing but the deformation.

    Attributes
    ----------
    mass : float
        [1/s]
    stiffness : float
        [s]
    """

    _table = "damping"

    mass: float = field(default=0.0, metadata=in_unit(not_negative, "1/s"))
    stiffness: float = field(default=0.0, metadata=in_unit(not_negative, "s"))

    def coefficients(self, omega: Array) -> Array:
        """Damping coefficients of the body's mass-normalised modes, as held by its joints, by frequency [1/s]."""
        return self.mass + self.stiffness * omega**2


def _check_ratios(ratios: tuple[float, ...], field: str) -> None:
    if not ratios:
        raise InputError("no damping ratio", field=field, value=[], remedy="give one, say [0.01]")
    for ratio in ratios:
        not_negative(ratio, field, "parts of critical damping, say 0.01")


@dataclass(frozen=True)
class ModalDamping(CheckedFields):
    """Damping by a ratio for each mode of the body with its joints held, whatever its reference condition.

    The modes are those of the body alone, ascending in frequency, with what its joints hold of it held still: see
    `dynamics.damping`.

    Attributes
    ----------
    ratios : tuple of float
        Parts of critical damping; the last serves all modes that follow.
    """

    _table = "damping"

    ratios: tuple[float, ...] = field(metadata={"check": _check_ratios})

    def coefficients(self, omega: Array) -> Array:
        """2 ratio omega of each mode [1/s]."""
        last = len(self.ratios) - 1
        return 2.0 * omega * np.array([self.ratios[min(k, last)] for k in range(omega.size)])


@dataclass(frozen=True)
class LossFactor(CheckedFields):
    """Damping of the material by its loss factor at one frequency: D = loss_factor / (2 pi frequency) K.

    A vibration at that frequency has the damping ratio loss_factor / 2, one at another frequency more or less in
    proportion to it: this is viscous damping, where a material's loss factor would be the same at all frequencies.

    Attributes
    ----------
    loss_factor : float
        Energy lost in a cycle over 2 pi times the largest strain energy in it.
    frequency : float
        Of the vibration that it is meant for [Hz].
    """

    _table = "damping"

    loss_factor: float = field(metadata=in_unit(not_negative, "a number, twice the damping ratio, say 0.01"))
    frequency: float = field(metadata=in_unit(positive, "Hz"))

    @property
    def stiffness(self) -> float:
        """Coefficient of stiffness-proportional damping [s]."""
        return self.loss_factor / (2.0 * np.pi * self.frequency)

    def coefficients(self, omega: Array) -> Array:
        """Damping coefficients of the body's mass-normalised modes, by their angular frequencies [1/s]."""
        return self.stiffness * omega**2


Damping = RayleighDamping | ModalDamping | LossFactor
given_as("a damping")(Damping)


def stiffness_proportional(damping: Damping) -> float | None:
    """The coefficient beta of D = beta K [s], or None if damping is not proportional to stiffness alone."""
    if isinstance(damping, LossFactor):
        return damping.stiffness
    if isinstance(damping, RayleighDamping) and damping.mass == 0.0:
        return damping.stiffness
    return None


def stiffness_damping(damping: Damping | None, what: str, field: str) -> float:
    """The coefficient beta of D = beta K [s]; an `InputError` for damping of another kind."""
    beta = 0.0 if damping is None else stiffness_proportional(damping)
    if beta is None:
        problem = f"{what} can be damped in proportion to stiffness only"
        remedy = "give damping = { stiffness = ... }, a loss factor, or none"
        raise InputError(problem, field=field, value=damping, remedy=remedy)
    return beta
