"""Static equilibria of a mechanism under loads and given travel, in steps along their branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.dynamics import State, build_system, pose_at_rest
from paraflex.equilibria.branch import Branch, Point
from paraflex.equilibria.defaults import ModelWithStatics, StaticsDefaults
from paraflex.equilibria.equations import Conditions, Coordinate, Equations, coordinate_named
from paraflex.equilibria.result import Equilibrium, Statics
from paraflex.equilibria.stability import buckling as buckling_about, stiffness as stiffness_at, vibrations
from paraflex.errors import EquilibriumError, InputError, ResultWarning
from paraflex.findings import warn_of
from paraflex.limits import solvable
from paraflex.mechanism import Mechanism, Start
from paraflex.mechanism.quantities import known
from paraflex.validity import warn

# More steps are a finer figure than anyone looks at.
_MOST_STEPS = 10_000
# Higher buckling modes than these say nothing.
_MOST_FACTORS = 20


@checked_arguments()
def statics(
    source: Mechanism | ModelWithStatics,
    *,
    loads: Mapping[str, float] | None = None,
    torques: Mapping[str, float] | None = None,
    moved: Mapping[str, float] | None = None,
    held: Sequence[str] | None = None,
    steps: int | None = None,
    stiffness: Sequence[str] | None = None,
    buckling: int | None = None,
    assembly: str | None = None,
    start: Start | State | None = None,
    warning: bool = True,
) -> Statics:
    """Equilibria as loads, torques and travel grow from nothing to what is given, in equal steps.

    The mechanism's own weight, loads and springs act in full from the start. The branch is followed by its arc length,
    past limit points: a step is then met several times, and limit points stand between steps.

    A coordinate is a joint by its name, its angle or travel; or "body.point.x", "body.point.y", "body.point.angle".

    Parameters
    ----------
    source : Mechanism or Model
        Of a model its [statics] says what is not given here; one of `loads`, `torques` and `moved` replaces all three.
    loads : mapping of str to float, optional
        Forces and torques at coordinates [N, N m]. They keep their direction.
    torques : mapping of str to float, optional
        Of motors by name [N m, N].
    moved : mapping of str to float, optional
        Changes of coordinates from the start [m, rad]; results tell the force this takes.
    held : sequence of str, optional
        Coordinates that stay; by default the joints of all motors without a torque. An empty one holds none.
    steps : int, optional
        How many equal steps, 10 by default.
    stiffness : sequence of str, optional
        Coordinates whose stiffness is computed; by default those that are loaded or moved.
    buckling : int, optional
        How many factors of buckling are computed about every equilibrium, 1 by default.
    assembly : str, optional
        The first by default.
    start : Start or State, optional
        The pose that travel counts from, if nothing else deflects it; by default the model's, or the assembly's.
    warning : bool
        Whether a result that is doubtful issues warnings; its `validity` and `doubts` hold them either way.

    Returns
    -------
    Statics

    Warns
    -----
    ValidityWarning, ResultWarning
        Deflections are beyond the model's geometry, or equilibria are unstable.

    Raises
    ------
    InputError
        Unknown names, a coordinate given twice, or a number of steps that makes no sense.
    AssemblyError
        The loops do not close.
    EquilibriumError
        No equilibrium is found, near the start or beyond some step; it carries the `Statics` until then.
    LimitPointError
        More is given than any equilibrium of the branch carries; the same.
    """
    mechanism = Mechanism.made_of(source)
    own, begin = (StaticsDefaults(), None) if isinstance(source, Mechanism) else (source.statics, source.start)
    asked = own.filled(
        loads=loads, torques=torques, moved=moved, held=held, steps=steps, stiffness=stiffness, buckling=buckling
    )
    result = _followed(mechanism, asked, begin if start is None else start, assembly)
    if warning:
        warn(result.validity)
        warn_of(result.doubts, ResultWarning)
    return result


@solvable("equilibria")
def _followed(
    mechanism: Mechanism, asked: StaticsDefaults, start: Start | State | None, assembly: str | None
) -> Statics:
    """The equilibria; an error carries those until then."""
    given = conditions(mechanism, asked)
    system = build_system(mechanism)
    equations = Equations(system, pose_at_rest(system, start, assembly), given)
    found: list[Equilibrium] = []
    try:
        branch = Branch(equations)
        first = branch.first()
        found.append(_equilibrium(equations, first, asked.buckling))
        if given.moved or given.loads:
            for point in branch.follow(first, asked.steps):
                found.append(_equilibrium(equations, point, asked.buckling))
    except EquilibriumError as error:
        error.partial = Statics(equations, tuple(found), "failed", error.problem) if found else None
        raise
    return Statics(equations, tuple(found))


def _equilibrium(equations: Equations, point: Point, buckling: int) -> Equilibrium:
    found = equations.matrices(point.at)
    vibration = vibrations(equations, found)
    return Equilibrium(
        point, vibration, buckling_about(equations, point, vibration, buckling),
        stiffness_at(equations, point.at, found, equations.given.measured),
    )  # fmt: skip


def conditions(mechanism: Mechanism, asked: StaticsDefaults) -> Conditions:
    """What is given, by coordinates of a mechanism.

    Raises
    ------
    InputError
        Unknown names, a coordinate given twice, numbers that make no sense.
    """
    _counted(asked.steps, 1, _MOST_STEPS, "steps", "steps")
    _counted(asked.buckling, 0, _MOST_FACTORS, "buckling", "factors")
    efforts = _efforts(mechanism, asked)
    travels = {coordinate_named(mechanism, name, f"moved.{name}"): value for name, value in asked.moved.items()}
    for one, value in travels.items():
        _finite(value, f"moved.{one.name}", one.unit)
    held = asked.held
    if held is None:
        given = {one.name for one in (*efforts, *travels)}
        driven = [motor.joint for motor in mechanism.motors if motor.name not in asked.torques]
        held = tuple(joint for joint in driven if joint not in given)
    kept = tuple(dict.fromkeys(coordinate_named(mechanism, name, "held") for name in held))
    for field, first, second in (("loads", efforts, travels), ("held", kept, travels), ("held", kept, efforts)):
        for one in first:
            if one in second:
                raise InputError("is given twice: loaded, moved and held exclude one another", field=field,
                                 value=one.name, remedy="leave it out of all but one")  # fmt: skip
    wanted = [*travels, *efforts] if asked.stiffness is None else [
        coordinate_named(mechanism, name, "stiffness") for name in asked.stiffness
    ]  # fmt: skip
    return Conditions(kept, travels, efforts, tuple(dict.fromkeys(wanted)))


def _efforts(mechanism: Mechanism, asked: StaticsDefaults) -> dict[Coordinate, float]:
    """Forces and torques at coordinates; a motor's is at its joint, and several there add up."""
    joints = {motor.name: motor.joint for motor in mechanism.motors}
    efforts: dict[Coordinate, float] = {}
    for field, values in (("loads", asked.loads), ("torques", asked.torques)):
        for name, value in values.items():
            if field == "torques":
                known(name, list(joints), field, "motor")
            one = coordinate_named(mechanism, joints[name] if field == "torques" else name, f"{field}.{name}")
            _finite(value, f"{field}.{name}", one.effort_unit)
            efforts[one] = efforts.get(one, 0.0) + value
    return efforts


def _counted(number: int, least: int, most: int, field: str, what: str) -> None:
    if not least <= number <= most:
        raise InputError(f"no such number of {what}", field=field, value=number, remedy=f"choose one up to {most}")


def _finite(value: float, field: str, unit: str) -> None:
    if not np.isfinite(value):
        raise InputError("not a finite number", field=field, value=value, remedy=f"give it in {unit}")
