"""Quantities of a run by name over its samples, such as "stage.T.y", "A1.rate", "tau1.torque" or "sensor.encoder"."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from paraflex.errors import InputError, suggestion
from paraflex.mechanism import AssumedModesBeam, FlexibleBeam, Mechanism, PointRef, RigidBody
from paraflex.units import EFFORTS
from .formulas import stress_at
from .traces import Trace

# Words of a joint with the units where it turns and where it slides; an empty unit stands for another word.
_JOINT_WORDS = {
    "angle": ("rad", ""), "travel": ("", "m"), "rate": ("rad/s", "m/s"), "acceleration": ("rad/s^2", "m/s^2"),
    "force": ("N", "N"), "fx": ("N", "N"), "fy": ("N", "N"), "moment": ("N m", "N m"),
}  # fmt: skip
# Words of the loads of joints, and of the efforts of motors and prescribed motions.
JOINT_LOADS = ("force", "fx", "fy", "moment")
MOTOR_WORDS = ("torque", "force", "power")
# Words of a point, with unit, derivative in time and axis.
_POINT_WORDS = {
    "x": ("m", 0, 0), "y": ("m", 0, 1), "vx": ("m/s", 1, 0), "vy": ("m/s", 1, 1), "ax": ("m/s^2", 2, 0),
    "ay": ("m/s^2", 2, 1),
}  # fmt: skip
_BODY_WORDS = {"deflection": "m", "stress": "Pa"}
# Name of the distance of the end-effector from its desired place.
_ERROR = "error"
_SENSOR = "sensor"


class Quantity(NamedTuple):
    """Quantity of a run over its samples.

    Attributes
    ----------
    unit : str
        SI unit.
    of : callable
        Function of the traces of a run and of the nominal run, which decides signs and places; returns an array (k,).
    """

    unit: str
    of: Callable[[Any, Any], Trace]


def quantity_named(name: str, mechanism: Mechanism) -> Quantity:
    """Return a quantity of the runs of a mechanism by its name, of one with segments by the names of the whole beams.

    Raises
    ------
    InputError
        The mechanism has no such quantity.
    """
    simulated, mechanism = mechanism, mechanism.described
    owner, _, word = name.rpartition(".")
    if name == _ERROR and mechanism.end_effector is not None:
        return Quantity("m", _error)
    # At a joint "force" is that of the joint, unless a motor has the same name.
    drives = word != "force" or owner not in mechanism.joints_by_name or _drives(owner, mechanism)
    if word in MOTOR_WORDS and drives and (found := _effort(name, owner, word, mechanism)) is not None:
        return found
    if owner in mechanism.joints_by_name and word in _JOINT_WORDS:
        return _of_joint(name, owner, word, mechanism)
    if word in _BODY_WORDS and owner in [body.name for body in mechanism.bodies]:
        return _of_body(name, owner, word, simulated)
    if owner == _SENSOR:
        for sensor in simulated.sensors:
            if sensor.name == word:
                return Quantity(simulated.sensor_unit(sensor), partial(_reading, word))
    if word in _POINT_WORDS and owner in _points(mechanism):
        unit, derivative, axis = _POINT_WORDS[word]
        point = PointRef.parse(owner, "metrics")
        return Quantity(unit, lambda run, _: run.point_motion(point)[derivative][:, axis])
    names = list(quantity_names(mechanism))
    driven = [f"{one.joint}.{word}" for one in (*mechanism.motors, *mechanism.prescribed) if one.name == owner]
    near = [one for one in driven if one in names]
    near = near or [one for one in names if one.startswith((f"{name}.", f"{owner}."))]
    raise InputError("no such quantity", field="metrics", value=name, remedy=suggestion(name, near or names))


def is_static(name: str) -> bool:
    """Check whether equilibria have a quantity as well: a load, a deformation or a coordinate."""
    return name.rpartition(".")[2] in (*JOINT_LOADS, *_BODY_WORDS, "angle", "travel", "x", "y")


def quantity_names(mechanism: Mechanism) -> Iterator[str]:
    """Yield the names of the quantities of a mechanism."""
    for joint in mechanism.joints:
        own = [word for word, units in _JOINT_WORDS.items() if units[joint.slides]]
        yield from (f"{joint.name}.{word}" for word in (own if joint.moves else JOINT_LOADS))
    for one in (*mechanism.motors, *mechanism.prescribed):
        yield from (f"{one.name}.{word}" for word in ("force" if mechanism.slides(one.joint) else "torque", "power"))
    yield from (f"{point}.{word}" for point in _points(mechanism) for word in _POINT_WORDS)
    yield from (f"{body.name}.{word}" for body in mechanism.bodies if _bends(body) for word in _BODY_WORDS)
    yield from (f"{_SENSOR}.{sensor.name}" for sensor in mechanism.sensors)
    yield from [_ERROR] if mechanism.end_effector is not None else []


def _points(mechanism: Mechanism) -> list[str]:
    return [f"{body.name}.{point}" for body in mechanism.bodies for point in body.points]


def _bends(body: Any) -> bool:
    return not isinstance(body, RigidBody) and body.flexible


def _error(run: Any, _: Any) -> Trace:
    if not hasattr(run, "distance"):
        raise InputError("the error is that of a path, which the run does not have", field="metrics", value=_ERROR,
                         remedy="name the coordinate of a point, say stage.T.y")  # fmt: skip
    return run.distance


def _drives(name: str, mechanism: Mechanism) -> bool:
    """Check whether a motor or a prescribed motion has a name."""
    return any(one.name == name for one in (*mechanism.motors, *mechanism.prescribed))


def _effort(name: str, owner: str, word: str, mechanism: Mechanism) -> Quantity | None:
    """Return the effort or power of a motor or prescribed motion by its name or that of its joint; None without one."""
    kinds: Mapping[str, Sequence[Any]] = {"": mechanism.motors, "drive_": mechanism.prescribed}
    found = [(kind, k, one) for kind, all_of in kinds.items() for k, one in enumerate(all_of)]
    named = [each for each in found if each[2].name == owner] or [each for each in found if each[2].joint == owner]
    if not named:
        if owner not in mechanism.joints_by_name:
            return None
        raise InputError("no motor or prescribed motion acts at the joint", field="metrics", value=name,
                         remedy=f"write {owner}.moment or {owner}.force for what the joint transmits")  # fmt: skip
    if len(named) > 1:
        options = ", ".join(one.name for *_, one in named)
        raise InputError("several motors or prescribed motions act there", field="metrics", value=name,
                         remedy=f"name one of them: {options}")  # fmt: skip
    ((kind, k, one),) = named
    unit = "N" if mechanism.slides(one.joint) else "N m"
    if word not in (EFFORTS[unit], "power"):
        moves = "slides, so that it has a force" if unit == "N" else "turns, so that it has a torque"
        raise InputError(f"the joint of {one.name} {moves}", field="metrics", value=name,
                         remedy=f"write {owner if one.name == owner else one.name}.{EFFORTS[unit]}")  # fmt: skip
    trace = f"{kind}{'power' if word == 'power' else 'torque'}"
    return Quantity("W" if word == "power" else unit, lambda run, _: getattr(run, trace)[:, k])


def _of_joint(name: str, owner: str, word: str, mechanism: Mechanism) -> Quantity:
    """Return a coordinate, its derivatives or a load of a joint."""
    slides = mechanism.slides(owner)
    unit = _JOINT_WORDS[word][slides]
    if word not in JOINT_LOADS:
        mechanism.joint(owner).check_moves("metrics")
    if not unit:
        problem, other = ("slides: it has no angle", "travel") if slides else ("turns: it has no travel", "angle")
        raise InputError(f"the joint {problem}", field="metrics", value=name, remedy=f"write {owner}.{other}")
    return Quantity(unit, lambda run, _: run.joint_quantity(owner, word))


def _of_body(name: str, owner: str, word: str, mechanism: Mechanism) -> Quantity:
    """Return the largest deflection or stress of a flexible body at every sample, with the signs of the nominal run."""
    body, cut = mechanism.described.body(owner), mechanism.cut
    parts = () if cut is None else cut.parts[owner]
    if _bends(body) and parts and not any(_bends(mechanism.body(part)) for part in parts):
        raise InputError(f"{owner} is cut into rigid segments, which have no {word}", field="metrics", value=name,
                         remedy="name a point or a joint, or leave out the segments")  # fmt: skip
    if not _bends(body) or (word == "stress" and not isinstance(body, FlexibleBeam | AssumedModesBeam)):
        raise InputError("not a flexible beam" if word == "stress" else "not a flexible body", field="metrics",
                         value=name, remedy="name a beam that bends")  # fmt: skip
    return Quantity(_BODY_WORDS[word], partial(_stress if word == "stress" else _deflection, owner))


def _deflection(body: str, run: Any, nominal: Any) -> Trace:
    from .outlines import deflections  # imported late: it loads the kernels

    here, there = (deflections(one.system, one.solution.q, body) for one in (run, nominal))
    at = np.arange(len(there)), np.argmax(np.abs(there), axis=1)
    return np.sign(there[at]) * here[at]


def _stress(body: str, run: Any, nominal: Any) -> Trace:
    loads, there = run.sections.loads, nominal.sections.loads
    own = np.flatnonzero(np.array(nominal.sections.sections.owners) == body)
    stress = np.where(np.isnan(there.stress[:, own]), -1.0, there.stress[:, own])
    at = np.arange(len(stress)), own[np.argmax(stress, axis=1)]
    return stress_at(loads, there, at)


def _reading(name: str, run: Any, _: Any) -> Trace:
    from paraflex.dynamics.sensors import sensor_readings  # imported late: it loads the kernels

    system, solution = run.system, run.solution
    sensor = [one for one in system.mechanism.sensors if one.name == name]
    torque = run.torque[: len(solution.q)]
    return sensor_readings(system, solution.q, solution.v, solution.a, solution.multipliers, torque, sensor)[:, 0]
