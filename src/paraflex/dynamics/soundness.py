"""Soundness of a mechanism: closure of its assemblies, degrees of freedom, redundant constraints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics.projection import joint_gaps
from paraflex.dynamics.rank import Dependence, dependence, involved, joint_of_row
from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.sparse import Saddle, sparse_jacobian, sparse_mass
from paraflex.dynamics.state import State, close_downhill, consistent_state, reference_pose
from paraflex.dynamics.system import System
from paraflex.errors import AssemblyError, InconsistentConstraintsError, ProportionError
from paraflex.limits import solvable
from paraflex.mechanism import Assembly

# How far a body turns, or moves as a part of the mechanism's size, to look whether a pose is a special one.
_NUDGE = 1e-2
_DIRECTIONS = 3
# A pose so found is closed to this [sizes of the mechanism, rad], is off by a part of the way tried, and has a rank
# that shows beside both.
_CLOSED, _BACK, _DEPENDENT = 1e-10, 3.0, 1e-6


@dataclass(frozen=True)
class Closure:
    """Result of closing one assembly.

    Attributes
    ----------
    assembly : str
    gap_before : float
        Largest gap of a joint with the angles as given, put together along the tree of joints [m, rad].
    position, velocity : float
        Largest |Phi| and |Phi'| once closed [m, rad; 1/s]; NaN for what could not be computed.
    gap : float
        Largest that remains where the loops do not close [m, rad]; zero where they do.
    where : tuple of str
        Joints, gears and prescribed motions with such gaps.
    problem : str
        Why there is no start; empty for none.
    state : State or None
    remedy : str
        What to do about the problem.
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
        """Whether the loops close and yet velocities do not follow: those of [start] may."""
        return self.state is None and self.gap == 0.0


def closure_of(system: System, assembly: Assembly, time: float = 0.0) -> Closure:
    """Close an assembly, and report the gaps; it raises nothing if the assembly cannot be closed.

    Take the rigid mechanism to learn what lengths and places allow: beams are not stretched to fit.
    """
    signals, nan = moment_signals(system.mechanism, time), math.nan
    q = reference_pose(system, assembly)
    before = max(joint_gaps(system, system.constraints(signals, time, q)[0]).values(), default=0.0)
    try:
        state = consistent_state(system, assembly, time=time)
    except AssemblyError as error:
        gaps = joint_gaps(system, system.constraints(signals, time, error.partial)[0])
        return Closure(assembly.name, before, nan, nan, max(gaps.values()), tuple(gaps), error.cause, None)
    except (InconsistentConstraintsError, ProportionError) as error:
        return Closure(assembly.name, before, nan, nan, 0.0, (), error.cause.rstrip(","), None, error.remedy)
    phi, rate = system.constraints(signals, time, state.q, state.v)
    position, velocity = (float(np.max(np.abs(part), initial=0.0)) for part in (phi, rate))
    return Closure(assembly.name, before, position, velocity, 0.0, (), "", state)


@dataclass(frozen=True)
class Redundancy:
    """A constraint that follows from others.

    Attributes
    ----------
    row : str
        Its name ("B1 x"): one of several that could be named, the one a factorisation comes to last.
    joint : str
        Whose it is.
    among : tuple of str
        All joints, gears and prescribed motions that depend on one another there, this one included.
    """

    row: str
    joint: str
    among: tuple[str, ...]


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom that the constraints leave.

    Attributes
    ----------
    bodies : int
    constraints : int
        Constraint rows, of joints, gears and prescribed motions.
    rank : int
        Of the constraint Jacobian at the pose.
    redundant : tuple of Redundancy
        As many as constraints less rank.
    lasting : int or None
        Freedoms a little further along: fewer than at the pose where that is a special (singular) one, none where no
        way on was found. None if the pose leaves no freedom to move along, so that its neighbours cannot be seen.
    """

    bodies: int
    constraints: int
    rank: int
    redundant: tuple[Redundancy, ...]
    lasting: int | None

    @property
    def count(self) -> int:
        """Gruebler's count: three per body less the constraints."""
        return 3 * self.bodies - self.constraints

    @property
    def freedoms(self) -> int:
        """Degrees of freedom at the pose: three per body less the rank."""
        return 3 * self.bodies - self.rank

    @property
    def lasting_redundant(self) -> int:
        """Redundant constraints that are not those of a special pose only."""
        return len(self.redundant) - (self.freedoms - self.lasting if self.special and self.lasting is not None else 0)

    @property
    def special(self) -> bool:
        """Whether some of the freedoms exist at this pose only."""
        return self.lasting is not None and self.lasting < self.freedoms


@solvable("degrees of freedom")
def mobility(system: System, state: State) -> Mobility:
    """Degrees of freedom and redundant constraints of a rigid mechanism at a closed pose.

    Whether a pose is special is found by moving on from it: a short way in a few directions that the constraints allow
    there, closing the loops again, and taking the rank anew.
    """
    here = dependence(system, state.q)
    redundant = tuple(_redundancies(system, here))
    # Where no constraint depends on others the rank cannot be larger elsewhere.
    lasting: int | None = system.n - here.rank
    if redundant and lasting:
        ranks = [dependence(system, q, _DEPENDENT).rank for q in _poses_nearby(system, state)]
        lasting = system.n - max(here.rank, *ranks) if ranks else 0
    elif redundant:
        lasting = None
    return Mobility(len(system.bodies), system.n_constraints, here.rank, redundant, lasting)


def _redundancies(system: System, found: Dependence) -> Iterator[Redundancy]:
    for k in np.argsort(found.dropped).tolist():
        row = system.rows[found.dropped[k]]
        yield Redundancy(row, joint_of_row(row), tuple(involved(system, found, k)))


def _poses_nearby(system: System, state: State) -> Iterator[Array]:
    """Closed poses a short distance away, in random directions within the null space of the constraints."""
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
            q = close_downhill(system, signals, state.time, state.q + sign * move)
            gap = system.gap(system.constraints(signals, state.time, q)[0])
            gone = q - state.q
            # An isolated pose: closing the loops leads back to it.
            if gap < _CLOSED and move @ (M @ move) < _BACK**2 * (gone @ (M @ gone)):
                yield q
