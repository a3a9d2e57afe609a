"""Description of a drawn mechanism, in metres: links, joints, ground, springs, loads and paths at given times.

Scenes are drawn by Matplotlib (`plots/drawing.py`), as SVG (`plots/svg.py`) and by the player of reports
(`reports/film.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.errors import InputError, suggestion
from paraflex.figures.selection import names_of, point_number, select_run
from paraflex.figures.shapes import figure_of
from paraflex.folders import RESULT_KINDS
from paraflex.formatting import display_unit, printable, quantity

if TYPE_CHECKING:
    import xarray as xr

    from paraflex.results.drawing import DrawnRun

    Run = xr.Dataset | DrawnRun

# Variables of joints, and their counterparts for the bodies of shape_base.
JOINT_BASES = {"joint_position": "joint_base", "joint_direction": "joint_direction_base"}
# Number of points of a circle.
_CIRCLE = 61
# Length and width of a sliding block, as shares of the picture's larger side.
BLOCK = (0.034, 0.022)
# Length of the arrow of the largest force, and radius of those of torques, as shares of the picture's larger side.
ARROW, TURN = 0.12, 0.045
_MARGIN = 0.07
# Largest share of the width that a scale bar takes.
_SCALE_BAR = 0.28
# Path length below which a point is at rest [m].
_STILL_POINT = 1e-6
# Magnifications of deflections. The default draws deflections at most as large as the first share of the mechanism's
# size, and does not magnify them if the largest magnification leaves them below the second share.
MAGNIFICATIONS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
_SHOWN_BENDING, _UNSEEN_BENDING = 0.08, 0.005
# Percentiles of all positions between which a run lies that does not diverge.
_RUN_SHARES = (0.2, 99.8)


class Limits(NamedTuple):
    """Limits of a picture in the plane [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def size(self) -> float:
        """Larger side [m]."""
        return max(self.right - self.left, self.top - self.bottom)

    def filling(self, flattest: float, tallest: float) -> tuple[Limits, float]:
        """Return the limits extended to fill a panel, and the panel's ratio of height to width.

        The ratio is that of the limits, clipped to the range from `flattest` to `tallest`.
        """
        aspect = float(np.clip((self.top - self.bottom) / (self.right - self.left), flattest, tallest))
        return self.fitted(1.0 / aspect), aspect

    def fitted(self, ratio: float) -> Limits:
        """Return the limits extended to a panel with this ratio of width to height."""
        width, height = self.right - self.left, self.top - self.bottom
        wide, high = max(ratio * height - width, 0.0) / 2.0, max(width / ratio - height, 0.0) / 2.0
        return Limits(self.left - wide, self.right + wide, self.bottom - high, self.top + high)


@dataclass(frozen=True)
class DrawnJoint(Brief):
    """Joint at the f times of a scene.

    Attributes
    ----------
    name, kind : str
        Name of the joint, and name of its symbol.
    grounded : bool
        Whether the joint is on the ground.
    place : (f, 2) array
        Positions [m].
    direction : (f,) array
        Directions of the joint's axis [rad]; NaN without an axis.
    driven : bool
        Whether a motor acts at the joint.
    rail : (f, 2) array, optional
        Point of the moving body that carries the axis [m]; None if the ground carries it or a beam is the axis. For a
        rod it is the other end.
    """

    name: str
    kind: str
    grounded: bool
    place: Array
    direction: Array
    driven: bool = False
    rail: Array | None = None

    @property
    def slides(self) -> bool:
        """Whether the joint has an axis."""
        return bool(np.isfinite(self.direction).all())


class DrawnGear(NamedTuple):
    """Gear or similar member at f times: pitch circles and lines (f, n, 2), or a line from joint to joint."""

    name: str
    lines: tuple[Array, ...]


class DrawnLoad(NamedTuple):
    """Load at f times: its position (f, 2), force (f, 2) and torque (f,), the latter relative to the run's largest."""

    name: str
    place: Array
    force: Array
    torque: Array


@dataclass(frozen=True)
class Scene(Brief):
    """Description of a run at the f times of its pictures.

    Attributes
    ----------
    mechanism, mode : str
        Names of the mechanism and of the actuation mode; the latter is empty if there is none.
    time : (f,) array
        Times of the pictures [s].
    magnified : float
        Magnification of deflections.
    bodies : mapping of str to (f, s, 2) array
        Stations of each body with magnified deflections [m].
    stiff : mapping of str to (f, s, 2) array
        Stations of each body without deflection between joints [m]; empty if the magnification is 1.
    joints : tuple of DrawnJoint
        Joints.
    springs : mapping of str to (f, 2, 2) array
        Both ends of each spring [m].
    gears : tuple of DrawnGear
        Gears and similar members.
    anchors : tuple of (2,) arrays
        Points at which springs are attached to the ground [m].
    followed : tuple of int
        Indices of the stations whose trails are drawn, among the stations of all bodies.
    trails : tuple of (f, 2) arrays
        Paths of these stations, by default of the end-effector [m].
    desired : (d, 2) array or None
        Entire desired path of the end-effector [m].
    reached : float
        Time at which the run ended [s]; later pictures repeat the last state.
    limits : Limits
        Limits of the picture.
    loads : tuple of DrawnLoad
        Loads.
    load_keys : mapping of str to str
        Texts beside the key arrows of the largest "force" and "torque", if there are such loads.
    """

    mechanism: str
    mode: str
    time: Array
    magnified: float
    bodies: dict[str, Array]
    stiff: dict[str, Array]
    joints: tuple[DrawnJoint, ...]
    springs: dict[str, Array]
    gears: tuple[DrawnGear, ...]
    anchors: tuple[Array, ...]
    followed: tuple[int, ...]
    trails: tuple[Array, ...]
    desired: Array | None
    reached: float
    limits: Limits
    loads: tuple[DrawnLoad, ...] = ()
    load_keys: Mapping[str, str] = field(default_factory=dict)


def run_times(data: xr.Dataset) -> tuple[float, float]:
    """Return the first time of a run and the last time reached by any of its modes [s]."""
    check_shapes(data)
    kept = np.isfinite(data["shape"].values[..., 0, 0]).reshape(-1, data.sizes["time"]).any(axis=0)
    time = data["time"].values
    return float(time[0]), float(time[np.flatnonzero(kept)[-1]]) if kept.any() else float(time[0])


def check_shapes(data: xr.Dataset) -> None:
    """Check that results have the shapes that drawings need; raise InputError otherwise."""
    from paraflex.results.kinds import kind_of

    RESULT_KINDS[kind_of(data)].refuse("motion", "results")
    if "shape" not in data:
        raise InputError(
            "these results hold no shapes of links: they are of an earlier version", field="results",
            remedy="run the study again",
        )  # fmt: skip


def select(data: xr.Dataset, mode: str | None, model: str | None = None) -> xr.Dataset:
    """Select one run by its mode (default the first) and by its model (default the reference), where these exist."""
    check_shapes(data)
    if "model" in data.dims:
        names = names_of(data, "model")
        model = str(data.attrs.get("reference", names[0])) if model is None else model
        if model not in names:
            raise InputError(
                "no such model in these results", field="model", value=model, remedy=suggestion(model, names)
            )
        data = data.isel(model=names.index(model))
    elif model is not None:
        raise InputError("these results are of one model", field="model", value=model, remedy="leave it out")
    if "mode" in data.dims:
        return select_run(data, str(data["mode"].values[0]) if mode is None else mode)
    if mode is not None:
        raise InputError("this run has no modes", field="mode", value=mode, remedy="leave it out")
    return data


def scene(run: Run, times: Array, magnify: float = 1.0, points: Sequence[str] = ()) -> Scene:
    """Describe a run at given times with magnified deflections.

    Parameters
    ----------
    run : xarray.Dataset or DrawnRun
        Single run, from `select`, or a drawing.
    times : (f,) array
        Times of the pictures [s]; after the end of a run its last state is repeated.
    magnify : float
        Magnification of deflections: 1 (default) draws them as they are, 0 draws undeformed links.
    points : sequence of str
        Points "body.point" whose trails are drawn; see `followed_stations` for the default.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        The magnification is negative or not finite, the run has no sample, or there is no such point.
    """
    if not (np.isfinite(magnify) and magnify >= 0.0):
        problem = "must not be negative" if magnify < 0.0 else "not a finite number"
        raise InputError(problem, field="magnify", value=magnify, remedy="1 is the actual deflection, 50 magnifies it")
    kept = np.isfinite(run["shape"].values).any(axis=(1, 2))
    samples = int(np.argmin(kept)) if not kept.all() else kept.size
    if not samples:
        raise InputError("this run has no sample", field="results", remedy="choose another mode")
    desired = run["end_effector_desired"].values if "end_effector_desired" in run else None
    run = run.isel(time=slice(samples))
    shape, base = run["shape"].values.astype(float), run["shape_base"].values.astype(float)
    drawn = shape if magnify == 1.0 else base + magnify * (shape - base)
    time, times = run["time"].values, np.asarray(times, dtype=float)
    at = _Sampler(time, times)
    owners = run["station_body"].values
    bodies = {str(name): owners == name for name in dict.fromkeys(owners.tolist())}
    places, directions = (_magnified_joints(run, name, magnify) for name in ("joint_position", "joint_direction"))
    joints = _joints(run, drawn, places, directions, at)
    springs, followed = _springs(run, drawn), followed_stations(run, points)
    seen = [drawn, places, *springs.values(), *([] if desired is None else [desired])]
    seen += [line for gear in _gears(run, places, directions) for line in gear.lines]
    loads = _loads(run, drawn, time, times, at)
    reach = np.concatenate([one.reshape(-1, 2) for one in seen])
    # The limits include the tails of the arrows of forces.
    size = limits_of(reach).size
    reach = np.concatenate([reach, *(load.place - ARROW * size * load.force for load in loads)])
    return Scene(
        mechanism=printable(str(run.attrs["mechanism"])),
        mode=str(run["mode"].values) if "mode" in run.coords else "",
        time=times,
        magnified=magnify,
        bodies={name: at(drawn[:, own]) for name, own in bodies.items()},
        stiff={} if magnify == 1.0 else {name: at(figure_of(base[:, own])) for name, own in bodies.items()},
        joints=joints,
        springs={name: at(ends) for name, ends in springs.items()},
        gears=_gears(run, at(places), at(directions)),
        anchors=_anchors(run),
        followed=followed,
        trails=tuple(at(drawn[:, one]) for one in followed),
        desired=desired,
        reached=float(time[-1]),
        limits=limits_of(_with_rails(reach, joints)),
        loads=loads,
        load_keys=_load_keys(run),
    )


def _magnified_joints(run: Run, name: str, magnify: float) -> Array:
    """Return positions or directions of joints, magnified like the bodies; those of older results are unchanged."""
    values = run[name].values.astype(float)
    base = JOINT_BASES[name]
    return values + (magnify - 1.0) * (values - run[base].values.astype(float)) if base in run else values


def _joints(
    run: Run, drawn: Array, places: Array, directions: Array, at: Callable[[Array], Array]
) -> tuple[DrawnJoint, ...]:
    """Return the joints of a run; results of earlier versions have no data on motors and rails on moving bodies."""
    names = run["joint"].values
    count = len(names)
    driven = run["joint_driven"].values if "joint_driven" in run else np.zeros(count, dtype=bool)
    rails = run["joint_rail"].values if "joint_rail" in run else np.full(count, -1)
    return tuple(
        DrawnJoint(
            str(names[i]), str(run["joint_kind"].values[i]), bool(run["joint_grounded"].values[i]),
            at(places[:, i]), at(directions[:, i]), bool(driven[i]),
            at(drawn[:, int(rails[i])]) if rails[i] >= 0 else None,
        )
        for i in range(count)
    )  # fmt: skip


def default_magnification(runs: Sequence[Run]) -> float:
    """Return the largest of MAGNIFICATIONS at which no deflection exceeds 8 % of the mechanism's size.

    It is 1 if there is none, or if deflections remain invisible (below 0.5 %) at the largest magnification.
    """
    bent, size = 0.0, 0.0
    for run in runs:
        shape, base = (run[name].values.reshape(-1, 2).astype(float) for name in ("shape", "shape_base"))
        known = np.isfinite(shape).all(axis=1) & np.isfinite(base).all(axis=1)
        if known.any():
            bent = max(bent, float(np.max(np.linalg.norm((shape - base)[known], axis=1))))
            size = max(size, float(np.max(np.ptp(base[known], axis=0))))
    if MAGNIFICATIONS[-1] * bent <= _UNSEEN_BENDING * size:
        return 1.0
    return max((one for one in MAGNIFICATIONS if one * bent <= _SHOWN_BENDING * size), default=1.0)


class _Sampler:
    """Linear interpolation between samples, constant beyond the first and the last."""

    def __init__(self, time: Array, times: Array) -> None:
        self.first = np.clip(np.searchsorted(time, times, side="right") - 1, 0, max(time.size - 2, 0))
        self.last = np.minimum(self.first + 1, time.size - 1)
        gap = np.where(self.last > self.first, time[self.last] - time[self.first], 1.0)
        self.part = np.clip((times - time[self.first]) / gap, 0.0, 1.0)

    def __call__(self, values: Array) -> Array:
        part = self.part.reshape(-1, *[1] * (values.ndim - 1))
        return (1.0 - part) * values[self.first] + part * values[self.last]


def followed_stations(run: Run, given: Sequence[str] = ()) -> tuple[int, ...]:
    """Return the stations whose trails are drawn: those of given points, by default the end-effector.

    Without an end-effector they are the points whose coupler curves kinematics describes, or else the point with the
    longest path, free points before joints; none if nothing moves.
    """
    points = names_of(run, "point")
    stations = run["point_station"].values
    effector = run.attrs.get("end_effector_point")
    if not given and effector in points:
        given = [effector]
    elif not given and "kinematics" in run.attrs:
        from paraflex.figures.kinematics import coupler_points  # imports xarray, which drawings need not have

        given = coupler_points(run.attrs)
    if given:
        return tuple(int(stations[point_number(run, point)]) for point in given)
    shape, joints = run["shape"].values.astype(float), run["joint_position"].values.astype(float)
    ways, free = {}, []
    for station in stations.tolist():
        place = shape[:, station]
        apart = np.linalg.norm(joints - place[:, None], axis=-1)
        ways[station] = float(np.sum(np.linalg.norm(np.diff(place, axis=0), axis=-1)))
        if not (joints.size and np.min(np.max(apart, axis=0)) < _STILL_POINT):
            free.append(station)
    for chosen in (free, [*ways]):
        farthest = max(chosen, key=lambda station: ways[station], default=None)
        if farthest is not None and ways[farthest] >= _STILL_POINT:
            return (farthest,)
    return ()


def _anchors(run: Run) -> tuple[Array, ...]:
    if "spring_position" not in run:
        return ()
    first = run["spring_position"].values[0].astype(float)
    return tuple(first[i, end] for i, end in zip(*np.nonzero(run["spring_station"].values < 0), strict=True))


def _springs(run: Run, drawn: Array) -> dict[str, Array]:
    if "spring_position" not in run:
        return {}
    places = run["spring_position"].values.astype(float)
    for i, end in zip(*np.nonzero(run["spring_station"].values >= 0), strict=True):
        places[:, i, end] = drawn[:, int(run["spring_station"].values[i, end])]
    return {str(name): places[:, i] for i, name in enumerate(run["spring"].values)}


def _gears(run: Run, joints: Array, directions: Array) -> tuple[DrawnGear, ...]:
    """Return the gears between joints with given positions (f, joints, 2) and directions (f, joints)."""
    if "gear_joint" not in run:
        return ()
    names, related = run["gear"].values, run["gear_joint"].values.astype(int)
    return tuple(
        DrawnGear(str(name), pitch_lines(joints[:, held], directions[:, held], radii))
        for name, held, radii in zip(names, related, run["gear_radius"].values, strict=True)
    )


def _loads(run: Run, drawn: Array, time: Array, times: Array, at: Callable[[Array], Array]) -> tuple[DrawnLoad, ...]:
    """Return the loads of a run relative to its largest force and torque; results of earlier versions have none."""
    if "load_force" not in run:
        return ()
    force, torque = np.nan_to_num(run["load_force"].values), np.nan_to_num(run["load_torque"].values)[..., None]
    parts = [part / (np.max(np.linalg.norm(part, axis=-1)) or 1.0) for part in (force, torque)]
    shares = _strongest(np.concatenate(parts, axis=-1), time, times, at)
    stations = run["load_station"].values
    return tuple(
        DrawnLoad(str(name), at(drawn[:, int(stations[k])]), shares[:, k, :2], shares[:, k, 2])
        for k, name in enumerate(run["load"].values)
    )


def _strongest(values: Array, time: Array, times: Array, at: Callable[[Array], Array]) -> Array:
    """Return values (k, n, c) at the times of the pictures, the largest of the samples nearest to each picture.

    An impulse between two pictures is thus visible in one of them.
    """
    out = at(values)
    nearest = np.searchsorted(0.5 * (times[1:] + times[:-1]), time)
    inside = np.flatnonzero((time >= times[0]) & (time <= times[-1]))
    sizes = np.linalg.norm(values, axis=-1)
    for n in range(values.shape[1]):
        # Samples are written in ascending order, so that the largest one of each picture remains.
        ascending = inside[np.argsort(sizes[inside, n], kind="stable")]
        largest = out[:, n].copy()
        largest[nearest[ascending]] = values[ascending, n]
        more = np.linalg.norm(largest, axis=-1) > np.linalg.norm(out[:, n], axis=-1)
        out[more, n] = largest[more]
    return out


def _load_keys(run: Run) -> dict[str, str]:
    """Return the texts that state the magnitudes of the largest "force" and "torque", if there are such loads."""
    if "load_force" not in run:
        return {}
    keys = {}
    names = names_of(run, "load")
    for kind, unit in (("force", "N"), ("torque", "N m")):
        values = np.nan_to_num(run[f"load_{kind}"].values)
        sizes = np.max(np.linalg.norm(values, axis=-1) if kind == "force" else np.abs(values), axis=0)
        acting = np.flatnonzero(sizes)
        if acting.size:
            name = f"load {names[acting[0]]}" if acting.size == 1 else "loads"
            keys[kind] = f"{name}: {quantity(float(sizes.max()), unit, digits=4, padded=False)}"
    return keys


def pitch_lines(ends: Array, directions: Array, radii: Array) -> tuple[Array, ...]:
    """Return pitch circles (f, n, 2) of wheels and pitch lines of racks; if a radius is NaN, a line between the joints.

    Parameters
    ----------
    ends, directions : (f, 2, 2) and (f, 2) arrays
        Positions [m] and directions [rad] of the two joints.
    radii : (2,) array
        Pitch radii [m], infinite for a rack, see `results.drawing.pitch_radii`.
    """
    if np.isnan(radii).any():
        return (ends,)
    angle = np.linspace(0.0, 2.0 * np.pi, _CIRCLE)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    circles = [ends[:, end, None] + radii[end] * rim for end in range(2) if np.isfinite(radii[end])]
    return (*circles, *(_pitch_line(ends, directions, radii, end) for end in range(2) if np.isinf(radii[end])))


def _pitch_line(ends: Array, directions: Array, radii: Array, rack: int) -> Array:
    """Return the pitch line (f, 2, 2) of a rack, beyond the contact with the pinion and up to the rack's joint."""
    along = np.stack([np.cos(directions[:, rack]), np.sin(directions[:, rack])], axis=-1)
    right, radius = along[:, ::-1] * [1.0, -1.0], radii[1 - rack]
    touching = ends[:, 1 - rack] + np.sign(radii[rack]) * radius * right
    reach = np.sum((ends[:, rack] - touching) * along, axis=-1)
    first, last = np.minimum(reach, -radius), np.maximum(reach, radius)
    return touching[:, None] + np.stack([first, last], axis=1)[..., None] * along[:, None]


def _with_rails(places: Array, joints: tuple[DrawnJoint, ...]) -> Array:
    """Return positions together with the ends of the joints' rails."""
    size = limits_of(places).size
    rails = [
        joint.place + sign * 1.2 * BLOCK[0] * size * np.column_stack([np.cos(joint.direction), np.sin(joint.direction)])
        for joint in joints
        if joint.slides
        for sign in (1.0, -1.0)
    ]
    return np.concatenate([places, *rails])


def limits_of(places: Array) -> Limits:
    """Return limits that contain all finite positions, with a margin; far outliers are cut off."""
    places = places[np.isfinite(places).all(axis=1)]
    # A diverging run must not determine the limits.
    usual = np.percentile(places, _RUN_SHARES, axis=0)
    far = np.max(np.ptp(usual, axis=0))
    low, high = np.maximum(places.min(axis=0), usual[0] - far), np.minimum(places.max(axis=0), usual[1] + far)
    size = float(np.max(high - low)) or 1.0
    room = _MARGIN * size
    # Room for ground symbols below, and a minimum width and height for flat mechanisms.
    low, high = low - room, high + room
    for axis, least in ((0, 0.5), (1, 0.4)):
        lacking = max(least * size - float(high[axis] - low[axis]), 0.0)
        low[axis] -= 0.5 * lacking
        high[axis] += 0.5 * lacking
    return Limits(float(low[0]), float(high[0]), float(low[1]), float(high[1]))


def common_limits(scenes: list[Scene]) -> Limits:
    """Return limits that contain several scenes."""
    left, right, bottom, top = np.array([one.limits for one in scenes]).T
    return Limits(float(left.min()), float(right.max()), float(bottom.min()), float(top.max()))


def is_plate(places: Array) -> bool:
    """Return whether the stations (s, 2) from `figure_of` form a closed figure."""
    return len(places) > 3 and bool(np.all(places[0] == places[-1]))


def scale_bar(limits: Limits) -> tuple[float, str]:
    """Return a round length [m] for the scale bar of a picture, and its text."""
    most = _SCALE_BAR * (limits.right - limits.left)
    power = 10.0 ** np.floor(np.log10(most))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))
    if length >= 1.0:
        return length, f"{length:g} m"
    unit = display_unit("m", length)
    return length, f"{round(length * unit.factor, 6):g} {unit.name}"
