"""Structural damping of a flexible body: modal damping ratios, Rayleigh coefficients, or a loss factor."""

from dataclasses import dataclass, field

import numpy as np

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.arrays import Array
from paraflex.errors import InputError
from .quantities import field_metadata, not_negative, optional, positive


@dataclass(frozen=True)
class RayleighDamping(CheckedFields):
    """Damping in proportion to mass and stiffness: D = mass M + stiffness K.

    The mass-proportional part acts on the vibrations of the body with its joints held (see `ModalDamping`); the
    stiffness-proportional part depends on the deformation only.

    Attributes
    ----------
    mass : float
        Coefficient of the mass-proportional part [1/s]; 0 by default.
    stiffness : float
        Coefficient of the stiffness-proportional part [s]; 0 by default.
    """

    _table = "damping"

    mass: float = optional(0.0, "the mass-proportional coefficient in 1/s, of the body as it is held", not_negative)
    stiffness: float = optional(0.0, "the stiffness-proportional coefficient in s", not_negative)

    def coefficients(self, omega: Array) -> Array:
        """Return damping coefficients [1/s] of mass-normalised modes by frequency [rad/s], the body's joints held."""
        return self.mass + self.stiffness * omega**2


def _check_ratios(ratios: tuple[float, ...], field: str) -> None:
    if not ratios:
        raise InputError("no damping ratio", field=field, value=[], remedy="give one, say [0.01]")
    for ratio in ratios:
        not_negative(ratio, field, "fractions of critical damping, say 0.01")


@dataclass(frozen=True)
class ModalDamping(CheckedFields):
    """Damping by a ratio for each mode of the body with its joints held, whatever its reference condition.

    The modes are those of the body alone, ascending in frequency, with the displacements that its joints constrain
    held at zero: see `dynamics.damping`.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratios, as fractions of critical damping; the last one applies to all higher modes.
    """

    _table = "damping"

    ratios: tuple[float, ...] = field(
        metadata=field_metadata(
            "the damping ratio of each mode of the body as its joints hold it; the last applies to all others",
            _check_ratios,
        )
    )

    def coefficients(self, omega: Array) -> Array:
        """Return the damping coefficient 2 ratio omega of each mode [1/s]."""
        last = len(self.ratios) - 1
        return 2.0 * omega * np.array([self.ratios[min(k, last)] for k in range(omega.size)])


@dataclass(frozen=True)
class LossFactor(CheckedFields):
    """Damping by the material's loss factor at one frequency: D = loss_factor / (2 pi frequency) K.

    A vibration at that frequency has the damping ratio loss_factor / 2. The ratio at other frequencies is proportional
    to the frequency, because the damping is viscous; a constant loss factor would give the same ratio at all of them.

    Attributes
    ----------
    loss_factor : float
        Energy dissipated per cycle divided by 2 pi times the largest strain energy of the cycle.
    frequency : float
        Frequency at which the loss factor holds [Hz].
    """

    _table = "damping"

    loss_factor: float = field(
        metadata=field_metadata(
            "twice the damping ratio at the frequency, of stiffness-proportional damping",
            not_negative,
            "a number, twice the damping ratio, say 0.01",
        )
    )
    frequency: float = field(
        metadata=field_metadata("the frequency in Hz at which the loss factor holds", positive, "Hz")
    )

    @property
    def stiffness(self) -> float:
        """Coefficient of stiffness-proportional damping [s]."""
        return self.loss_factor / (2.0 * np.pi * self.frequency)

    def coefficients(self, omega: Array) -> Array:
        """Return damping coefficients [1/s] of the body's mass-normalised modes by angular frequency [rad/s]."""
        return self.stiffness * omega**2


Damping = RayleighDamping | ModalDamping | LossFactor
named_in_errors("a damping")(Damping)


def stiffness_proportional(damping: Damping) -> float | None:
    """Return the coefficient beta of D = beta K [s], or None if damping is not proportional to stiffness alone."""
    if isinstance(damping, ModalDamping) or (isinstance(damping, RayleighDamping) and damping.mass != 0.0):
        return None
    return damping.stiffness


def stiffness_damping(damping: Damping | None, what: str, field: str) -> float:
    """Return the coefficient beta of D = beta K [s], 0 without damping; raise an `InputError` for other kinds."""
    beta = 0.0 if damping is None else stiffness_proportional(damping)
    if beta is None:
        problem = f"{what} can be damped in proportion to stiffness only"
        remedy = "give damping = { stiffness = ... }, a loss factor, or none"
        raise InputError(problem, field=field, value=damping, remedy=remedy)
    return beta
