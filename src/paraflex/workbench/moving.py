"""Pose of a mechanism that is dragged by hand: it follows the mouse as closed loops, and stays in its assembly."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.driven.exact import NO_TASKS
from paraflex.dynamics import System, closure_of, reference_pose, standing_system
from paraflex.dynamics.joint_coordinates import joint_value
from paraflex.dynamics.points import marker_position
from paraflex.dynamics.projection import assemble, closed, constraint_change
from paraflex.dynamics.soundness import mobility
from paraflex.dynamics.state import State
from paraflex.errors import InputError, listed
from paraflex.mechanism import GROUND, Assembly, Joint, Mechanism, PointRef
from paraflex.mechanism.masses import with_any_masses
from paraflex.mechanism.poses import local_points
from paraflex.mechanism.quantities import known
from paraflex.paths.loops import LoopClosure
from .branches import NO_SIGN, Branches, Guard
from .dragging import REACHED, Dragging

# Longest step of closures after a change [sizes of the mechanism, rad].
_LONGEST = 0.2
# Targets further away are brought nearer [sizes of the mechanism].
_FAR = 20.0
# Distance between poses that are remembered, and their number.
_APART, _REMEMBERED = 0.02, 500
# Elbows with a smaller sine are named where a drag stops, slopes of the distance below this belong to limits of reach,
# and so many elbows are named.
_NAMED, _LEVEL, _LISTED = 1e-2, 1e-2, 3
_PARALLEL = "the drives {} cannot hold it: parallel singular position (type II)"


class Moved(NamedTuple):
    """Pose after a drag.

    Attributes
    ----------
    q : (n,) array
        Coordinates.
    reached : bool
        Whether the point is at the target.
    stop : str
        "reach" if the point is at a limit of reach, "singular" if it could move further, but only into another
        assembly; empty if neither holds it back.
    problem : str
        Sentence on the limit or singular position; empty without one.
    """

    q: Array
    reached: bool
    stop: str = ""
    problem: str = ""


@dataclass
class _Drag:
    """One drag: its body and algebra, the target before, and poses that it has passed."""

    body: str
    dragging: Dragging
    target: Array
    determined: bool
    passed: list[tuple[Array, Array]]


def _loops_of(mechanism: Mechanism) -> LoopClosure:
    """Return the closure of the rigid mechanism without prescribed motions."""
    return LoopClosure(replace(with_any_masses(mechanism).rigid(), prescribed=()), 0.0, None, NO_TASKS)


class Mover:
    """Rigid pose of a mechanism, which a person drags.

    Prescribed motions are released; springs, dampers and friction have no effect; bodies need no masses.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    assembly : str, optional
        Name of the assembly; the first by default.

    Attributes
    ----------
    loops : LoopClosure
        Closure of the rigid mechanism without prescribed motions.
    q : (n,) array
        Coordinates of the present pose, loops closed.
    freedoms : int
        Degrees of freedom.

    Raises
    ------
    InputError
        There is no assembly, or none of this name.
    AssemblyError
        The loops do not close.
    """

    q: Array
    freedoms: int

    def __init__(self, mechanism: Mechanism, assembly: str | None = None) -> None:
        self.mechanism: Mechanism = mechanism
        self.loops: LoopClosure = _loops_of(mechanism)
        self.system: System = self.loops.system
        self.to_assembly(assembly)

    def to_assembly(self, name: str | None = None) -> Array:
        """Move to an assembly of the mechanism, loops closed, and return the pose."""
        if not self.mechanism.assemblies:
            remedy = "add an [assembly.NAME] table with an approximate angle of each body, in rad"
            raise InputError("no assembly: the poses of the bodies are unknown", field="assembly.NAME", remedy=remedy)
        return self.at(_begun(self.mechanism, self.loops, self.mechanism.assembly(name)))

    def at(self, q: Array) -> Array:
        """Move to a pose (n,), whose loops are closed, and return it; drags stay in its assembly."""
        self.q = np.array(q, dtype=float)
        found = mobility(self.system, State(0.0, self.q, np.zeros(self.system.n)))
        self.freedoms = found.nearby_freedoms or found.freedoms
        self._branches = Branches(self.system, self.freedoms, self.q)
        self._signs: dict[str, Guard] = {}
        self._own = "", Guard(lambda q: 0.0, "")
        self._drag: _Drag | None = None
        return self.q

    def redraw(self, mechanism: Mechanism) -> bool:
        """Take a changed mechanism and close its loops from the present pose; return whether they do.

        Otherwise the pose is that of the first assembly. Bodies that are new begin in the first assembly.

        Raises
        ------
        InputError, AssemblyError
            The loops close neither from the present pose nor in the assembly; the mover keeps its mechanism.
        """
        loops = _loops_of(mechanism)
        system, guess = loops.system, np.zeros(loops.system.n)
        if any(body.name not in self.system.index for body in system.bodies):
            guess = reference_pose(system, mechanism.assembly(None))
        for body in system.bodies:
            if body.name in self.system.index:
                guess[body.all] = self.q[self.system.body(body.name).all]
        change = partial(constraint_change, system)
        pose, phi = assemble(system, loops.signals, 0.0, guess, change, longest=_LONGEST)
        kept = closed(system, pose, phi)
        if not kept:
            pose = _begun(mechanism, loops, mechanism.assembly(None))
        self.mechanism, self.loops, self.system = mechanism, loops, system
        self.at(pose)
        return kept

    def angles(self) -> dict[str, float]:
        """Return the angles of all bodies at the present pose [rad]."""
        return {body.name: float(self.q[body.angle]) for body in self.system.bodies}

    def places(self) -> dict[str, tuple[float, float]]:
        """Return the positions of all named points of bodies, by "body.point" [m]."""
        refs = [PointRef(body.name, point) for body in self.loops.mechanism.bodies for point in body.points]
        found = {str(ref): marker_position(self.system, self.system.marker(ref), self.q) for ref in refs}
        return {name: (float(x), float(y)) for name, (x, y) in found.items()}

    def travels(self) -> dict[str, float]:
        """Return the travels of all sliding joints with prescribed motions at the present pose [m]."""
        sliding = [one.joint for one in self.mechanism.prescribed if self.mechanism.slides(one.joint)]
        return {name: joint_value(self.system, name, self.q) for name in sliding}

    def release(self) -> None:
        """End the present drag; the next one begins from the present pose."""
        self._drag = None

    def drag(self, body: str, local: Iterable[float] | str, to: Iterable[float]) -> Moved:
        """Move a point of a body towards a target, as near as the loops and the assembly allow.

        Parameters
        ----------
        body : str
            Body.
        local : (2,) array or str
            Place of the point in the body's frame [m], or its name.
        to : (2,) array
            Target [m].
        """
        target = np.array([*to], dtype=float)
        if target.shape != (2,) or not np.all(np.isfinite(target)):
            raise InputError("not two finite numbers", field="to", value=target.tolist(), remedy="give x and y in m")
        here = self._dragged(body, local)
        drag, size = here.dragging, self.system.size
        place = drag.place(self.q)
        away = float(np.hypot(*(target - place))) / size
        goal = place + (target - place) * min(1.0, _FAR / max(away, _FAR))
        q = drag.follow(self.q, here.target, goal)
        if here.determined and drag.distance(q, goal) > REACHED:
            q = self._from_passed(here, q, goal)
        reached = drag.distance(q, target) <= REACHED
        if reached and all(np.hypot(*(goal - at)) > _APART * size for at, _ in here.passed):
            here.passed.append((goal, q))
            del here.passed[1:-_REMEMBERED]
        self.q, here.target = q, goal
        return Moved(q, reached, *(("", "") if reached else self._stop(here, q, goal)))

    def _from_passed(self, here: _Drag, q: Array, goal: Array) -> Array:
        """Return the pose that follows from the nearest pose passed in this drag, if it comes nearer to the target."""
        place, pose = min(here.passed, key=lambda one: float(np.hypot(*(one[0] - goal))))
        if np.hypot(*(place - goal)) >= self.system.size * here.dragging.distance(q, goal):
            return q
        again = here.dragging.follow(pose, place, goal)
        return again if here.dragging.distance(again, goal) < here.dragging.distance(q, goal) - REACHED else q

    def _dragged(self, body: str, local: Iterable[float] | str) -> _Drag:
        """Return the drag of a point: the present one, or a new one."""
        known(body, [one.name for one in self.loops.mechanism.bodies], "body", "body")
        if isinstance(local, str):
            places = local_points(self.loops.mechanism.body(body))
            known(local, [*places], f"body.{body}", "point")
            local = places[local]
        at, point = self.system.body(body).offset, np.array([*local], dtype=float)
        old = self._drag
        if old is not None and old.dragging.at == at and np.array_equal(old.dragging.local, point):
            return old
        drag = Dragging(self.system, self.loops.signals, self.freedoms, at, point, [])
        place, guide = drag.place(self.q), self._guide(body)
        determined = self.freedoms == 2 and guide is None
        if guide is not None and self.freedoms == 1:
            drag.guards.append(self._limit(f"{body} {guide.name}", self._branches.joint_rows([guide.name])))
        elif determined:
            limit = self._limit(f"{body} {point}", drag.rows)
            # A point that two freedoms move along a line is not determined by its place.
            determined = bool(limit.sign) or abs(limit.value(self.q)) > NO_SIGN
            drag.guards.extend([limit] if determined else [])
        drag.guards.extend(self._lasting(chains=determined))
        for guard in drag.guards:
            guard.begin(self.q)
        self._drag = _Drag(body, drag, place, determined, [(place, self.q)])
        return self._drag

    def _limit(self, name: str, rows: Callable[[Array], Array]) -> Guard:
        """Return the guard of the limits of reach of a point, with its sign if the same body was dragged last."""
        if self._own[0] != name:
            self._own = name, self._branches.determinant(rows, "")
        return self._own[1]

    def _guide(self, body: str) -> Joint | None:
        """Return the joint that guides a body on the ground."""
        found = [
            one for one in self.loops.mechanism.joints_at[body] if one.moves and GROUND in (one.a.body, one.b.body)
        ]
        return found[0] if found else None

    def _lasting(self, *, chains: bool) -> list[Guard]:
        """Return what keeps its sign whichever body is dragged: elbows, and the drives' determinant."""
        found = self._branches.guarded_elbows(chains=chains) if self.freedoms else []
        if self.drives:
            rows = self._branches.joint_rows(self.drives)
            found.append(self._branches.determinant(rows, _PARALLEL.format(listed(self.drives))))
        return [self._signs.setdefault(guard.text, guard) for guard in found]

    @property
    def drives(self) -> list[str]:
        """Joints with prescribed motions or motors, if they are as many as the degrees of freedom; else none."""
        given = self.mechanism.prescribed, self.mechanism.motors, (*self.mechanism.prescribed, *self.mechanism.motors)
        for each in given:
            joints = list(dict.fromkeys(one.joint for one in each))
            if joints and len(joints) == self.freedoms:
                return joints
        return []

    def _stop(self, here: _Drag, q: Array, goal: Array) -> tuple[str, str]:
        """Return what holds a point back from its target, and a sentence on it."""
        drag = here.dragging
        near = [guard for guard in drag.guards if guard.sign and guard.room(q) < guard.margin]
        slope = drag.slope(q, goal)
        falling = float(np.linalg.norm(slope.gradient)) > _LEVEL * drag.distance(q, goal)
        usual = self._branches.start, self._branches.free(self._branches.start)
        lost = drag.directions(q, slope.free) < drag.directions(*usual)
        if not near and not lost:
            return "", ""
        elbows = self._branches.elbows_to(here.body, drag.local)
        in_line = [one.text for one in elbows if abs(np.sin(q[one.b] - q[one.a] + one.offset)) < _NAMED]
        texts = dict.fromkeys([guard.text for guard in near if guard.text] + in_line)
        stop = "singular" if near and falling else "reach"
        own = "singular position" if stop == "singular" else f"limit of reach of {here.body}"
        return stop, f"{own}: {listed([*texts], _LISTED)}" if texts else own


def _begun(mechanism: Mechanism, loops: LoopClosure, assembly: Assembly) -> Array:
    """Return the pose in which a run begins: with prescribed motions as they begin, if the loops close with them."""
    if mechanism.prescribed:
        found = closure_of(standing_system(with_any_masses(mechanism).rigid(), assembly.name), assembly)
        if found.state is not None:
            return found.state.q
    return loops.assembled(assembly)
