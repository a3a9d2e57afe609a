"""Construction of controllers from their tables in a model file, and of tables from controllers."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from paraflex.control.laws.described import TABLE, ControllerDescription, check_controllers
from paraflex.control.laws.kinds import LAWS
from paraflex.errors import InputError, renamed, within
from paraflex.expressions.evaluate import evaluate_parameters
from paraflex.mechanism import Mechanism
from .field_values import changed_fields, inexpressible
from .profiles import components_table, read_components
from .schema import ModelTable, TorqueTable


def read_controllers(table: ModelTable, mechanism: Mechanism) -> dict[str, ControllerDescription]:
    """Build the controllers of a model file, by name.

    Raises
    ------
    InputError
        Unknown sensors or motors, or invalid numbers.
    """
    parameters, found = evaluate_parameters(table.parameters), {}
    for name, one in table.controller.items():
        with within(f"{TABLE}.{name}"):
            found[name] = _read(name, one, parameters, table.study.duration)
    check_controllers(found, mechanism)
    return found


def _read(name: str, table: Any, parameters: Mapping[str, float], duration: float | None) -> ControllerDescription:
    entries = {key: value for key, value in table if value is not None}
    kind = LAWS[entries.pop("type")]
    law = kind(**{each.name: entries.pop(each.name) for each in fields(kind) if each.name in entries})
    if isinstance(table.reference, Mapping):
        entries["reference"] = found = {}
        for sensor, given in table.reference.items():
            # A reference is written like the torque of a motor.
            torque = TorqueTable.model_construct(torque=given)
            with renamed(f"reference.{sensor}"):
                found[sensor] = read_components(torque, "torque", parameters, duration)[0]
    return ControllerDescription(name, law, **entries)


def controller_table(one: ControllerDescription) -> dict[str, Any]:
    """Build the table of a controller; fields with default values are omitted.

    Raises
    ------
    InputError
        Law or reference that cannot be expressed in a file.
    """
    law, place = one.law, f"{TABLE}.{one.name}"
    if LAWS.get(law.kind) is not type(law):
        raise inexpressible(f"{place}.law", type(law).__name__, f"give a law of type {', '.join(LAWS)}")
    for each in fields(law):
        given = getattr(law, each.name)
        if each.metadata.get("by") and isinstance(given, Sequence | np.ndarray):
            raise inexpressible(f"{place}.{each.name}", given, "give one number, or numbers by name")
    entries = {"type": law.kind} | changed_fields(law) | changed_fields(one, "name", "law")
    if isinstance(one.reference, Mapping):
        try:
            entries["reference"] = {sensor: components_table((each,), "torque")["torque"]
                                    for sensor, each in one.reference.items()}  # fmt: skip
        except (InputError, KeyError):
            raise inexpressible(f"{place}.reference", dict(one.reference),
                                "give numbers or expressions of the time") from None  # fmt: skip
    return entries
