"""A [start] table as a start by names."""

from __future__ import annotations

from collections.abc import Mapping

from paraflex.files.schema import CoordinatesTable, DeflectionTable, StartTable
from paraflex.mechanism import BodyValues, Deflection, Mechanism, PointRef, Start, check_start


def read_start(table: StartTable, mechanism: Mechanism) -> Start:
    """What a file says of the start.

    Raises
    ------
    InputError
        See `mechanism.check_start`.
    """
    start = Start(
        deflection={
            body: {point: _deflection(entry) for point, entry in points.items()}
            for body, points in table.deflection.items()
        },
        angular=table.velocity.angular,
        point={
            PointRef.parse(text, "start.velocity.point"): (velocity[0], velocity[1])
            for text, velocity in table.velocity.point.items()
        },
        coordinates=_values(table.coordinates),
        rates=_values(table.rates),
    )
    check_start(mechanism, start)
    return start


def _deflection(entry: list[float] | DeflectionTable) -> Deflection:
    if isinstance(entry, DeflectionTable):
        return Deflection(entry.axial, entry.transverse, entry.slope)
    return Deflection(entry[0], entry[1])


def _values(table: Mapping[str, CoordinatesTable]) -> dict[str, BodyValues]:
    return {
        name: BodyValues(entry.x, entry.y, entry.phi, None if entry.flexible is None else tuple(entry.flexible))
        for name, entry in table.items()
    }
