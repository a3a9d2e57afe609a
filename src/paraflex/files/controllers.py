"""Construction of controllers from their tables in a model file, and of tables from controllers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from paraflex.control.laws.described import TABLE, ControllerDescription, check_controllers
from paraflex.control.laws.described_laws import LAWS
from paraflex.errors import InputError, renamed, within
from paraflex.files.expressions import evaluate_parameters
from paraflex.files.field_values import changed_fields, inexpressible
from paraflex.files.profiles import components_table, read_components
from paraflex.files.schema import ControllerTable, ModelTable, TorqueTable
from paraflex.mechanism import Mechanism
from paraflex.mechanism.loads import InTime


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


def _read(
    name: str, table: ControllerTable, parameters: Mapping[str, float], duration: float | None
) -> ControllerDescription:
    said = {key: value for key, value in table if value is not None}
    kind = LAWS[said.pop("type")]
    law = kind(**{each.name: said.pop(each.name) for each in fields(kind) if each.name in said})
    if isinstance(table.reference, Mapping):
        said["reference"] = {
            sensor: _reference(sensor, given, parameters, duration) for sensor, given in table.reference.items()
        }
    return ControllerDescription(name, law, **said)


def _reference(sensor: str, given: Any, parameters: Mapping[str, float], duration: float | None) -> InTime:
    """Build the reference of a sensor, which is written like the torque of a motor."""
    with renamed(f"reference.{sensor}"):
        return read_components(TorqueTable.model_construct(torque=given), "torque", parameters, duration)[0]


def controller_table(one: ControllerDescription) -> dict[str, Any]:
    """Build the table of a controller; fields with default values are omitted.

    Raises
    ------
    InputError
        Reference that cannot be expressed in a file.
    """
    said = {"type": one.law.kind} | changed_fields(one.law) | changed_fields(one, "name", "law")
    if isinstance(one.reference, Mapping):
        try:
            said["reference"] = {
                sensor: components_table((law,), "torque")["torque"] for sensor, law in one.reference.items()
            }
        except (InputError, KeyError):
            remedy = "give numbers or expressions of the time"
            raise inexpressible(f"{TABLE}.{one.name}.reference", dict(one.reference), remedy) from None
    return said
