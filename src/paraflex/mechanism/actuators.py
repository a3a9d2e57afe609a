"""Electric motors with their gears and amplifiers."""

import json
from dataclasses import dataclass
from enum import Enum
from math import inf, pi, sqrt

from paraflex.arguments import CheckedFields
from paraflex.errors import InputError
from .quantities import not_negative, optional, positive


class Amplifier(Enum):
    """Quantity that an amplifier imposes on its motor.

    CURRENT
        Current control: the torque follows its command without delay or with the lag of the loop; back-EMF only limits
        it.
    VOLTAGE
        Voltage control: back-EMF acts on the joint as a viscous damper, also at zero voltage.
    """

    CURRENT = "current"
    VOLTAGE = "voltage"


@dataclass(frozen=True)
class Actuator(CheckedFields):
    """Direct-current motor (or servo motor in its torque-producing axis) with a gear and an amplifier.

    With the rate w of the joint, the torque at the joint is n k_t i with L i' + R i = u - n k_e w. The rotor's inertia
    J_m acts on the joint coordinate as n^2 J_m.

    Attributes
    ----------
    name : str
        Name of the actuator.
    motors : tuple of str
        Names of the mechanism's motors that are of this type; all by default.
    gear : float
        Gear ratio n, rotor angle per joint angle, or per travel of a joint that slides [rad/m]; 1 by default.
    rotor_inertia : float
        Moment of inertia J_m of the rotor and all that turns with it on the motor side [kg m^2]; 0 by default.
    torque_constant : float, optional
        Torque constant k_t [N m/A]; without it there is no electrical model.
    back_emf : float, optional
        Back-EMF constant k_e [V s/rad]; by default the torque constant, which equals it in SI units.
    resistance : float, optional
        Resistance R of the winding [ohm].
    inductance : float
        Inductance L of the winding [H]; 0 by default.
    voltage_limit, current_limit : float, optional
        Limits of the amplifier [V, A]; none by default.
    amplifier : Amplifier or str
        Quantity that the amplifier imposes: "current" (default) or "voltage".
    bandwidth : float, optional
        Bandwidth (-3 dB) of the current loop, a first-order lag [Hz]; without lag by default.

    Raises
    ------
    InputError
        A voltage amplifier, a limit or another value is given without the constants that it needs, or a bandwidth is
        given for a voltage amplifier.

    Notes
    -----
    Spong, Hutchinson & Vidyasagar, Robot Modeling and Control, 2nd ed., sect. 8.1 (actuator dynamics).
    """

    _table = "actuator"

    name: str
    motors: tuple[str, ...] = optional((), "names of the motors it belongs to, by default all")
    gear: float = optional(
        1.0, "the rotor's angle over the joint's, or in rad/m where the joint slides", positive,
        "turns of the rotor per turn of the joint",
    )  # fmt: skip
    rotor_inertia: float = optional(0.0, "the rotor's moment of inertia in kg m^2", not_negative)
    torque_constant: float | None = optional(None, "the torque constant in N m/A", positive)
    back_emf: float | None = optional(
        None, "the back-EMF constant in V s/rad, by default the torque constant", positive
    )
    resistance: float | None = optional(None, "the resistance of the winding in ohm", positive)
    inductance: float = optional(0.0, "the inductance of the winding in H", not_negative)
    voltage_limit: float | None = optional(None, "the largest voltage of the amplifier in V", positive)
    current_limit: float | None = optional(None, "the largest current of the amplifier in A", positive)
    amplifier: Amplifier = optional(Amplifier.CURRENT, 'what the amplifier imposes: "current" or "voltage"')
    bandwidth: float | None = optional(
        None, "the bandwidth of the current loop in Hz, by default without lag", positive
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

    def _needs(self, given: str, is_set: bool, *others: str) -> None:
        for other in others:
            if is_set and getattr(self, other) is None:
                word = other.replace("_", " ")
                value = getattr(self, given)
                setting = f"{given} = {json.dumps(getattr(value, 'value', value), default=float)}"
                raise InputError(
                    "is missing", field=f"actuator.{self.name}.{other}",
                    remedy=f"give the {word}, which {setting} needs, or leave that out",
                )  # fmt: skip

    def _refused(self, name: str, problem: str, remedy: str) -> InputError:
        return InputError(problem, field=f"actuator.{self.name}.{name}", value=getattr(self, name), remedy=remedy)

    @property
    def imposes_voltage(self) -> bool:
        """Whether the amplifier imposes the voltage."""
        return self.amplifier is Amplifier.VOLTAGE

    @property
    def torque_per_current(self) -> float | None:
        """Torque constant at the joint, n k_t [N m/A, N/A]; None without a torque constant."""
        return None if self.torque_constant is None else self.gear * self.torque_constant

    @property
    def voltage_per_rate(self) -> float | None:
        """Back-EMF constant at the joint, n k_e [V s/rad, V s/m]; None without a torque constant."""
        constant = self.torque_constant if self.back_emf is None else self.back_emf
        return None if constant is None else self.gear * constant

    @property
    def reflected_inertia(self) -> float:
        """Rotor inertia reflected to the joint, n^2 J_m [kg m^2], or [kg] where the joint slides."""
        return self.gear**2 * self.rotor_inertia

    @property
    def back_emf_damping(self) -> float:
        """Damping of the short-circuited motor at the joint, n^2 k_t k_e/R [N m s/rad, N s/m]; 0 if unknown."""
        per_current, per_rate = self.torque_per_current, self.voltage_per_rate
        if per_current is None or per_rate is None or self.resistance is None:
            return 0.0
        return per_current * per_rate / self.resistance

    @property
    def damping(self) -> float:
        """Viscous damping of the joint by back-EMF [N m s/rad, N s/m]; 0 under a current loop."""
        return self.back_emf_damping if self.imposes_voltage else 0.0

    @property
    def electrical_time(self) -> float:
        """Electrical time constant L/R [s]; 0 if unknown."""
        return 0.0 if self.resistance is None else self.inductance / self.resistance

    @property
    def mechanical_time(self) -> float:
        """Mechanical time constant J_m R/(k_t k_e) of the rotor alone [s]; infinite without back-EMF damping."""
        damping = self.back_emf_damping
        return self.reflected_inertia / damping if damping else inf

    @property
    def lag(self) -> float:
        """Time constant of the torque's response to its command [s]: L/R, or that of the current loop."""
        if self.imposes_voltage:
            return self.electrical_time
        return 0.0 if self.bandwidth is None else 1.0 / (2.0 * pi * self.bandwidth)

    @property
    def no_load_speed(self) -> float:
        """No-load speed of the joint at the largest voltage, U/(n k_e) [rad/s, m/s]; infinite without a limit."""
        per_rate = self.voltage_per_rate
        return inf if self.voltage_limit is None or per_rate is None else self.voltage_limit / per_rate

    @property
    def stall_torque(self) -> float:
        """Stall torque at the joint, by the limits of voltage and current [N m, N]; infinite without limits."""
        per_current = self.torque_per_current
        if per_current is None:
            return inf
        currents = [inf if self.current_limit is None else self.current_limit]
        if self.voltage_limit is not None and self.resistance is not None:
            currents.append(self.voltage_limit / self.resistance)
        return per_current * min(currents)

    def summary(self, *, slides: bool = False) -> str:
        """Return a one-line summary of the known values at a joint that turns or, with `slides`, one that slides."""
        of = ("kg", "N s/m", "N", "m/s") if slides else ("kg m^2", "N m s/rad", "N m", "rad/s")
        words = ("rotor", "back-EMF", "stall", "no load", "lag")
        values = (self.reflected_inertia, self.damping, self.stall_torque, self.no_load_speed, 1e3 * self.lag)
        known = zip(words, values, (*of, "ms"), strict=True)
        return ", ".join(f"{word} {value:.4g} {unit}" for word, value, unit in known if 0.0 < value < inf)

    def matching_gear(self, inertia: float) -> float:
        """Return the gear ratio of largest acceleration of a load per motor torque: n^2 J_m equals the load's inertia.

        Parameters
        ----------
        inertia : float
            Moment of inertia of the load about the joint [kg m^2], or its mass where the joint slides [kg].

        Raises
        ------
        InputError
            The inertia is not positive, or the rotor has no inertia.
        """
        positive(inertia, "inertia", "kg m^2")
        if not self.rotor_inertia:
            raise self._refused("rotor_inertia", "has no optimal gear ratio", "give the rotor's moment of inertia")
        return sqrt(inertia / self.rotor_inertia)
