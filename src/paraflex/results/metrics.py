"""Metrics of runs, each defined once.

A formula takes the traces of a run and those of a nominal run. If both are the same run, its value is the metric. If
the run has a complex step, its value carries the derivative: the nominal run decides where a maximum is and which sign
a magnitude has, so that the formula consists of sums, products and roots only.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.expressions.evaluate import ExpressionError, expressed_in
from paraflex.expressions.jets import Jet
from paraflex.mechanism import Mechanism, rotor_mass
from paraflex.mechanism.quantities import known
from paraflex.units import WHERE_IT_SLIDES
from .formulas import drift_speed, largest_norm, overshoot, rms, settling_time, stress_at, vibration
from .metric_expressions import MetricExpression, parsed
from .motion_quantities import JOINT_LOADS, MOTOR_WORDS, Quantity, is_static, quantity_named, quantity_names
from .traces import Trace

if TYPE_CHECKING:
    from paraflex.actuation import Electrical
    from paraflex.control.loop.run_loop import ControllerRecord
    from paraflex.equilibria.conditions import Conditions

# Kinds of runs.
PATH, MOTION, STATICS = "path", "motion", "statics"
# Kinds of members with one value of a metric each; equilibria have named coordinates, and those with a stiffness.
MOTOR, DRIVE, JOINT, COORDINATE, DIRECTION = "motor", "drive", "joint", "coordinate", "direction"
# Quantities of a coordinate of equilibria in expressions; the first is that of the coordinate alone.
_OF_COORDINATES = ("travel", "effort", "stiffness", "compliance")


class MetricMembers(dict[str, Sequence[str]]):
    """Names of a mechanism's members by their kind, and of those that slide by `sliding(kind)`.

    The members are motors, drives (prescribed motions) and joints; in equilibria they are the named coordinates, and
    those with a stiffness.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism of the members.
    given : Conditions, optional
        Conditions of equilibria.
    """

    def __init__(self, mechanism: Mechanism, given: Conditions | None = None) -> None:
        self.mechanism = mechanism
        if given is not None:
            straight = tuple(one.name for one in given.coordinates if one.unit == "m")
            coordinates = {COORDINATE: given.coordinates, DIRECTION: given.measured}
            names = {kind: tuple(one.name for one in each) for kind, each in coordinates.items()}
            super().__init__(names | {sliding(kind): straight for kind in names})
            return
        whole = mechanism.described
        found = {MOTOR: whole.motors, DRIVE: whole.prescribed, JOINT: whole.joints}
        slides = {joint.name for joint in whole.joints if joint.slides}
        super().__init__(
            {kind: tuple(one.name for one in each) for kind, each in found.items()}
            | {
                sliding(kind): tuple(one.name for one in each if getattr(one, "joint", one.name) in slides)
                for kind, each in found.items()
            }
        )

    def quantity(self, name: str) -> Quantity:
        """Return a quantity of the runs by its name; the name of a coordinate of equilibria stands for its travel.

        Raises
        ------
        InputError
            There is no such quantity.
        """
        if COORDINATE not in self:
            return quantity_named(name, self.mechanism)
        trace, _, member = name.partition(".")
        if trace not in _OF_COORDINATES:
            if name not in self[COORDINATE] and is_static(name):
                return quantity_named(name, self.mechanism)
            trace, member = _OF_COORDINATES[0], name
            if name not in self[COORDINATE]:
                own = [one for one in quantity_names(self.mechanism) if is_static(one)]
                known(name, list(dict.fromkeys([*self[COORDINATE], *own])), "metrics", COORDINATE)
        metric = METRICS[trace]
        known(member, self[metric.each], "metrics", metric.each)
        at = list(self[metric.each]).index(member)
        unit = WHERE_IT_SLIDES[metric.unit] if member in self[sliding(metric.each)] else metric.unit
        return Quantity(unit, lambda run, _: getattr(run, trace)[:, at])

    def expression(self, text: str) -> MetricExpression:
        """Return the expression of a metric; names of coordinates of equilibria need no quotes."""
        for name in self.get(COORDINATE, ()):
            if not all(part.isidentifier() for part in name.split(".")):
                whole = rf"(?<![\w.'\"])((?:{'|'.join(_OF_COORDINATES)})\.)?{re.escape(name)}(?![\w.'\"])"
                text = re.sub(whole, lambda found: repr(found[0]), text)
        found = parsed(text)
        if COORDINATE in self and found.in_time:
            raise ExpressionError("equilibria have no time", "leave out windows and integrals")
        return found


# Function of the traces of a run and of the nominal run. It may use attributes that only some traces have
# (`RunTraces`).
Formula = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class Metric:
    """Metric of a run.

    Attributes
    ----------
    name : str
        Name, also of the variable in datasets.
    meaning, unit : str
        Description and unit.
    formula : callable
        Function of two `Traces`, of the run and of the nominal run; returns an array with one value per member for
        metrics of motors, joints or other members.
    label : str
        Printed name; by default the name.
    each : str
        Kind of the members ("motor" or another) with one value each; empty for a metric of the whole run.
    smooth : bool
        Whether the formula is differentiable.
    kept : bool
        Whether datasets hold the metric as a variable.
    of_solver : bool
        Whether the metric describes the integration rather than the design.
    whole : bool
        Whether the metric is an integer count.
    runs : tuple of str
        Kinds of runs that have the metric: along a "path", of a mechanism's own "motion", "statics".
    of_motors : bool
        Whether the metric is zero without motors.
    kept_of : tuple of str, optional
        Kinds of runs for which the metric is kept unless metrics are named; by default all that have it.
    ranked : bool
        Whether a smaller value is better, so that designs can be selected by the metric.
    """

    name: str
    meaning: str
    unit: str
    formula: Formula
    label: str = ""
    each: str = ""
    smooth: bool = True
    kept: bool = False
    of_solver: bool = False
    whole: bool = False
    runs: tuple[str, ...] = (PATH, MOTION)
    of_motors: bool = False
    kept_of: tuple[str, ...] | None = None
    ranked: bool = True

    def value(self, traces: Any) -> Any:
        """Return the metric of a run; an array for a metric of each motor, drive or joint."""
        return self.formula(traces, traces)

    def columns(self, members: MetricMembers) -> list[str]:
        """Return the names of the metric's columns: NAME, or NAME.MEMBER for each motor or other member.

        Raises
        ------
        InputError
            An expression does not fit the mechanism.
        """
        return [f"{self.name}.{member}" for member in members.get(self.each, ())] if self.each else [self.name]

    def unit_of(self, column: str, members: MetricMembers) -> str:
        """Return the unit of one of the metric's columns, for a sliding member that of the translational quantity."""
        slides = column.partition(".")[2] in members.get(sliding(self.each), ())
        return WHERE_IT_SLIDES.get(self.unit, self.unit) if slides else self.unit


class ExpressionMetric(Metric):
    """Metric given by an expression, which is its name."""

    def columns(self, members: MetricMembers) -> list[str]:
        """Return the name of the single column; see `Metric.columns`."""
        self.unit_of(self.name, members)
        return [self.name]

    def unit_of(self, column: str, members: MetricMembers) -> str:
        """Return the unit that follows from the expression."""
        with expressed_in("metrics", self.name):
            return members.expression(self.name).unit(lambda name: members.quantity(name).unit)


def _of_expression(text: str, run: Any, nominal: Any) -> Any:
    """Return the value of an expression for the traces of a run, with its derivative if the run has a complex step."""
    members = MetricMembers(nominal.system.described, nominal.conditions)

    def jet(of: Callable[[Any, Any], Trace]) -> Jet:
        here = of(run, nominal)
        value = of(nominal, nominal) if np.iscomplexobj(here) else here
        return Jet(value, np.imag(here), np.zeros_like(value))

    with expressed_in("metrics", text):
        expression = members.expression(text)
        jets = {name: jet(members.quantity(name).of) for name in expression.quantities}
        found = expression.value(jets.__getitem__, lambda: jet(lambda traces, _: traces.solution.t))
        if not np.isfinite(found.value) and all(np.isfinite(one.value).any() for one in jets.values()):
            raise ExpressionError("not a finite number", "it divides by zero, or takes samples without a value: "
                                  "max and min leave them out, a window does")  # fmt: skip
    return found.value + 1j * found.rate if np.any(found.rate) else found.value


class _Metrics(dict[str, Metric]):
    """Metrics by name; an expression is looked up by its text."""

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or "(" in str(name)

    def __missing__(self, name: str) -> Metric:
        if "(" not in name:
            raise KeyError(name)
        with expressed_in("metrics", name):
            parsed(name)
        meaning = f"{name}, from the samples"
        return ExpressionMetric(name, meaning, "", partial(_of_expression, name), name, runs=_ANY, kept_of=())


def metric_name(column: str) -> str:
    """Return the metric of a column: NAME for NAME.MEMBER, the text itself for an expression."""
    return column if "(" in column else column.partition(".")[0]


def keep_metrics(data: xr.Dataset, figures: Mapping[str, Any]) -> None:
    """Store values and units of metrics by name of the run, which is empty for a single one, in a dataset."""
    data.attrs["metrics"] = json.dumps(figures)


def kept_metrics(data: xr.Dataset, run: str = "") -> dict[str, Any]:
    """Return `metrics` with what `keep_metrics` stored of a run; empty if nothing was stored."""
    found = json.loads(data.attrs.get("metrics", "{}")).get(run)
    return {"metrics": found} if found else {}


def has_loads(name: str, mechanism: Mechanism) -> bool:
    """Check whether a metric is an expression of loads of joints or beams, or of efforts of prescribed motions."""
    quantities = [each.rpartition(".")[::2] for each in parsed(name).quantities] if "(" in name else []
    driven = {place for one in mechanism.prescribed for place in (one.name, one.joint)}
    return any(
        word in (*JOINT_LOADS, "stress") or (owner in driven and word in MOTOR_WORDS) for owner, word in quantities
    )


def sliding(each: str) -> str:
    """Return the key in `MetricMembers` for the sliding members of a kind."""
    return f"sliding {each}"


def metric_unit(column: str, members: MetricMembers) -> str:
    """Return the unit of a column for a mechanism with these members."""
    return METRICS[metric_name(column)].unit_of(column, members)


def _saturated_share(controllers: Sequence[ControllerRecord]) -> float:
    """Return the fraction of samples at which a limit was active, 0 without controllers."""
    samples = sum(one.t.size for one in controllers)
    return sum(int(np.sum(one.limited)) for one in controllers) / samples if samples else 0.0


def _absolute(formula: Callable[[Any], Any]) -> Formula:
    """Return a formula that does not depend on the nominal run."""
    return lambda run, _: formula(run)


def _largest(trace: Callable[[Any], Trace]) -> Formula:
    """Return the formula of the largest entry of an array, at the index of the nominal run's.

    Its value is NaN if the array is empty or has a NaN.
    """

    def value(run: Any, nominal: Any) -> Any:
        at_nominal = trace(nominal)
        return trace(run).flat[int(np.argmax(at_nominal))] if at_nominal.size else np.nan

    return value


def _largest_magnitude(trace: Callable[[Any], Trace]) -> Formula:
    """Return the formula of the largest magnitude, with index and sign of the nominal run's.

    Its value is 0 for an empty array, and NaN only if all entries are.
    """

    def value(run: Any, nominal: Any) -> Any:
        at_nominal = trace(nominal)
        if not np.isfinite(at_nominal).any():
            return np.nan if at_nominal.size else 0.0
        at = int(np.nanargmax(np.abs(at_nominal)))
        return np.sign(at_nominal.flat[at]) * trace(run).flat[at]

    return value


def _largest_of_each(trace: Callable[[Any], Trace]) -> Formula:
    """Return the formula of the largest magnitude of each column (see `_largest_magnitude`), NaN without samples."""
    magnitude = _largest_magnitude(lambda column: column)

    def value(run: Any, nominal: Any) -> Any:
        here, there = trace(run), trace(nominal)
        if not len(there):
            return np.full(there.shape[1], np.nan)
        return np.array([magnitude(*pair) for pair in zip(here.T, there.T, strict=True)])

    return value


def _of_currents(formula: Callable[[Electrical], Any]) -> Formula:
    """Return the formula of a value per motor from currents and voltages, NaN without samples."""

    def value(run: Any, _: Any) -> Any:
        found = run.run.electrical
        return formula(found) if found.t.size else np.full(len(found.motors), np.nan)

    return value


def _stress_where(used_up: Callable[[Any], Trace]) -> Formula:
    """Return the formula of the largest stress, divided by the quantity that `used_up` returns.

    The stress is |N| / A + |M| c / I, with the signs of the nominal run, at the sample and section where the ratio of
    the nominal run is largest. The value is NaN if no ratio is finite.
    """

    def value(run: Any, nominal: Any) -> Any:
        if run.sections is None or nominal.sections is None:
            return np.nan
        loads, nominal_loads = run.sections.loads, nominal.sections.loads
        most = nominal_loads.stress / np.real(used_up(nominal_loads))
        if not np.isfinite(most).any():
            return np.nan
        k, s = np.unravel_index(np.nanargmax(most), most.shape)
        return stress_at(loads, nominal_loads, (k, s)) / used_up(loads)[k, s]

    return value


def _section_moment(run: Any, nominal: Any) -> Any:
    if run.sections is None or nominal.sections is None:
        return np.nan
    return _largest_magnitude(lambda x: x.sections.loads.moment)(run, nominal)


_stress = _stress_where(lambda loads: np.ones_like(loads.area))
_use = _stress_where(lambda loads: loads.strength)


def _safety_factor(run: Any, nominal: Any) -> Any:
    used = _use(run, nominal)
    return 1.0 / used if used else np.nan


def _of_the_solver(name: str, meaning: str, unit: str = "1", *, whole: bool = False) -> Metric:
    """Return the metric that is the solution's attribute of the same name."""
    formula = _absolute(lambda x: getattr(x.solution, name))
    return Metric(name, meaning, unit, formula, smooth=False, of_solver=True, whole=whole)


def _of_statics(
    name: str, meaning: str, unit: str, formula: Callable[[Any], Any], label: str = "", *, each: str = "",
    whole: bool = False, ranked: bool = False,
) -> Metric:  # fmt: skip
    """Return a metric of static equilibria, by default one that does not rank designs."""
    return Metric(name, meaning, unit, _absolute(formula), label, each=each, smooth=False, whole=whole,
                  runs=(STATICS,), ranked=ranked)  # fmt: skip


def _peaks(values: Trace) -> Trace:
    """Return the largest magnitude of each column."""
    return np.max(np.abs(values), axis=0)


# Metric kept for every run, so that results of an invalid model are not mistaken for valid ones.
VALIDITY = "validity"
# Metric kept for all statics in addition, as a mechanism does not stay in unstable equilibria.
UNSTABLE = "unstable_steps"
ALWAYS: dict[str, tuple[str, ...]] = {PATH: (VALIDITY,), MOTION: (VALIDITY,), STATICS: (VALIDITY, UNSTABLE)}
_ANY = (PATH, MOTION, STATICS)
_AWAY = "distance of the end-effector from its desired place"

# Columns of tables have this order.
_ALL = (
    Metric("tracking_rms_motion", f"root mean square {_AWAY} during the motion", "m",
           _absolute(lambda x: rms(x.distance[x.moving])), "RMS error in the motion", kept=True, runs=(PATH,)),
    Metric("tracking_max_motion", f"largest {_AWAY} during the motion", "m",
           _largest(lambda x: x.distance[x.moving]), "largest error in the motion", kept=True, runs=(PATH,)),
    Metric("tracking_rms_after", f"root mean square {_AWAY} after the motion", "m",
           _absolute(lambda x: rms(x.distance[~x.moving])), "RMS error after the motion", kept=True, runs=(PATH,)),
    Metric("tracking_max_after", f"largest {_AWAY} after the motion", "m",
           _largest(lambda x: x.distance[~x.moving]), "largest error after the motion", kept=True, runs=(PATH,)),
    Metric("tracking_rms", f"root mean square {_AWAY} over the whole run, dwell included", "m",
           _absolute(lambda x: rms(x.distance)), "RMS tracking error", kept=True, runs=(PATH,)),
    Metric("tracking_max", f"largest {_AWAY} over the whole run", "m",
           _largest(lambda x: x.distance), "largest tracking error", kept=True, runs=(PATH,)),
    Metric("residual_vibration", "root mean square distance of the end-effector from its drift after the motion", "m",
           _absolute(lambda x: vibration(*x.after)), "residual vibration", kept=True, runs=(PATH,)),
    Metric("drift_speed", "mean speed of the end-effector's drift after the motion", "m/s",
           _absolute(lambda x: drift_speed(*x.after)), "drift after the motion", kept=True, runs=(PATH,)),
    Metric("settling_time", "time from the end of the motion until the end-effector stays as near to its desired place "
           "as 5 % of the largest tracking error", "s",
           _absolute(lambda x: settling_time(x.t, x.distance, x.motion_end)), "settling time", smooth=False, kept=True,
           runs=(PATH,), kept_of=()),
    Metric("overshoot", "how far the end-effector goes beyond the end of its path, in the direction of arrival", "m",
           _absolute(lambda x: overshoot(x.position, x.desired, x.moving)), "overshoot", smooth=False, kept=True,
           runs=(PATH,), kept_of=()),
    Metric("deflection_max", "largest deflection of any body from its chord, the line between its ends", "m",
           _largest_magnitude(lambda x: x.deflection), "largest deflection", runs=_ANY),
    Metric("peak_torque_max", "largest magnitude of any motor's torque", "N m",
           _largest_magnitude(lambda x: x.torque), "peak torque", of_motors=True),
    Metric("rms_torque_norm", "root mean square of the torques' Euclidean norm", "N m",
           _absolute(lambda x: np.sqrt(np.mean(np.sum(x.torque**2, axis=1)))), "RMS torque",
           of_motors=True),
    Metric("peak_torque", "largest magnitude of each motor's torque", "N m",
           _largest_of_each(lambda x: x.torque), "peak torque", each=MOTOR, kept=True),
    Metric("rms_torque", "root mean square of each motor's torque", "N m",
           _absolute(lambda x: rms(x.torque)), "RMS torque", each=MOTOR, kept=True),
    Metric("work", "work done on the mechanism until the end, less what dampers take", "J",
           _absolute(lambda x: x.solution.work[-1])),
    Metric("motor_energy", "integral of the magnitudes of all motors' powers, from the samples", "J",
           lambda run, nominal: np.trapezoid(np.sum(np.sign(nominal.power) * run.power, axis=1), run.t),
           "energy of the motors", of_motors=True),
    Metric("motor_power_max", "largest magnitude of any motor's power", "W",
           _largest_magnitude(lambda x: x.power), "largest motor power", of_motors=True),
    Metric("internal_torque_max", "largest Euclidean norm of the part of the torques that only strains links", "N m",
           _absolute(lambda x: largest_norm(x.internal_torque)), "largest internal torque", smooth=False,
           runs=(PATH,), of_motors=True, kept_of=()),
    Metric("saturated_share", "share of the samples of controllers at which a limit of torques was met", "1",
           _absolute(lambda x: _saturated_share(x.controllers)), smooth=False, of_motors=True, kept_of=()),
    Metric("current_max", "largest magnitude of each motor's current, by its actuator", "A",
           _of_currents(lambda x: _peaks(x.current)), "largest current", each=MOTOR, smooth=False, kept_of=()),
    Metric("rms_current", "root mean square of each motor's current in time", "A",
           _of_currents(lambda x: x.rms_current), "RMS current", each=MOTOR, smooth=False, kept_of=()),
    Metric("voltage_max", "largest magnitude of each motor's voltage, by its actuator", "V",
           _of_currents(lambda x: _peaks(x.voltage)), "largest voltage", each=MOTOR, smooth=False, kept_of=()),
    Metric("copper_energy", "heat of each motor's winding, from the samples", "J",
           _of_currents(lambda x: x.copper_energy), "heat of the winding", each=MOTOR, smooth=False, kept_of=()),
    Metric("drive_torque_max", "largest magnitude of the torque or force of each prescribed motion", "N m",
           _largest_of_each(lambda x: x.drive_torque), "largest torque", each=DRIVE),
    Metric("drive_power_max", "largest magnitude of the power of each prescribed motion", "W",
           _largest_of_each(lambda x: x.drive_power), "largest power", each=DRIVE),
    Metric("joint_force_max", "largest force in any joint", "N",
           _largest(lambda x: x.joint_force), "largest joint force", runs=_ANY, kept_of=(MOTION, STATICS)),
    Metric("drive_torque_error", "error of integration of each prescribed motion's torque or force, at most", "N m",
           _absolute(lambda x: x.load_errors.drive), "error of the torque", each=DRIVE, smooth=False, kept_of=()),
    Metric("joint_force_error", "error of integration of the force in any joint, at most", "N",
           _absolute(lambda x: np.max(x.load_errors.force, initial=0.0)), "error of the joint force", smooth=False,
           kept_of=()),
    Metric("stress_max_error", "error of integration of the stress in any beam, at most", "Pa",
           _absolute(lambda x: x.stress_error), "error of the stress", smooth=False, kept_of=()),
    Metric("joint_speed_max", "largest magnitude of the rate of each joint's angle or travel", "rad/s",
           _largest_of_each(lambda x: x.joint_speed), "largest speed", each=JOINT, kept_of=()),
    Metric("strain_energy_max", "largest strain energy", "J",
           _largest(lambda x: x.solution.strain_energy), "largest strain energy", runs=_ANY),
    Metric("kinetic_energy_max", "largest kinetic energy", "J",
           _largest(lambda x: x.solution.kinetic_energy), "largest kinetic energy"),
    Metric("stress_max", "largest magnitude of the stress in any beam, bending and axial; sections need outer_fibre",
           "Pa", _stress, "largest stress", runs=_ANY),
    Metric("safety_factor_min", "least strength over stress of any beam; materials need strength", "1",
           _safety_factor, "least safety factor", runs=_ANY, ranked=False),
    Metric("section_moment_max", "largest magnitude of the bending moment in any beam", "N m",
           _section_moment, "largest bending moment", runs=_ANY),
    Metric("total_mass", "mass of all bodies", "kg",
           _absolute(lambda x: np.sum([body.integrals.m for body in x.system.bodies]) - rotor_mass(x.system.described)),
           "mass", runs=_ANY),
    Metric("actuation_condition_max", "largest condition number of the actuation matrix", "1",
           _largest(lambda x: x.condition), "largest condition number", runs=(PATH,)),
    _of_the_solver("constraint_position_max", "largest constraint violation in position", "m"),
    _of_the_solver("energy_balance_max", "largest imbalance of energy and work", "J"),
    Metric(VALIDITY, "size of the neglected terms over its limit: the model holds up to 1; 0 where nothing bends", "1",
           _absolute(lambda x: 0.0 if x.validity is None else x.validity.ratio), smooth=False, runs=_ANY),
    _of_the_solver("steps", "accepted steps", whole=True),
    _of_the_solver("rejected", "rejected steps", whole=True),
    _of_the_solver("newton_iterations", "Newton iterations", whole=True),
    _of_statics("travel", "change of each named coordinate from the start to the last step, with its sign", "rad",
                lambda x: x.travel[-1], each=COORDINATE),
    _of_statics("travel_max", "largest magnitude of each named coordinate's change in all steps", "rad",
                lambda x: _peaks(x.travel), "largest travel", each=COORDINATE, ranked=True),
    _of_statics("effort", "force or torque at each named coordinate at the last step: given, or what holds or moves it",
                "N m", lambda x: x.effort[-1], "force or torque", each=COORDINATE),
    _of_statics("effort_max", "largest magnitude of the force or torque at each named coordinate", "N m",
                lambda x: _peaks(x.effort), "largest force or torque", each=COORDINATE, ranked=True),
    _of_statics("stiffness", "stiffness of each requested coordinate at the last step", "N m/rad",
                lambda x: x.stiffness[-1], each=DIRECTION),
    _of_statics("stiffness_min", "least stiffness of each requested coordinate, of all steps", "N m/rad",
                lambda x: np.min(x.stiffness, axis=0), "least stiffness", each=DIRECTION),
    _of_statics("compliance", "displacement by a unit force of each requested coordinate at the last step; infinite "
                "past buckling", "rad/N/m",
                lambda x: x.compliance[-1], each=DIRECTION, ranked=True),
    _of_statics("compliance_max", "largest compliance of each requested coordinate, of all steps", "rad/N/m",
                lambda x: np.max(x.compliance, axis=0), "largest compliance", each=DIRECTION, ranked=True),
    _of_statics("frequency", "lowest natural frequency at the last step, held and moved coordinates fixed", "Hz",
                lambda x: x.frequency[-1], "lowest natural frequency at the last step"),
    _of_statics("frequency_free", "lowest natural frequency at the last step, moved coordinates released", "Hz",
                lambda x: x.free_frequency[-1], "lowest free frequency at the last step"),
    _of_statics("frequency_min", "lowest natural frequency of all steps; zero where a motion grows", "Hz",
                lambda x: np.min(x.frequency), "lowest natural frequency"),
    _of_statics("buckling_factor", "load factor at which it buckles, seen from the start; NaN for none",
                "1", lambda x: x.buckling_factor),
    _of_statics("limit_load", "load factor at the first limit point; NaN for none", "1",
                lambda x: x.limit_load),
    _of_statics(UNSTABLE, "unstable equilibria among the steps", "1", lambda x: x.unstable_steps, whole=True,
                ranked=True),
)  # fmt: skip

METRICS: Mapping[str, Metric] = _Metrics({metric.name: metric for metric in _ALL})


def metric_label(column: str, motor: Callable[[str], str] = str) -> str:
    """Return the label of a table column: "RMS tracking error", or "peak torque of tau1" for a metric of one motor.

    Parameters
    ----------
    column : str
        NAME or NAME.MEMBER; a name that is not in `METRICS` is its own label, with spaces for underscores.
    motor : callable
        Function that formats the name of a motor, drive or joint; by default the name is printed as it is.
    """
    if "(" in column:
        return column
    name, dot, whose = column.partition(".")
    printed = METRICS[name].label if name in METRICS else ""
    return (printed or name.replace("_", " ")) + (f" of {motor(whose)}" if dot else "")
