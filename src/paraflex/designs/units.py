"""Units of the parameters of designs, from the descriptions in the schemas of files."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from paraflex.expressions.dimensions import dimensions_of_parameters
from paraflex.files.fields import Place, check_unit, field_at, leaves, units_at
from paraflex.files.schema import ModelTable, NumberOfText
from paraflex.results.metrics import MetricMembers, metric_unit
from paraflex.units import dimension_text
from .schema import SweepTable


def unit_of(data: Mapping[str, Any], place: Place) -> str:
    """Return the unit of a number in a mechanism's file or a study's [integration]; empty unless there is one.

    A parameter of a mechanism has the unit of the fields that are this parameter alone.
    """
    places = [at for at, value in leaves(data) if value == place[1]] if place[0] == "parameters" else [place]
    found = {units for at in places if len(units := units_at(_schema(at), data, at) or ()) == 1}
    return found.pop()[0] if len(found) == 1 else ""


def check_unit_of(data: Mapping[str, Any], place: Place, text: str, field: str) -> None:
    """Check the unit of an expression that a study gives for a number in a mechanism's file.

    Raises
    ------
    InputError
        The unit is not that of the number; see `files.fields.check_unit`.
    """
    schema = _schema(place)
    units = units_at(schema, data, place)
    # A parameter with a unit keeps its dimension.
    if place[0] == "parameters" and (own := dimensions_of_parameters(data["parameters"])[str(place[1])]) is not None:
        units = (dimension_text(own),)
    check_unit(text, {}, units, field, field_at(schema, data, place).description)


def check_unit_of_metric(value: float, column: str, members: MetricMembers, field: str) -> None:
    """Check the unit of an expression that a study gives for the target or limit of a metric.

    Raises
    ------
    InputError
        The unit is not that of the metric; see `files.fields.check_unit`.
    """
    if isinstance(value, NumberOfText):
        unit = metric_unit(column, members)
        check_unit(value.text, {}, (unit,) if unit != "1" else (), field, f"{column} in {unit}")


def _schema(place: Place) -> type[BaseModel]:
    return SweepTable if place[0] == "integration" else ModelTable
