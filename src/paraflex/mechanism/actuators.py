"""Electric motors with their gears and amplifiers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from math import inf, pi, sqrt

from paraflex.arguments import CheckedFields
from paraflex.errors import InputError
from paraflex.mechanism.quantities import not_negative, optional, positive


class Amplifier(Enum):
    """What an amplifier imposes on its motor.

    CURRENT
        A current loop: the torque follows its command, at once or with the lag of the loop; back-EMF only limits it.
    VOLTAGE
        The voltage: back-EMF brakes the joint like a viscous damper, also at zero voltage.
    """

    CURRENT = "current"
    VOLTAGE = "voltage"


@dataclass(frozen=True)
class Actuator(CheckedFields):
    """A direct-current motor (or a servo motor in its torque-producing axis) with a gear and an amplifier.

    At the joint, w its rate: torque = n k_t i, and L i' + R i = u - n k_e w. The rotor's inertia J_m acts on the
    coordinate of the joint as n^2 J_m.

    Attributes
    ----------
    name : str
    motors : tuple of str
        Motors of the mechanism that are of this kind; all by default.
    gear : float
        n, the rotor's angle by the joint's; of a joint that slides [rad/m].
    rotor_inertia : float
        J_m, of the rotor and all that turns with it before the gear [kg m^2].
    torque_constant : float, optional
        k_t [N m/A]; without it there is no electrical part.
    back_emf : float, optional
        k_e [V s/rad]; the torque constant by default, which in SI units it is.
    resistance : float, optional
        R of the winding [ohm].
    inductance : float
        L of the winding [H].
    voltage_limit, current_limit : float, optional
        Largest of the amplifier [V, A].
    amplifier : Amplifier or str
        What the amplifier imposes: "current" or "voltage".
    bandwidth : float, optional
        Of the current loop, at which its first-order lag has -3 dB [Hz]; by default it follows at once.

    Raises
    ------
    InputError
        A voltage without what makes it a torque, a limit or bandwidth that has no meaning.

    Notes
    -----
    Spong, Hutchinson & Vidyasagar, Robot Modeling and Control, 2nd ed., sect. 8.1 (actuator dynamics).
    """

    _table = "actuator"

    name: str
    motors: tuple[str, ...] = optional((), "names of motors that it is of, by default all")
    gear: float = optional(
        1.0, "the rotor's angle by the joint's, or in rad/m where the joint slides", positive,
        "turns of the rotor by those of the joint",
    )  # fmt: skip
    rotor_inertia: float = optional(0.0, "the rotor's moment of inertia in kg m^2", not_negative, "kg m^2")
    torque_constant: float | None = optional(None, "the torque constant in N m/A", positive, "N m/A")
    back_emf: float | None = optional(
        None, "the back-EMF constant in V s/rad, by default the torque constant", positive, "V s/rad"
    )
    resistance: float | None = optional(None, "the resistance of the winding in ohm", positive, "ohm")
    inductance: float = optional(0.0, "the inductance of the winding in H", not_negative, "H")
    voltage_limit: float | None = optional(None, "the largest voltage of the amplifier in V", positive, "V")
    current_limit: float | None = optional(None, "the largest current of the amplifier in A", positive, "A")
    amplifier: Amplifier = optional(  # noqa: RUF009 - a field
        Amplifier.CURRENT, 'what the amplifier imposes: "current" or "voltage"'
    )
    bandwidth: float | None = optional(
        None, "the bandwidth of the current loop in Hz, by default without lag", positive, "Hz"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        of_voltage = self.amplifier is Amplifier.VOLTAGE
        self._needs("amplifier", of_voltage, "torque_constant", "resistance")
        self._needs("voltage_limit", self.voltage_limit is not None, "torque_constant", "resistance")
        self._needs("current_limit", self.current_limit is not None, "torque_constant")
        self._needs("back_emf", self.back_emf is not None, "torque_constant")
        self._needs("inductance", self.inductance != 0.0, "torque_constant", "resistance")
        if of_voltage and self.bandwidth is not None:
            raise self._refused("bandwidth", "has no meaning for a voltage amplifier, whose lag is L/R",
                                'leave it out, or say amplifier = "current"')  # fmt: skip

    def _needs(self, given: str, asked: bool, *others: str) -> None:
        for other in others:
            if asked and getattr(self, other) is None:
                word = other.replace("_", " ")
                value = getattr(self, given)
                said_so = f"{given} = {json.dumps(getattr(value, 'value', value), default=float)}"
                raise InputError(
                    "is missing", field=f"actuator.{self.name}.{other}",
                    remedy=f"give the {word}, which {said_so} needs, or leave that out",
                )  # fmt: skip

    def _refused(self, name: str, problem: str, remedy: str) -> InputError:
        return InputError(problem, field=f"actuator.{self.name}.{name}", value=getattr(self, name), remedy=remedy)

    @property
    def imposes_voltage(self) -> bool:
        """Whether its amplifier imposes the voltage."""
        return self.amplifier is Amplifier.VOLTAGE

    @property
    def torque_per_current(self) -> float | None:
        """N k_t, at the joint [N m/A, N/A]; None without a torque constant."""
        return None if self.torque_constant is None else self.gear * self.torque_constant

    @property
    def voltage_per_rate(self) -> float | None:
        """N k_e, of the joint's rate [V s/rad, V s/m]; None without a torque constant."""
        constant = self.torque_constant if self.back_emf is None else self.back_emf
        return None if constant is None else self.gear * constant

    @property
    def reflected_inertia(self) -> float:
        """n^2 J_m, at the joint [kg m^2], or [kg] where it slides."""
        return self.gear**2 * self.rotor_inertia

    @property
    def back_emf_damping(self) -> float:
        """n^2 k_t k_e/R, of the short-circuited motor at the joint [N m s/rad, N s/m]; 0 where it is not known."""
        per_current, per_rate = self.torque_per_current, self.voltage_per_rate
        if per_current is None or per_rate is None or self.resistance is None:
            return 0.0
        return per_current * per_rate / self.resistance

    @property
    def damping(self) -> float:
        """What of the back-EMF acts on the joint as viscous damping: none under a current loop [N m s/rad, N s/m]."""
        return self.back_emf_damping if self.imposes_voltage else 0.0

    @property
    def electrical_time(self) -> float:
        """L/R [s]; 0 where it is not known."""
        return 0.0 if self.resistance is None else self.inductance / self.resistance

    @property
    def mechanical_time(self) -> float:
        """J_m R/(k_t k_e) of the rotor alone, whatever its gear [s]; infinite where back-EMF does not brake it."""
        damping = self.back_emf_damping
        return self.reflected_inertia / damping if damping else inf

    @property
    def lag(self) -> float:
        """Time constant with which torque follows its command [s]: L/R, or that of the current loop."""
        if self.imposes_voltage:
            return self.electrical_time
        return 0.0 if self.bandwidth is None else 1.0 / (2.0 * pi * self.bandwidth)

    @property
    def no_load_speed(self) -> float:
        """U/(n k_e), of the joint at the largest voltage and no torque [rad/s, m/s]; infinite without a limit."""
        per_rate = self.voltage_per_rate
        return inf if self.voltage_limit is None or per_rate is None else self.voltage_limit / per_rate

    @property
    def stall_torque(self) -> float:
        """Largest torque at the joint at rest, by the limits of voltage and current [N m, N]; infinite without."""
        per_current = self.torque_per_current
        if per_current is None:
            return inf
        currents = [inf if self.current_limit is None else self.current_limit]
        if self.voltage_limit is not None and self.resistance is not None:
            currents.append(self.voltage_limit / self.resistance)
        return per_current * min(currents)

    def summary(self, *, slides: bool = False) -> str:
        """What is known of it in a line, at a joint that turns or slides."""
        of = ("kg", "N s/m", "N", "m/s") if slides else ("kg m^2", "N m s/rad", "N m", "rad/s")
        words = ("rotor", "back-EMF", "stall", "no load", "lag")
        values = (self.reflected_inertia, self.damping, self.stall_torque, self.no_load_speed, 1e3 * self.lag)
        known = zip(words, values, (*of, "ms"), strict=True)
        return ", ".join(f"{word} {value:.4g} {unit}" for word, value, unit in known if 0.0 < value < inf)

    def matching_gear(self, inertia: float) -> float:
        """The gear ratio with which a torque of the motor accelerates a load most: n^2 J_m equals its inertia.

        Parameters
        ----------
        inertia : float
            Of the load about the joint [kg m^2], or its mass where the joint slides [kg].

        Raises
        ------
        InputError
            One that is not positive, or no rotor inertia.
        """
        positive(inertia, "inertia", "kg m^2")
        if not self.rotor_inertia:
            raise self._refused("rotor_inertia", "makes no gear the best", "give the rotor's moment of inertia")
        return sqrt(inertia / self.rotor_inertia)
