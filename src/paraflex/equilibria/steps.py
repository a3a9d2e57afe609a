"""Static equilibria of a mechanism under loads and prescribed displacements, in steps along their branch."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from paraflex.arguments import checked_arguments
from paraflex.dynamics import State, pose_at_rest, standing_system
from paraflex.errors import EquilibriumError, ResultWarning
from paraflex.findings import warn_of
from paraflex.limits import solvable
from paraflex.mechanism import Mechanism, Start
from paraflex.validity import warn
from .branch import Branch, Point
from .conditions import ModelWithStatics, StaticsDefaults, conditions
from .equations import Equations
from .result import Equilibrium, Statics
from .stability import buckling as buckling_about, checked, stiffness as stiffness_at, vibrations

# A limit point is searched for if the linear estimate is further away than the first, as the estimate errs by no more
# than its distance. The search ends at the second load factor, or at the third if estimates change along the branch by
# more than the last fraction.
_NEAR, _FURTHEST, _CHANGING_FURTHEST, _CHANGING = 0.01, 2.0, 5.0, 0.05


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
    """Find equilibria as loads, torques and displacements grow from zero to their given values, in equal steps.

    The mechanism's own weight, loads and springs act in full from the start. The branch is followed by its arc length,
    past limit points: a load fraction may then occur several times, and limit points appear between steps.

    A coordinate is the angle or travel of a joint, by the joint's name; or "body.point.x", "body.point.y",
    "body.point.angle".

    Parameters
    ----------
    source : Mechanism or Model
        Mechanism, or model whose [statics] gives the defaults; one of `loads`, `torques` and `moved` replaces all
        three.
    loads : mapping of str to float, optional
        Forces and torques at coordinates [N, N m]. They keep their direction.
    torques : mapping of str to float, optional
        Torques or forces of motors by name [N m, N].
    moved : mapping of str to float, optional
        Changes of coordinates from the start [m, rad]; the result has the forces they require.
    held : sequence of str, optional
        Coordinates that keep their value; by default the joints of all motors without a torque. An empty sequence holds
        none.
    steps : int, optional
        Number of equal steps, 10 by default.
    stiffness : sequence of str, optional
        Coordinates whose stiffness is computed; by default those that are loaded or moved.
    buckling : int, optional
        Number of buckling factors computed about every equilibrium, 1 by default.
    assembly : str, optional
        Name of the assembly; the first by default.
    start : Start or State, optional
        Pose from which changes count, if nothing else deflects it; by default the model's start, or the assembly.
    warning : bool
        Whether a doubtful result issues warnings; its `validity` and `findings` hold them in either case.

    Returns
    -------
    Statics
        Equilibria along the branch.

    Warns
    -----
    ValidityWarning, ResultWarning
        Deflections are beyond the model's geometry, or equilibria are unstable.

    Raises
    ------
    InputError
        Names are unknown, a coordinate is given twice, or the number of steps is out of range.
    AssemblyError
        The loops do not close.
    EquilibriumError
        No equilibrium is found, near the start or beyond some step; the error carries the `Statics` up to there.
    LimitPointError
        No equilibrium of the branch carries the given loads; the error carries the `Statics` up to there.
    """
    mechanism = Mechanism.from_source(source)
    own, begin = (StaticsDefaults(), None) if isinstance(source, Mechanism) else (source.statics, source.start)
    requested = own.filled(
        loads=loads, torques=torques, moved=moved, held=held, steps=steps, stiffness=stiffness, buckling=buckling
    )
    result = _followed(mechanism, requested, begin if start is None else start, assembly)
    if warning:
        warn(result.validity)
        warn_of(result.findings, ResultWarning)
    return result


@solvable("equilibria")
def _followed(
    mechanism: Mechanism, requested: StaticsDefaults, start: Start | State | None, assembly: str | None
) -> Statics:
    """Return the equilibria; an error carries those found before it."""
    given = conditions(mechanism, requested)
    system = standing_system(mechanism, start, assembly)
    equations = Equations(system, pose_at_rest(system, start, assembly), given)
    found: list[Equilibrium] = []
    branch = Branch(equations)
    try:
        first = branch.first()
        found.append(_equilibrium(equations, first, requested.buckling))
        if given.moved or given.loads:
            for point in branch.follow(first, requested.steps):
                found.append(_equilibrium(equations, point, requested.buckling))
    except EquilibriumError as error:
        error.partial = Statics(equations, _checked(found, [], requested), "failed", str(error)) if found else None
        raise
    return Statics(equations, _checked(found, _limit_beyond(branch, found, requested), requested))


def _equilibrium(equations: Equations, point: Point, buckling: int) -> Equilibrium:
    found = equations.matrices(point.at)
    vibration = free = vibrations(equations, found)
    if equations.conditions.moved:
        moved = [equations.number[one] for one in equations.conditions.moved]
        kept = np.flatnonzero(~np.isin(equations.holding, moved))
        free = vibrations(equations, found._replace(rows=csr_matrix(found.rows[kept])))
    return Equilibrium(
        point, vibration, free, buckling_about(equations, point, found, vibration, buckling),
        stiffness_at(equations, point.at, found, equations.conditions.measured),
    )  # fmt: skip


def _checked(
    found: list[Equilibrium], beyond: list[Equilibrium], requested: StaticsDefaults
) -> tuple[Equilibrium, ...]:
    """Return the equilibria with buckling factors that the branch, there and beyond, does not contradict."""
    seen = [(one.point, one.vibrations, one.buckling) for one in (*found, *beyond)]
    return tuple(replace(one, buckling=checked(seen[k:], requested.buckling)) for k, one in enumerate(found))


def _limit_beyond(branch: Branch, found: list[Equilibrium], requested: StaticsDefaults) -> list[Equilibrium]:
    """Return the limit point beyond the given loads, if the last equilibrium is estimated to buckle and it is near."""
    last = found[-1]
    begun, ended = (float(np.min(one.buckling.factors[:1], initial=np.inf)) for one in (found[0], last))
    furthest = _CHANGING_FURTHEST if abs(begun - ended) > _CHANGING * ended else _FURTHEST
    estimate = float(np.min(last.buckling.factors[:1], initial=np.inf)) / max(last.point.at.s, 1e-300)
    if not (last.vibrations.stable and 1.0 + _NEAR < estimate < np.inf):
        return []
    try:
        for point in branch.follow(last.point, requested.steps, min(estimate, furthest)):
            if point.limit:
                return [_equilibrium(branch.equations, point, requested.buckling)]
    except EquilibriumError:
        pass
    return []
