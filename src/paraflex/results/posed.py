"""Initial pose of a mechanism, drawn before a run."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, closure_of, moment_signals, reference_pose, standing_system, start_state
from paraflex.dynamics.load_values import load_values
from paraflex.dynamics.projection import joint_gaps, row_unit
from paraflex.dynamics.rank import joint_of_row
from paraflex.errors import InputError, NumericalError
from paraflex.formatting import number
from paraflex.mechanism import Mechanism, PointRef, Start
from paraflex.mechanism.masses import with_any_masses
from paraflex.paths import Path, follow_path
from .acting import ActingLoad, acting_load, first_movements, first_movements_along
from .drawing import DrawnRun, drawing_data, system_drawing

# Number of poses along a path, which give the length of rails, and of points of the drawn path.
_POSES, _PLACES = 81, 801
# Gap below which a joint counts as closed [m, rad].
_CLOSED = 1e-9


@dataclass(frozen=True)
class Posed:
    """Mechanism in its initial pose.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism as described.
    assembly : str
        Name of the assembly; empty if the start gives all coordinates.
    data : DrawnRun
        Drawn variables as of a run: the start, and the rigid motion along the path if there is one.
    path : str
        Name of the path on which the mechanism starts; empty without a path.
    desired : (d, 2) array or None
        Positions on the path [m].
    gaps : mapping of str to str
        Gap with unit of each joint, gear and prescribed motion that is open as drawn, the widest first.
    problems : tuple of str
        Reasons why the loops do not close, or why the path cannot be followed.
    payload : (2,) array or None
        Centre of mass of the payload at the end-effector [m].
    angles : mapping of str to float
        Angles of the body frames [rad].
    moves : mapping of str to int
        Signs of the first movement of joints with prescribed motions, and with motors along the path; 0 if at rest.
    duration : float or None
        Duration of the study [s], if known.
    loads : (loads, 3) array or None
        Force [N] and torque [N m] of every load at rest, if any has laws over the motion.
    """

    mechanism: Mechanism
    assembly: str
    data: DrawnRun
    path: str = ""
    desired: Array | None = None
    gaps: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()
    payload: Array | None = None
    angles: Mapping[str, float] = field(default_factory=dict)
    moves: Mapping[str, int] = field(default_factory=dict)
    duration: float | None = None
    loads: Array | None = None

    def place(self, ref: PointRef) -> Array:
        """Return the position (2,) of a point [m]."""
        if ref.on_ground:
            return np.array(self.mechanism.ground[ref.point], dtype=float)
        station = int(self.data["point_station"].values[list(self.data["point"].values).index(str(ref))])
        return self.data["shape"].values[0, station].astype(float)

    @cached_property
    def acting(self) -> list[ActingLoad]:
        """Onsets and sizes of all loads over the study."""
        found = enumerate(self.mechanism.loads)
        return [acting_load(one, self.duration, None if self.loads is None else self.loads[k]) for k, one in found]

    @property
    def closes(self) -> bool:
        """Whether all loops are closed."""
        return not self.gaps


def posed(
    mechanism: Mechanism,
    assembly: str | None = None,
    path: tuple[str, Path] | None = None,
    start: Start | None = None,
    duration: float | None = None,
) -> Posed:
    """Return the initial pose of a run; if the loops do not close, the pose as given with its open joints.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    assembly : str, optional
        Name of the assembly; the first by default.
    path : (str, Path), optional
        Name of the path, and the path on which the end-effector starts.
    start : Start, optional
        Initial state of a run without a path.
    duration : float, optional
        Duration of the study [s]; that of the path by default.

    Raises
    ------
    InputError
        The assembly is unknown, or there is none and no valid start.
    """
    if duration is None and path is not None:
        duration = path[1].duration
    moved = with_any_masses(mechanism)
    if start is not None and path is None:
        found = _started(moved, assembly, start)
    else:
        found = _assembled(moved, assembly, path)
    return replace(
        found, mechanism=mechanism, duration=duration, moves={**first_movements(mechanism, duration), **found.moves}
    )


def _assembled(mechanism: Mechanism, assembly: str | None, path: tuple[str, Path] | None = None) -> Posed:
    """Return the pose of an assembly, at the start of a path if there is one."""
    if not mechanism.assemblies:
        raise InputError(
            "no assembly: the poses of the bodies are unknown", field="assembly" if assembly else "assembly.NAME",
            remedy="add an [assembly.NAME] table with an approximate angle of each body, in rad",
        )  # fmt: skip
    chosen = mechanism.assembly(assembly)
    rigid = standing_system(mechanism.rigid(), chosen.name)
    found = closure_of(rigid, chosen)
    if found.state is None:
        q = reference_pose(rigid, chosen)
        phi = rigid.constraints(moment_signals(rigid.mechanism, 0.0), 0.0, q)[0]
        # The unit of a joint's gap is that of its row with the largest residual.
        rows = [rigid.rows[k] for k in np.argsort(np.abs(phi))]
        units = {joint_of_row(row): row_unit(row) for row in rows}
        gaps = {
            name: f"{number(gap, 3)} {units[name]}" for name, gap in joint_gaps(rigid, phi).items() if gap > _CLOSED
        }
        return replace(posed_at(mechanism, rigid, chosen.name, q[None], path, (found.problem,)), gaps=gaps)
    if path is None:
        return posed_at(mechanism, rigid, chosen.name, found.state.q[None])
    try:
        times = np.linspace(0.0, path[1].duration, _POSES)
        motion = follow_path(mechanism, path[1], times, assembly=chosen)
    except (InputError, NumericalError) as error:
        return posed_at(mechanism, rigid, chosen.name, found.state.q[None], path, (f"path {path[0]}: {error}",))
    shown = posed_at(mechanism, rigid, chosen.name, motion.q, path)
    return replace(shown, moves=first_movements_along(rigid, motion.q))


def _started(mechanism: Mechanism, assembly: str | None, start: Start) -> Posed:
    """Return the pose of a start; if it is invalid, that of the assembly with the problem noted."""
    system = standing_system(mechanism, start, assembly)
    chosen = mechanism.assembly(assembly) if mechanism.assemblies else None
    try:
        state = start_state(system, start, chosen)
    except (InputError, NumericalError) as error:
        if chosen is None:
            raise
        instead = _assembled(mechanism, assembly)
        return replace(instead, problems=(*instead.problems, f"start: {error}"))
    return posed_at(mechanism, system, "" if chosen is None else chosen.name, state.q[None])


def posed_at(
    mechanism: Mechanism,
    system: System,
    assembly: str,
    q: Array,
    path: tuple[str, Path] | None = None,
    problems: tuple[str, ...] = (),
) -> Posed:
    """Return the pose of a mechanism at coordinates q (k, n) of a system of it, of which the first are drawn."""
    data = drawing_data(mechanism, system_drawing(system, q), np.arange(len(q), dtype=float))
    angles = {body.name: float(q[0][system.body(body.name).angle]) for body in mechanism.bodies}
    loads = None
    if any(load.laws for load in mechanism.loads):
        loads = load_values(system, np.zeros(1), q[:1], np.zeros_like(q[:1]))[0]
    drawn = Posed(mechanism, assembly, data, problems=problems, angles=angles, loads=loads)
    carried, effector = mechanism.payload, mechanism.end_effector
    if carried is not None and effector is not None:
        # The offset is rotated with the rigid body that carries the payload.
        angle = angles[effector.point.body]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        drawn = replace(drawn, payload=drawn.place(effector.point) + turn @ np.array(carried.offset))
    if path is None:
        return drawn
    name, followed = path
    return replace(drawn, path=name, desired=followed.evaluate(np.linspace(0.0, followed.duration, _PLACES)).position)
