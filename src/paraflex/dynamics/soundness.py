"""Soundness of a mechanism: closure of its assemblies, degrees of freedom, redundant constraints."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import AssemblyError, InconsistentConstraintsError, ProportionError
from paraflex.limits import solvable
from paraflex.mechanism import Assembly
from .projection import joint_gaps
from .rank import Dependence, dependence, involved, joint_of_row
from .signals import moment_signals
from .sparse import Saddle, sparse_jacobian, sparse_mass
from .state import State, consistent_state, minimise_gaps, reference_pose
from .system import System

# Rotation of a body, or displacement relative to the mechanism's size, of the poses that test for a special pose.
_NUDGE = 1e-2
_DIRECTIONS = 3
# A pose so found is closed to this [sizes of the mechanism, rad], lies at a certain fraction of the distance tried, and
# has a rank threshold above both errors.
_CLOSED, _BACK, _DEPENDENT = 1e-10, 3.0, 1e-6


@dataclass(frozen=True)
class Closure:
    """Result of closing one assembly.

    Attributes
    ----------
    assembly : str
        Name of the assembly.
    gap_before : float
        Largest gap of a joint with the angles as given, assembled along the tree of joints [m, rad].
    position, velocity : float
        Largest |Phi| and |Phi'| once closed [m, rad; 1/s]; NaN if not computed.
    gap : float
        Largest remaining gap if the loops do not close [m, rad]; zero if they do.
    where : tuple of str
        Joints, gears and prescribed motions with such gaps.
    problem : str
        Reason why there is no start; empty for none.
    state : State or None
        Consistent start; None if there is none.
    remedy : str
        Remedy for the problem.
    """

    assembly: str
    gap_before: float
    position: float
    velocity: float
    gap: float
    where: tuple[str, ...]
    problem: str
    state: State | None
    remedy: str = "correct lengths, places of points, or the angles"

    @property
    def closes(self) -> bool:
        """Whether there is a consistent start."""
        return self.state is not None

    @property
    def undecided(self) -> bool:
        """Whether the loops close but velocities are not determined; those of [start] may be."""
        return self.state is None and self.gap == 0.0


def closure_of(system: System, assembly: Assembly) -> Closure:
    """Close an assembly and report the gaps; no error is raised if the assembly cannot be closed.

    The rigid mechanism shows whether lengths and positions fit: its links are not stretched to fit.

    Parameters
    ----------
    system : System
        System of the mechanism, usually of the rigid one.
    assembly : Assembly
        Assembly to close.
    time : float
        Time of prescribed motions [s].
    """
    signals, nan = moment_signals(system.mechanism, 0.0), math.nan
    q = reference_pose(system, assembly)
    before = max(joint_gaps(system, system.constraints(signals, 0.0, q)[0]).values(), default=0.0)
    try:
        state = consistent_state(system, assembly)
    except AssemblyError as error:
        gaps = joint_gaps(system, system.constraints(signals, 0.0, error.partial)[0])
        return Closure(assembly.name, before, nan, nan, max(gaps.values()), tuple(gaps), error.cause, None)
    except (InconsistentConstraintsError, ProportionError) as error:
        return Closure(assembly.name, before, nan, nan, 0.0, (), error.cause.rstrip(","), None, error.remedy)
    phi, rate = system.constraints(signals, 0.0, state.q, state.v)
    position, velocity = (float(np.max(np.abs(part), initial=0.0)) for part in (phi, rate))
    return Closure(assembly.name, before, position, velocity, 0.0, (), "", state)


@dataclass(frozen=True)
class Redundancy:
    """A redundant constraint row.

    Attributes
    ----------
    row : str
        Name of the row ("B1 x"). The choice is not unique: it is the last pivot of a factorisation.
    joint : str
        Joint of the row.
    among : tuple of str
        All joints, gears and prescribed motions that depend on one another there, this one included.
    """

    row: str
    joint: str
    among: tuple[str, ...]


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom left by the constraints.

    Attributes
    ----------
    bodies : int
        Number of bodies.
    constraints : int
        Number of constraint rows of joints, gears and prescribed motions.
    rank : int
        Rank of the constraint Jacobian at the pose.
    redundant : tuple of Redundancy
        Redundant constraints, as many as constraints less rank.
    nearby_freedoms : int or None
        Degrees of freedom at nearby poses: fewer than at a special (singular) pose, none if no nearby pose is found.
        None if the pose is redundant and has no degree of freedom, so that its neighbours cannot be examined.
    """

    bodies: int
    constraints: int
    rank: int
    redundant: tuple[Redundancy, ...]
    nearby_freedoms: int | None

    @property
    def count(self) -> int:
        """Gruebler's count: three per body less the constraints."""
        return 3 * self.bodies - self.constraints

    @property
    def freedoms(self) -> int:
        """Degrees of freedom at the pose: three per body less the rank."""
        return 3 * self.bodies - self.rank

    @property
    def special(self) -> bool:
        """Whether some of the degrees of freedom exist at this pose only."""
        return self.nearby_freedoms is not None and self.nearby_freedoms < self.freedoms


@solvable("degrees of freedom")
def mobility(system: System, state: State) -> Mobility:
    """Compute the degrees of freedom and redundant constraints of a rigid mechanism at a closed pose.

    A pose is recognised as special by a small move in a few directions that the constraints allow there: the loops are
    closed again, and the rank is computed anew.

    Parameters
    ----------
    system : System
        System of the rigid mechanism.
    state : State
        State whose pose is closed.
    """
    here = dependence(system, state.q)
    redundant = tuple(_redundancies(system, here))
    # If no constraint is redundant here, the rank cannot be larger elsewhere.
    nearby: int | None = system.n - here.rank
    if redundant and nearby:
        ranks = [dependence(system, q, _DEPENDENT).rank for q in _poses_nearby(system, state)]
        nearby = system.n - max(here.rank, *ranks) if ranks else 0
    elif redundant:
        nearby = None
    return Mobility(len(system.bodies), system.n_constraints, here.rank, redundant, nearby)


def _redundancies(system: System, found: Dependence) -> Iterator[Redundancy]:
    for k in np.argsort(found.dropped).tolist():
        row = system.rows[found.dropped[k]]
        yield Redundancy(row, joint_of_row(row), tuple(involved(system, found, k)))


def _poses_nearby(system: System, state: State) -> Iterator[Array]:
    """Yield closed poses a short distance away, in random directions within the null space of the constraints."""
    signals, random = moment_signals(system.mechanism, state.time), np.random.default_rng(0)
    M = sparse_mass(system, state.q)
    solver = Saddle(M, sparse_jacobian(system, state.q))
    angles = np.array([body.angle for body in system.bodies])
    places = np.setdiff1d(np.arange(system.n), angles)
    size = system.size
    for _ in range(_DIRECTIONS):
        wish = random.standard_normal(system.n)
        wish[places] *= size
        move = solver.solve(M @ wish)[0]
        move *= _NUDGE / max(np.max(np.abs(move[angles])), np.max(np.abs(move[places])) / size)
        for sign in (1.0, -1.0):
            q = minimise_gaps(system, signals, state.time, state.q + sign * move)
            gap = system.gap(system.constraints(signals, state.time, q)[0])
            gone = q - state.q
            # At an isolated pose closing the loops leads back to it.
            if gap < _CLOSED and move @ (M @ move) < _BACK**2 * (gone @ (M @ gone)):
                yield q
