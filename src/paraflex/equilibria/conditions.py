"""Conditions of equilibria: coordinates by name, and the loads, torques and displacements that a model proposes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from paraflex.errors import InputError, suggestion
from paraflex.mechanism import Mechanism, PointRef
from paraflex.mechanism.quantities import known, optional
from paraflex.paths import ModelWithPaths

_AXES = ("x", "y", "angle")
# Fields of loads and displacements; choosing one of them replaces all.
ACTIONS = ("loads", "torques", "moved")
# Upper limit of steps; more would show no further detail.
_MOST_STEPS = 10_000
# Buckling modes above this number are of no use.
_MOST_FACTORS = 20


class Coordinate(NamedTuple):
    """Angle or travel of a joint, or position or angle of a point, by its name.

    Attributes
    ----------
    name : str
        Name of the joint, or "body.point.x", "body.point.y", "body.point.angle".
    unit, effort_unit : str
        Units: "m" and "N", or "rad" and "N m".
    point : PointRef, optional
        Point of the coordinate; None for a joint.
    """

    name: str
    unit: str
    effort_unit: str
    point: PointRef | None = None

    @property
    def axis(self) -> str:
        """Axis of a point's coordinate."""
        return self.name.rpartition(".")[2]


def coordinate_named(mechanism: Mechanism, name: str, field: str) -> Coordinate:
    """Return a coordinate by its name.

    Raises
    ------
    InputError
        There is no such joint or point, or the joint has no variable coordinate.
    """
    if name in mechanism.joints_by_name:
        joint = mechanism.joints_by_name[name]
        if not joint.moves:
            kept = "holds its angle" if "angle" in joint.holds else "keeps a distance"
            raise InputError(f"{kept}, so that it has no coordinate", field=field, value=name,
                             remedy="name a joint that turns or slides, or a point")  # fmt: skip
        return Coordinate(name, *(("m", "N") if joint.slides else ("rad", "N m")))
    place, _, axis = name.rpartition(".")
    points = [f"{body.name}.{point}" for body in mechanism.bodies for point in body.points]
    if axis not in _AXES or place not in points:
        known = [*mechanism.joints_by_name, *(f"{point}.{each}" for point in points for each in _AXES)]
        raise InputError("is neither a joint nor a coordinate of a point", field=field, value=name,
                         remedy=f'{suggestion(name, known)}; for points it is "body.point.x", ".y" or ".angle"'
                         )  # fmt: skip
    return Coordinate(name, *(("rad", "N m") if axis == "angle" else ("m", "N")), PointRef.parse(place, field))


class Conditions(NamedTuple):
    """Conditions of equilibria: changes of coordinates, forces and torques, and coordinates that are held or measured.

    Attributes
    ----------
    held : tuple of Coordinate
        Coordinates that keep their value.
    moved, loads : mapping of Coordinate to float
        Change from the start [m, rad], and force or torque [N, N m].
    measured : tuple of Coordinate
        Coordinates whose stiffness is computed.
    """

    held: tuple[Coordinate, ...]
    moved: Mapping[Coordinate, float]
    loads: Mapping[Coordinate, float]
    measured: tuple[Coordinate, ...]

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All coordinates, each once."""
        return tuple(dict.fromkeys((*self.moved, *self.loads, *self.measured, *self.held)))

    @property
    def description(self) -> str:
        """Displacements and loads in words: "travel of stage.T.x by 0.01 m and -20 N at stage.T.y"."""
        travels = [f"travel of {one.name} by {value:g} {one.unit}" for one, value in self.moved.items()]
        loads = [f"{value:g} {one.effort_unit} at {one.name}" for one, value in self.loads.items()]
        return " and ".join([*travels, *loads])


@dataclass(frozen=True)
class StaticsDefaults:
    """Default arguments of `statics`, as a model proposes them; see there.

    Attributes
    ----------
    loads, torques, moved : mapping of str to float
        Loads at coordinates, torques of motors, and changes of coordinates.
    held : tuple of str, optional
        Coordinates that keep their value.
    steps : int
        Number of equal steps.
    stiffness : tuple of str, optional
        Coordinates whose stiffness is computed.
    buckling : int
        Number of buckling factors.
    """

    loads: Mapping[str, float] = optional(
        {}, 'the force in N or torque in N m at each joint, "body.point.x", ".y" or ".angle"'
    )
    torques: Mapping[str, float] = optional({}, "the torque of each motor in N m")
    moved: Mapping[str, float] = optional(
        {}, 'the travel in m or rad of each joint, "body.point.x", ".y" or ".angle" from the start'
    )
    held: tuple[str, ...] | None = optional(
        None, "coordinates held fixed; by default the joints of motors without a torque"
    )
    steps: int = optional(10, "the number of equal steps of loads and travels")
    stiffness: tuple[str, ...] | None = optional(
        None, "coordinates whose stiffness is computed; by default those loaded or moved"
    )
    buckling: int = optional(1, "the number of buckling factors about every equilibrium")

    def filled(self, **chosen: Any) -> "StaticsDefaults":
        """Replace defaults by chosen values that are not None; see `chosen_over` for loads, torques, displacements."""
        given = {name: value for name, value in chosen.items() if value is not None}
        return StaticsDefaults(**chosen_over(vars(self), given))


class ModelWithStatics(ModelWithPaths, Protocol):
    """A model that proposes its statics, as `paraflex.load` returns it."""

    @property
    def statics(self) -> StaticsDefaults:
        """Default arguments of `statics`."""
        ...


def chosen_over(own: Mapping[str, Any], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Replace fields by chosen ones; a chosen load, torque or displacement replaces all of these."""
    replaced = ACTIONS if any(name in chosen for name in ACTIONS) else ()
    return {name: value for name, value in own.items() if name not in replaced} | dict(chosen)


def conditions(mechanism: Mechanism, requested: StaticsDefaults) -> Conditions:
    """Return the conditions on coordinates of a mechanism.

    Raises
    ------
    InputError
        Names are unknown, a coordinate is given twice, or numbers are out of range.
    """
    _counted(requested.steps, 1, _MOST_STEPS, "steps", "steps")
    _counted(requested.buckling, 0, _MOST_FACTORS, "buckling", "factors")
    efforts = _efforts(mechanism, requested)
    travels = {coordinate_named(mechanism, name, f"moved.{name}"): value for name, value in requested.moved.items()}
    for one, value in travels.items():
        _finite(value, f"moved.{one.name}", one.unit)
    held = requested.held
    if held is None:
        given = {one.name for one in (*efforts, *travels)}
        driven = [motor.joint for motor in mechanism.motors if motor.name not in requested.torques]
        held = tuple(joint for joint in driven if joint not in given)
    kept = tuple(dict.fromkeys(coordinate_named(mechanism, name, "held") for name in held))
    for where, first, second in (("loads", efforts, travels), ("held", kept, travels), ("held", kept, efforts)):
        for one in first:
            if one in second:
                raise InputError("is given twice: loaded, moved and held exclude one another", field=where,
                                 value=one.name, remedy="leave it out of all but one")  # fmt: skip
    measured = [*travels, *efforts] if requested.stiffness is None else [
        coordinate_named(mechanism, name, "stiffness") for name in requested.stiffness
    ]  # fmt: skip
    return Conditions(kept, travels, efforts, tuple(dict.fromkeys(measured)))


def _efforts(mechanism: Mechanism, requested: StaticsDefaults) -> dict[Coordinate, float]:
    """Return forces and torques at coordinates; those of motors act at their joints, and several at a joint add up."""
    joints = {motor.name: motor.joint for motor in mechanism.motors}
    efforts: dict[Coordinate, float] = {}
    for table, values in (("loads", requested.loads), ("torques", requested.torques)):
        for name, value in values.items():
            if table == "torques":
                known(name, list(joints), table, "motor")
            one = coordinate_named(mechanism, joints[name] if table == "torques" else name, f"{table}.{name}")
            _finite(value, f"{table}.{name}", one.effort_unit)
            efforts[one] = efforts.get(one, 0.0) + value
    return efforts


def _counted(number: int, least: int, most: int, field: str, what: str) -> None:
    if not least <= number <= most:
        raise InputError(f"no such number of {what}", field=field, value=number, remedy=f"choose one up to {most}")


def _finite(value: float, field: str, unit: str) -> None:
    if not math.isfinite(value):
        raise InputError("not a finite number", field=field, value=value, remedy=f"give it in {unit}")
