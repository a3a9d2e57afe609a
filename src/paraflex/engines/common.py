"""Common functions of the adapters: import of an engine, checks of a mechanism, steps that end at samples."""

from dataclasses import replace
from importlib import import_module
from typing import Any, NoReturn

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError, optional_package
from paraflex.mechanism import FlexibleBeam, Mechanism, given_shapes, grouped, with_actuators
from paraflex.tracking import TrackingTask
from .tree import spanning_tree

# Package names of the engines, by which users refer to them, and their names in messages.
_ENGINE_NAMES = {"exudyn": "Exudyn", "mujoco": "MuJoCo"}
ENGINES = tuple(_ENGINE_NAMES)


def check_dwell(name: str, task: TrackingTask) -> None:
    """Check that motors are free after the path, because the adapters have no brakes.

    Raises
    ------
    InputError
        The task holds the motors after the path.
    """
    if task.holds:
        refuse(_ENGINE_NAMES[name], 'brakes after the path (after = "hold")', "study.after")


def with_rotors(task: TrackingTask) -> TrackingTask:
    """Return the task with lumps at joints in place of actuators, for engines that build their own bodies."""
    return replace(task, mechanism=with_actuators(task.mechanism))


def check_engine(name: str, mechanism: Mechanism) -> None:
    """Check that an engine is installed and supports a mechanism.

    Raises
    ------
    InputError
        The engine is not installed, or does not support a member of the mechanism.
    """
    beams = [body for body in mechanism.bodies if isinstance(body, FlexibleBeam)]
    beyond = {
        "a flexible body of given shapes": [f"body.{body}" for body in given_shapes(mechanism.bodies)],
        "a joint that is not revolute": [
            f"joint.{joint.name}" for joint in mechanism.joints if joint.holds != ("points",)
        ],
        "back-EMF": [f"actuator.{one.name}.amplifier" for one in mechanism.actuators if one.damping],
        "structural damping": [f"body.{beam.name}.damping" for beam in beams if beam.damping is not None],
    } | {
        group.one: [f"{group.table}.{one.name}" for one in members]
        for group, members in grouped(mechanism)
        if not group.engines
    }
    for what, fields in beyond.items():
        if fields:
            refuse(_ENGINE_NAMES[name], what, fields[0])
    related = [(group, one) for group, members in grouped(mechanism) if group.relates for one in members]
    if name == "exudyn":
        for group, one in related:
            refuse("Exudyn", f"a {group.noun}", f"{group.table}.{one.name}")
    if name == "mujoco":
        closing = {joint.name for joint in spanning_tree(mechanism).closing}
        for group, one in related:
            if closing.intersection(one.joints):
                refuse("MuJoCo", f"a {group.noun} where a loop closes", f"{group.table}.{one.name}")
        for spring in mechanism.springs:
            if spring.joint in closing:
                refuse("MuJoCo", "a spring where a loop closes", f"spring.{spring.name}")
    import_engine(name)


def import_engine(name: str) -> Any:
    """Import the engine's module.

    Raises
    ------
    InputError
        The engine is not installed.
    """
    remedy = "install it with pip install 'paraflex[engines]'"
    with optional_package("not installed", field="engine", value=name, remedy=remedy):
        return import_module(name)


def refuse(engine: str, what: str, field: str) -> NoReturn:
    """Raise the error for a part of a mechanism that an engine's adapter does not support.

    Raises
    ------
    InputError
        The error is always raised.
    """
    raise InputError(
        f"{engine} cannot express {what}", field=field, remedy="leave out this engine, or that part of the model"
    )


def steps_between(times: Array, step: float) -> int:
    """Return the least number of equal steps between two samples with a step size of at most `step` [s].

    Raises
    ------
    InputError
        The step size is not positive.
    """
    if not (np.isfinite(step) and step > 0.0):
        raise InputError("must be positive", field="step", value=step, remedy="give it in seconds")
    return max(1, int(np.ceil((times[1] - times[0]) / step * (1.0 - 1e-9))))
