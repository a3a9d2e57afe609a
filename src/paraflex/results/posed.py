"""The pose a mechanism starts from, to draw before anything runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.dynamics import System, closure_of, standing_system, start_state
from paraflex.dynamics.projection import joint_gaps, row_unit
from paraflex.dynamics.rank import joint_of_row
from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.state import reference_pose
from paraflex.errors import InputError, NumericalError
from paraflex.kinematics import Path, follow_path
from paraflex.mechanism import Mechanism, PointRef, Start
from paraflex.results.acting import first_movements, first_movements_along
from paraflex.results.drawing import drawing_data, system_drawing

# Poses along a path, for rails as long as the travel, and places of the path that is drawn.
_POSES, _PLACES = 81, 801
# A gap of joints below this is none [m, rad].
_CLOSED = 1e-9


@dataclass(frozen=True)
class Posed:
    """A mechanism at the pose it starts from.

    Attributes
    ----------
    mechanism : Mechanism
    assembly : str
        Empty where the start gives all coordinates.
    data : xarray.Dataset
        What is drawn, as a run: the start, and the rigid motion along the path where there is one.
    path : str
        Name of the path it starts on; empty without.
    desired : (d, 2) array or None
        The path's places [m].
    gaps : mapping of str to str
        Joints, gears and prescribed motions that are open as drawn, and how far, with the unit; the widest first.
    problems : tuple of str
        Why the loops do not close, and why the path cannot be followed.
    payload : (2,) array or None
        Centre of mass of what the end-effector carries [m].
    angles : mapping of str to float
        Of the frames of bodies [rad].
    moves : mapping of str to int
        Signs of the first movement of joints: of prescribed motions, and of motors along the path; 0 of one that stays.
    duration : float or None
        How long the study lasts [s], where that is known.
    """

    mechanism: Mechanism
    assembly: str
    data: xr.Dataset
    path: str = ""
    desired: Array | None = None
    gaps: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()
    payload: Array | None = None
    angles: Mapping[str, float] = field(default_factory=dict)
    moves: Mapping[str, int] = field(default_factory=dict)
    duration: float | None = None

    def place(self, ref: PointRef) -> Array:
        """Place (2,) of a point [m]."""
        if ref.on_ground:
            return np.array(self.mechanism.ground[ref.point], dtype=float)
        station = int(self.data["point_station"].values[list(self.data["point"].values).index(str(ref))])
        return self.data["shape"].values[0, station].astype(float)

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
    """The pose that a run starts from; as given, with its open joints, where the loops do not close.

    Parameters
    ----------
    mechanism : Mechanism
    assembly : str, optional
        The first by default.
    path : (str, Path), optional
        Its name, and the path that the end-effector starts on.
    start : Start, optional
        Of a run without a path.
    duration : float, optional
        Of the study [s]; that of the path by default.

    Raises
    ------
    InputError
        Nothing says where the bodies are, or an unknown assembly.
    """
    if duration is None and path is not None:
        duration = path[1].duration
    if start is not None and path is None:
        found = _started(mechanism, assembly, start)
    else:
        found = _assembled(mechanism, assembly, path)
    return replace(found, duration=duration, moves={**first_movements(mechanism, duration), **found.moves})


def _assembled(mechanism: Mechanism, assembly: str | None, path: tuple[str, Path] | None = None) -> Posed:
    """The pose of an assembly, at the start of a path where there is one."""
    if not mechanism.assemblies:
        raise InputError(
            "no assembly: nothing says where the bodies are", field="assembly",
            remedy="add an [assembly.NAME] table with an approximate angle of each body, in rad",
        )  # fmt: skip
    chosen = mechanism.assembly(assembly)
    rigid = standing_system(mechanism.rigid(), chosen.name)
    found = closure_of(rigid, chosen)
    if found.state is None:
        q = reference_pose(rigid, chosen)
        return _open(_of(mechanism, rigid, chosen.name, q[None], path), rigid, q, found.problem)
    if path is None:
        return _of(mechanism, rigid, chosen.name, found.state.q[None])
    try:
        times = np.linspace(0.0, path[1].duration, _POSES)
        motion = follow_path(mechanism, path[1], times, assembly=chosen)
    except (InputError, NumericalError) as error:
        return _of(mechanism, rigid, chosen.name, found.state.q[None], path, (f"path {path[0]}: {error}",))
    shown = _of(mechanism, rigid, chosen.name, motion.q, path)
    return replace(shown, moves=first_movements_along(rigid, motion.q))


def _started(mechanism: Mechanism, assembly: str | None, start: Start) -> Posed:
    """The pose of a start; where it cannot be taken, that of the assembly."""
    system = standing_system(mechanism, start, assembly)
    chosen = mechanism.assembly(assembly) if mechanism.assemblies else None
    try:
        state = start_state(system, start, chosen)
    except (InputError, NumericalError) as error:
        if chosen is None:
            raise
        instead = _assembled(mechanism, assembly)
        return replace(instead, problems=(*instead.problems, f"start: {error}"))
    return _of(mechanism, system, "" if chosen is None else chosen.name, state.q[None])


def _of(
    mechanism: Mechanism,
    system: System,
    assembly: str,
    q: Array,
    path: tuple[str, Path] | None = None,
    problems: tuple[str, ...] = (),
) -> Posed:
    data = drawing_data(mechanism, system_drawing(system, q), np.arange(len(q), dtype=float))
    angles = {body.name: float(q[0][system.body(body.name).angle]) for body in mechanism.bodies}
    drawn = Posed(mechanism, assembly, data, problems=problems, angles=angles)
    drawn = replace(drawn, payload=_payload(drawn))
    if path is None:
        return drawn
    name, followed = path
    return replace(drawn, path=name, desired=followed.evaluate(np.linspace(0.0, followed.duration, _PLACES)).position)


def _payload(drawn: Posed) -> Array | None:
    """Centre of mass of the payload: its offset is turned with the rigid body that carries it."""
    carried, effector = drawn.mechanism.payload, drawn.mechanism.end_effector
    if carried is None or effector is None:
        return None
    angle = drawn.angles[effector.point.body]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return drawn.place(effector.point) + turn @ np.array(carried.offset)


def _open(drawn: Posed, rigid: System, q: Array, problem: str) -> Posed:
    phi = rigid.constraints(moment_signals(rigid.mechanism, 0.0), 0.0, q)[0]
    # The row that is off most has the unit.
    rows = [rigid.rows[k] for k in np.argsort(np.abs(phi))]
    units = {joint_of_row(row): row_unit(row) for row in rows}
    gaps = {name: f"{gap:.3g} {units[name]}" for name, gap in joint_gaps(rigid, phi).items() if gap > _CLOSED}
    return replace(drawn, gaps=gaps, problems=(problem,))
