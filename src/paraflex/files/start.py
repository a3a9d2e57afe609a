"""Reading of the [start] table of a model file."""

from paraflex.mechanism import BodyValues, Deflection, Mechanism, PointRef, Start, check_start
from .schema import DeflectionTable, StartTable


def read_start(table: StartTable, mechanism: Mechanism) -> Start:
    """Build the start of a model from its table.

    Raises
    ------
    InputError
        Invalid start; see `mechanism.check_start`.
    """
    start = Start(
        deflection={
            body: {
                point: Deflection(**dict(one)) if isinstance(one, DeflectionTable) else Deflection(*one)
                for point, one in points.items()
            }
            for body, points in table.deflection.items()
        },
        angular=table.velocity.angular,
        point={
            PointRef.parse(text, "start.velocity.point"): (velocity[0], velocity[1])
            for text, velocity in table.velocity.point.items()
        },
        coordinates={name: BodyValues(**dict(one)) for name, one in table.coordinates.items()},
        rates={name: BodyValues(**dict(one)) for name, one in table.rates.items()},
    )
    check_start(mechanism, start)
    return start
