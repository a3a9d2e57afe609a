"""Options of an integration, with checks."""

import json
import math
from dataclasses import InitVar, dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.dynamics import System
from paraflex.errors import InputError, as_enum
from paraflex.findings import Finding
from paraflex.limits import SAMPLES, SHORTEST, at_most
from .events import Event
from .method import Family, NativeMethod
from .methods import Method, MethodField, Treatment

# A tolerance above this part of the mechanism's size gives a finding: at a fifth of the size the tracking error of the
# five-bar is larger by a half.
LOOSE = 0.05
# Default tolerances, as a part of the mechanism's size (rounded to a power of two): with flexible bodies, and with
# rigid bodies only, where accuracy costs little.
RELATIVE_TOLERANCE, RELATIVE_TOLERANCE_RIGID = 4e-5, 4e-7
# Change of a force by local errors within a cycle that is allowed under control of forces, as a part of its largest
# value.
FORCE_PART = 0.0025
_REMEDIES = {
    "tolerance": "give a length in metres, say 1e-5",
    "step": "give a time in seconds",
    "max_step": "give a time in seconds",
    "max_steps": "give a number of steps",
    "newton_fraction": "give a fraction, say 0.03",
}


class Control(Enum):
    """Quantities whose errors control the step size: positions only, or the forces of joints and drives as well."""

    POSITIONS = "positions"
    FORCES = "forces"


class TolerancePer(Enum):
    """Time in which local errors may add up to the tolerance: a cycle of the motion, or the whole run."""

    CYCLE = "cycle"
    RUN = "run"


@named_in_errors("IntegrationOptions", "them, say IntegrationOptions(tolerance=1e-6)")
@dataclass(frozen=True)
class IntegrationOptions(CheckedFields):
    """Method, tolerance and further options of an integration.

    Attributes
    ----------
    tolerance : float, optional
        Sum of local errors allowed within a cycle, or the whole run [m] (root mean square over the mass). By default
        4e-5 of the mechanism's size, or 4e-7 if no body is flexible. With a fixed step it only determines the accuracy
        of Newton's iteration.
    tolerance_per : TolerancePer, optional
        Time in which local errors may add up to the tolerance. "cycle" (own methods): the time in which the fastest
        body so far turns once, or travels 2 pi times the size of the mechanism, at most the duration of the run. Errors
        of driven or damped motions then do not grow, those of undamped motions grow with the number of cycles, and the
        cost grows only with the duration. "run": the whole run. By default "cycle" with the default tolerance, and
        "run" with a given tolerance.
    control : Control, optional
        Quantities whose errors control the step size. "positions": positions only. "forces": local errors within a
        cycle also change no force of a joint or drive by more than 0.25 % of its largest value (ESDIRK methods, no
        fixed step). Vibrations of undamped beams and stiff springs are then resolved, up to the fastest that affects a
        force. By default "forces" if all flexible bodies are damped (`System.vibrations_die_out`), else "positions".
    method : Method or str
        Integration method: an object such as `paraflex.methods.GeneralisedAlpha(spectral_radius=0.8)`, or a name in
        `paraflex.METHODS`, which stands for the method with its default parameters.
    step : float, optional
        Fixed step size [s]; by default the step size is controlled by the errors. Steps end where an input is not
        smooth, and each interval between these times is divided evenly into steps no longer than this. A step in which
        Newton's iteration does not converge is done in parts; `Solution.rejected` counts these.
    constraints : Treatment or str, optional
        Treatment of the constraints: "baumgarte", "projection" (of position and velocity after each step) or "ggl"
        (stabilised index 2, Gear, Gupta and Leimkuhler); the method's own by default.
    alpha, beta : float
        Baumgarte coefficients [1/s] (Eq. 57); the range in the paper is 0 to 50. Own methods use at most 0.3 over the
        step.
    automatic_gains : bool
        Whether coefficients depend on the step size instead: violations then decay within some steps of any size.
    max_step : float
        Largest step size [s].
    max_steps : int, optional
        Largest number of attempted steps. A run ends earlier if at its pace it would need five times as many. By
        default ten million; a run then also ends if it has become a hundred times slower than before and would need
        more than a million steps.
    newton_fraction : float, optional
        Part of the error allowed in a step that Newton's iteration may leave; the method's own by default, which is
        smaller in fixed steps.
    events : tuple of JointLimit, DeflectionLimit or SingularDistance
        Events, the first of which ends the run. An excursion across a limit and back within a quarter of a step is
        missed: limit the step size if limits are grazed.
    """

    _own = ("method",)
    tolerance: float | None = None
    alpha: float = 20.0
    beta: float = 20.0
    max_step: float = math.inf
    max_steps: int | None = None
    newton_fraction: float | None = None
    method: MethodField = MethodField()  # noqa: RUF009 - a descriptor
    # Former option, accepted only to report where parameters belong.
    parameters: InitVar[Any] = None
    step: float | None = None
    constraints: Treatment | str | None = None
    automatic_gains: bool = False
    events: tuple[Event, ...] = ()
    control: Control | None = None
    tolerance_per: TolerancePer | None = None

    def __post_init__(self, parameters: Any) -> None:
        super().__post_init__()
        if not (parameters is None or (isinstance(parameters, dict) and not parameters)):
            raise InputError(
                "parameters belong to the method", field="parameters", value=parameters,
                remedy=f"give them to it: method=paraflex.methods.{type(self.method).__name__}(...)",
            )  # fmt: skip
        for name in ("tolerance", "alpha", "beta", "max_step", "newton_fraction", "step"):
            value = getattr(self, name)
            # Kernels would be compiled again for numbers of other types.
            object.__setattr__(self, name, None if value is None else float(value))
        for name, remedy in _REMEDIES.items():
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError("must be positive", field=name, value=value, remedy=remedy)
        if self.newton_fraction is not None and not self.newton_fraction < 1.0:
            remedy = _REMEDIES["newton_fraction"]
            raise InputError("must be below 1", field="newton_fraction", value=self.newton_fraction, remedy=remedy)
        if self.tolerance is not None and not math.isfinite(self.tolerance):
            raise InputError("must be finite", field="tolerance", value=self.tolerance, remedy=_REMEDIES["tolerance"])
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError("must not be negative", field=name, value=value, remedy="choose it from 0 to 50 1/s")
        self._check_step()
        self._check_constraints()

    def tolerance_for(self, system: System) -> float:
        """Return the tolerance [m], by default relative to the size of a system."""
        if self.tolerance is not None:
            return self.tolerance
        return _whole_size(system) * (RELATIVE_TOLERANCE if system.n_flexible else RELATIVE_TOLERANCE_RIGID)

    def for_system(self, system: System) -> "IntegrationOptions":
        """Return the same options with the tolerance that they have for a system."""
        per = self.per if self.controls_errors else None
        return replace(self, tolerance=self.tolerance_for(system), tolerance_per=per)

    @property
    def per(self) -> TolerancePer:
        """Time in which errors may add up to the tolerance: by default a cycle, or the run for a given tolerance."""
        if self.tolerance_per is not None:
            return self.tolerance_per
        return TolerancePer.CYCLE if self.tolerance is None else TolerancePer.RUN

    def control_for(self, system: System) -> Control:
        """Return the quantities whose errors control the step size for a system: see the class."""
        if self.control is not None:
            return self.control
        damped = system.n_flexible > 0 and system.vibrations_die_out
        return Control.FORCES if damped and self.estimates_forces else Control.POSITIONS

    def force_part(self, system: System) -> float:
        """Return the error allowed in forces, as a part of the largest; zero if they are not checked in a step."""
        looked_at = self.control_for(system) is Control.FORCES or not system.n_flexible
        return FORCE_PART if looked_at and self.estimates_forces else 0.0

    @property
    def controls_errors(self) -> bool:
        """Whether paraflex controls the step size by the errors: own methods, no fixed step."""
        return isinstance(self.method, NativeMethod) and self.step is None

    @property
    def estimates_forces(self) -> bool:
        """Whether runs estimate the effect of integration errors on forces: with embedded formulas, no fixed step."""
        return self.method.family is Family.ESDIRK and self.step is None

    @property
    def treatment(self) -> Treatment:
        """Treatment of the constraints."""
        return self.method.treatments[0] if self.constraints is None else Treatment(self.constraints)

    def to_dict(self) -> dict[str, str]:
        """Return method, parameters, treatment of constraints, step and events as text, for provenance."""
        return {
            "integration_method": self.method.name,
            "method_parameters": json.dumps(self.method.values),
            "constraints_treatment": self.treatment.value,
            "tolerance_per": self.per.value if self.controls_errors else "",
            "steps": "chosen by their errors" if self.step is None else f"fixed, {self.step:g} s",
            "stop_at": ", ".join(str(event) for event in self.events),
        }

    def _check_step(self) -> None:
        if self.step is not None and not (math.isfinite(self.step) and self.method.fixed_step):
            remedy = "leave it out, and choose a tolerance" if math.isfinite(self.step) else _REMEDIES["step"]
            problem = f"{self.method} chooses its steps itself" if math.isfinite(self.step) else "must be finite"
            raise InputError(problem, field="step", value=self.step, remedy=remedy)
        if self.control is Control.FORCES and not self.estimates_forces:
            raise InputError(
                "steps are not chosen by errors of forces", field="control", value=self.control.value,
                remedy="leave it out, or choose an ESDIRK method, say esdirk5, without a fixed step",
            )  # fmt: skip
        if self.tolerance_per is not None and not self.controls_errors:
            raise InputError(
                "without effect on " + (f"{self.method}" if self.step is None else "fixed steps"),
                field="tolerance_per", value=self.tolerance_per.value,
                remedy="leave it out, or choose one of paraflex's own methods, say esdirk5, without a fixed step",
            )  # fmt: skip

    def _check_constraints(self) -> None:
        if self.constraints is not None:
            object.__setattr__(self, "constraints", as_enum(Treatment, self.constraints, "constraints").value)
        known = [treatment.value for treatment in self.method.treatments]
        if self.constraints is not None and self.constraints not in known:
            raise InputError(
                f"{self.method} cannot keep the constraints in this way", field="constraints", value=self.constraints,
                remedy=f"choose from {', '.join(known)}, or another method",
            )  # fmt: skip
        if self.automatic_gains and self.treatment != Treatment.BAUMGARTE:
            raise InputError(
                f"{self.treatment.value} has no Baumgarte coefficients", field="automatic_gains", value=True,
                remedy="choose constraints = baumgarte",
            )  # fmt: skip


def _whole_size(system: System) -> float:
    """Return the size of a system [m], with the whole lengths of beams that are divided into several frames."""
    if system.described is system.mechanism:
        return system.size
    parts = [[system.body(part).mesh for part in system.parts(body.name)] for body in system.described.bodies]
    lengths = [sum(float(np.real(one.nodes[-1] - one.nodes[0])) for one in each if one is not None) for each in parts]
    longest = max(lengths, default=0.0)
    return max(system.size, 2.0 ** round(math.log2(longest))) if longest > 0.0 else system.size


def loose_tolerance(tolerance: float, size: float) -> Finding | None:
    """Return a finding on a tolerance that is large for a mechanism of that size [m], or None."""
    if tolerance <= LOOSE * size:
        return None
    return Finding(
        "tolerance-loose", "tolerance",
        f"{tolerance:.3g} m, in a mechanism of about {size:.2g} m: positions may be off by as much",
        f"it is in m: choose at most a thousandth of the size, {1e-3 * size:.0g}",
    )  # fmt: skip


def refuse_tolerance(tolerance: float, size: float) -> None:
    """Raise an `InputError` for a tolerance larger than the mechanism [m]: its steps would resolve nothing."""
    if tolerance > size:
        raise InputError(
            f"larger than the mechanism, about {size:.2g} m", field="tolerance", value=tolerance,
            remedy=f"it is in m: choose at most a thousandth of the size, {1e-3 * size:.0g}",
        )  # fmt: skip


def check_times(duration: float | None, samples: int | None) -> None:
    """Check the duration of a run [s] and the number of its samples; None skips a check.

    Raises
    ------
    InputError
        The duration is not positive and finite or too short, or the number of samples is too small or too large.
    """
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise InputError("must be positive", field="duration", value=duration, remedy="give it in seconds")
    if duration is not None and duration < SHORTEST:
        remedy = f"give it in seconds, at least {SHORTEST:g}"
        raise InputError("too short for a run", field="duration", value=duration, remedy=remedy)
    if samples is not None and samples < 2:
        raise InputError("too few samples", field="samples", value=samples, remedy="ask for at least 2")
    at_most(samples or 0, SAMPLES, "samples", "too many samples")


@checked_arguments()
def choose(method: Method | str | None, options: IntegrationOptions | None) -> IntegrationOptions:
    """Return the options (default options for None), with another method if one is given.

    Raises
    ------
    InputError
        The options are not valid for that method.
    """
    options = options or IntegrationOptions()
    return options if method is None else replace(options, method=method)
