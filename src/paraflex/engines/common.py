"""Common parts of adapters: importing an engine, refusing unsupported members, steps that end at samples."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any, NoReturn

import numpy as np

from paraflex.arrays import Array
from paraflex.engines.tree import spanning_tree
from paraflex.errors import InputError
from paraflex.mechanism import FlexibleBeam, Mechanism, given_shapes, grouped, with_actuators
from paraflex.tracking import TrackingTask

# Names of the engines as users and Python's packages know them, and in print.
_ENGINE_NAMES = {"exudyn": "Exudyn", "mujoco": "MuJoCo"}
ENGINES = tuple(_ENGINE_NAMES)


def check_dwell(name: str, task: TrackingTask) -> None:
    """Check that motors are free after the path: adapters of engines have no brakes.

    Raises
    ------
    InputError
        They are to be held.
    """
    if task.holds:
        refuse(_ENGINE_NAMES[name], 'brakes after the path (after = "hold")', "study.after")


def with_rotors(task: TrackingTask) -> TrackingTask:
    """The same task with lumps at joints in place of actuators, for programs that build bodies of their own."""
    return replace(task, mechanism=with_actuators(task.mechanism))


def check_engine(name: str, mechanism: Mechanism) -> None:
    """Check that an engine is installed and supports a mechanism.

    Raises
    ------
    InputError
        It is not, or cannot.
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
            refuse("Exudyn", f"a {group.word}", f"{group.table}.{one.name}")
    if name == "mujoco":
        closing = {joint.name for joint in spanning_tree(mechanism).closing}
        for group, one in related:
            if closing.intersection(one.joints):
                refuse("MuJoCo", f"a {group.word} where a loop closes", f"{group.table}.{one.name}")
        for spring in mechanism.springs:
            if spring.joint in closing:
                refuse("MuJoCo", "a spring where a loop closes", f"spring.{spring.name}")
    import_engine(name)


def import_engine(name: str) -> Any:
    """The engine's module.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            "not installed", field="engine", value=name, remedy="install it with pip install 'paraflex[engines]'"
        ) from None


def refuse(engine: str, what: str, field: str) -> NoReturn:
    """Raise the error that the adapter of an engine does not support a part of a mechanism.

    Raises
    ------
    InputError
        Always.
    """
    raise InputError(
        f"{engine} cannot express {what}", field=field, remedy="leave out this engine, or that part of the model"
    )


def steps_between(times: Array, step: float) -> int:
    """The fewest equal steps between two samples that are no longer than a step.

    Raises
    ------
    InputError
        A step that is not positive.
    """
    if not (np.isfinite(step) and step > 0.0):
        raise InputError("must be positive", field="step", value=step, remedy="give it in seconds")
    return max(1, int(np.ceil((times[1] - times[0]) / step * (1.0 - 1e-9))))
