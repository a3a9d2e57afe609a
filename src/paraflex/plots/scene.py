"""What a picture of a mechanism consists of, in metres: links, joints, ground, springs and paths at given times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.errors import InputError, suggestion
from paraflex.plots.labels import display_unit
from paraflex.plots.runs import select_run

Array = NDArray[np.float64]

# Sizes of symbols as parts of the picture's larger side.
PIN, TRIANGLE, BLOCK, RAIL = 0.008, 0.028, (0.034, 0.022), 0.02
_MARGIN = 0.07
_TEETH = 14
# Shares of the width that a scale bar may take.
_BAR = 0.28
# A joint that moves by less than this part of the picture stays where it is.
_STILL = 1e-3


class Limits(NamedTuple):
    """What a picture shows [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def size(self) -> float:
        """The larger side."""
        return max(self.right - self.left, self.top - self.bottom)

    def fitted(self, ratio: float) -> Limits:
        """As much more to either side as a panel of that width by height shows."""
        width, height = self.right - self.left, self.top - self.bottom
        wide, high = max(ratio * height - width, 0.0) / 2.0, max(width / ratio - height, 0.0) / 2.0
        return Limits(self.left - wide, self.right + wide, self.bottom - high, self.top + high)


@dataclass(frozen=True)
class Joint:
    """A joint at the f times of a scene: its kind, whether it is on the ground, places (f, 2), directions (f,)."""

    name: str
    kind: str
    grounded: bool
    place: Array
    direction: Array

    @property
    def slides(self) -> bool:
        """Whether it has an axis."""
        return bool(np.isfinite(self.direction).all())


@dataclass(frozen=True)
class Scene:
    """A run in pictures, at f times.

    Attributes
    ----------
    mechanism, mode : str
        The mode is empty where there is none.
    time : (f,) array
        [s]
    magnified : float
        How many times deflections are drawn.
    bodies : mapping of str to (f, s, 2) array
        Deflections magnified [m].
    stiff : mapping of str to (f, s, 2) array
        The same drawn stiff between joints; empty where nothing is magnified.
    joints : tuple of Joint
    springs : tuple of (f, 2, 2) arrays
        Both ends.
    anchors : tuple of (2,) arrays
        Where springs hang on the ground.
    trail : (f, 2) array or None
        Of the end-effector.
    desired : (d, 2) array or None
        The whole path it should follow.
    reached : float
        When the run ended; later pictures hold its last one [s].
    limits : Limits
    """

    mechanism: str
    mode: str
    time: Array
    magnified: float
    bodies: dict[str, Array]
    stiff: dict[str, Array]
    joints: tuple[Joint, ...]
    springs: tuple[Array, ...]
    anchors: tuple[Array, ...]
    trail: Array | None
    desired: Array | None
    reached: float
    limits: Limits


def run_times(data: xr.Dataset) -> tuple[float, float]:
    """First time of a run and the last that any of its modes reached [s].

    Raises
    ------
    InputError
        The results hold no shapes.
    """
    check_shapes(data)
    kept = np.isfinite(data["shape"].values[..., 0, 0]).reshape(-1, data.sizes["time"]).any(axis=0)
    time = data["time"].values
    return float(time[0]), float(time[np.flatnonzero(kept)[-1]]) if kept.any() else float(time[0])


def check_shapes(data: xr.Dataset) -> None:
    """Nothing, if results hold what drawings are made from.

    Raises
    ------
    InputError
        They do not.
    """
    if "shape" not in data:
        raise InputError(
            "these results hold no shapes of links: they are of an earlier version", field="results",
            remedy="run the study again",
        )  # fmt: skip


def select(data: xr.Dataset, mode: str | None, model: str | None = None) -> xr.Dataset:
    """One run: of a mode where there are modes, of a model where there are models (by default the reference).

    Raises
    ------
    InputError
        No such mode or model; or the results hold no shapes.
    """
    check_shapes(data)
    if "model" in data.dims:
        names = [str(name) for name in data["model"].values]
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


def scene(run: xr.Dataset, times: Array, magnify: float = 1.0) -> Scene:
    """A run at given times, deflections magnified.

    Parameters
    ----------
    run : xarray.Dataset
        From `select`.
    times : (f,) array
        [s]; after the end of a run that stopped its last picture is held.
    magnify : float
        1 is the truth, 0 draws links stiff.

    Raises
    ------
    InputError
        A magnification that is negative or not finite; a run that has no sample.
    """
    if not (np.isfinite(magnify) and magnify >= 0.0):
        raise InputError("must not be negative", field="magnify", value=magnify, remedy="1 is the truth, 50 shows more")
    shape, base = run["shape"].values.astype(float), run["shape_base"].values.astype(float)
    kept = np.isfinite(shape).all(axis=(1, 2))
    samples = int(np.argmin(kept)) if not kept.all() else kept.size
    if not samples:
        raise InputError("this run has no sample", field="results", remedy="choose another mode")
    time = run["time"].values[:samples]
    drawn = base + magnify * (shape - base)
    at = _Sampler(time, np.asarray(times, dtype=float))
    owners = run["station_body"].values
    bodies = {str(name): drawn[:samples, owners == name] for name in dict.fromkeys(owners.tolist())}
    stiff = {} if magnify == 1.0 else {name: base[:samples, owners == name] for name in bodies}
    joints = tuple(
        Joint(
            str(name),
            str(run["joint_kind"].values[i]),
            bool(run["joint_grounded"].values[i]),
            at(run["joint_position"].values[:samples, i].astype(float)),
            at(run["joint_direction"].values[:samples, i].astype(float)),
        )
        for i, name in enumerate(run["joint"].values)
    )
    trail = _trail(run, drawn)
    desired = run["end_effector_desired"].values if "end_effector_desired" in run else None
    joint_places = run["joint_position"].values[:samples].reshape(-1, 2)
    seen = [drawn[:samples].reshape(-1, 2), joint_places, *([] if desired is None else [desired]), *_anchors(run)]
    seen = [places.reshape(-1, 2) for places in seen]
    return Scene(
        mechanism=str(run.attrs["mechanism"]),
        mode=str(run["mode"].item()) if "mode" in run.coords else "",
        time=np.asarray(times, dtype=float),
        magnified=magnify,
        bodies={name: at(places) for name, places in bodies.items()},
        stiff={name: at(places) for name, places in stiff.items()},
        joints=joints,
        springs=_springs(run, drawn[:samples], at),
        anchors=_anchors(run),
        trail=None if trail is None else at(trail[:samples]),
        desired=desired,
        reached=float(time[-1]),
        limits=_limits(_with_rails(np.concatenate(seen), joints)),
    )


class _Sampler:
    """Values between samples, linearly; held beyond the last."""

    def __init__(self, time: Array, times: Array) -> None:
        self.first = np.clip(np.searchsorted(time, times, side="right") - 1, 0, max(time.size - 2, 0))
        self.last = np.minimum(self.first + 1, time.size - 1)
        gap = np.where(self.last > self.first, time[self.last] - time[self.first], 1.0)
        self.part = np.clip((times - time[self.first]) / gap, 0.0, 1.0)

    def __call__(self, values: Array) -> Array:
        part = self.part.reshape(-1, *[1] * (values.ndim - 1))
        return (1.0 - part) * values[self.first] + part * values[self.last]


def _trail(run: xr.Dataset, drawn: Array) -> Array | None:
    """Where the end-effector is drawn; of a single body without one, its last station."""
    points = [str(name) for name in run["point"].values]
    followed = run.attrs.get("end_effector_point")
    if followed in points:
        return drawn[:, int(run["point_station"].values[points.index(followed)])]
    return drawn[:, -1] if run.sizes["body"] == 1 else None


def _anchors(run: xr.Dataset) -> tuple[Array, ...]:
    if "spring_position" not in run:
        return ()
    first = run["spring_position"].values[0].astype(float)
    return tuple(first[i, end] for i, end in zip(*np.nonzero(run["spring_station"].values < 0), strict=True))


def _springs(run: xr.Dataset, drawn: Array, at: _Sampler) -> tuple[Array, ...]:
    if "spring_position" not in run:
        return ()
    places = run["spring_position"].values[: len(drawn)].astype(float)
    for i, stations in enumerate(run["spring_station"].values):
        for end, station in enumerate(stations):
            if station >= 0:
                places[:, i, end] = drawn[:, station]
    return tuple(at(places[:, i]) for i in range(places.shape[1]))


def _with_rails(places: Array, joints: tuple[Joint, ...]) -> Array:
    """Places, and where the rails of joints end."""
    size = _limits(places).size
    rails = [
        joint.place + sign * 1.2 * BLOCK[0] * size * np.column_stack([np.cos(joint.direction), np.sin(joint.direction)])
        for joint in joints
        if joint.slides
        for sign in (1.0, -1.0)
    ]
    return np.concatenate([places, *rails])


def _limits(places: Array) -> Limits:
    places = places[np.isfinite(places).all(axis=1)]
    low, high = places.min(axis=0), places.max(axis=0)
    size = float(np.max(high - low)) or 1.0
    room = _MARGIN * size
    # Ground symbols hang below; a flat mechanism is not drawn in a slit.
    low, high = low - room, high + room
    for axis, least in ((0, 0.5), (1, 0.4)):
        lacking = max(least * size - float(high[axis] - low[axis]), 0.0)
        low[axis] -= 0.5 * lacking
        high[axis] += 0.5 * lacking
    return Limits(float(low[0]), float(high[0]), float(low[1]), float(high[1]))


def common_limits(scenes: list[Scene]) -> Limits:
    """What shows all of several scenes."""
    left, right, bottom, top = np.array([one.limits for one in scenes]).T
    return Limits(float(left.min()), float(right.max()), float(bottom.min()), float(top.max()))


# --- Symbols ---------------------------------------------------------------------------------------------------------


def is_guide(joint: Joint, limits: Limits) -> bool:
    """Whether what slides goes through a block that stays, instead of a block along a rail."""
    return bool(np.max(np.ptp(joint.place, axis=0)) <= _STILL * limits.size)


def triangle(place: Array, limits: Limits) -> Array:
    """A support under a place, closed (4, 2)."""
    d = TRIANGLE * limits.size
    return place + d * np.array([[0.0, 0.0], [-0.6, -1.0], [0.6, -1.0], [0.0, 0.0]])


def hatching(start: Array, end: Array, limits: Limits) -> Array:
    """Strokes (n, 2, 2) of ground on the right of a line from start to end."""
    d = 0.45 * RAIL * limits.size
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    count = max(3, round(length / d))
    feet = start + np.outer((np.arange(count) + 0.6) / count * length, along)
    return np.stack([feet, feet + d * (across - 0.7 * along)], axis=1)


def support(place: Array, limits: Limits) -> tuple[list[Array], Array]:
    """Lines of a support under a place, and the hatching (n, 2, 2) of its ground."""
    held, wide = triangle(place, limits), 0.35 * TRIANGLE * limits.size
    base = np.array([held[1] - [wide, 0.0], held[2] + [wide, 0.0]])
    return [held, base], hatching(base[0], base[1], limits)


def ground_of(joint: Joint, limits: Limits) -> tuple[list[Array], Array]:
    """Lines of a joint's ground, and its hatching (n, 2, 2)."""
    size = limits.size
    if joint.slides and not is_guide(joint, limits):
        along = np.array([np.cos(joint.direction[0]), np.sin(joint.direction[0])])
        middle = joint.place[0]
        reach = (joint.place - middle) @ along
        beyond = 1.2 * BLOCK[0] * size
        across = np.array([along[1], -along[0]])
        across = across if across[1] < 0.0 or (across[1] == 0.0 and across[0] > 0.0) else -across
        foot = middle + 0.5 * BLOCK[1] * size * across
        ends = [foot + (reach.min() - beyond) * along, foot + (reach.max() + beyond) * along]
        # Strokes on the side that the block is not on.
        if np.dot(np.array([along[1], -along[0]]), across) < 0.0:
            ends.reverse()
        return [np.array(ends)], hatching(ends[0], ends[1], limits)
    return support(joint.place[0], limits)


def block(joint: Joint, limits: Limits) -> Array:
    """Corners (f, 5, 2) of what slides, or of the guide it slides through."""
    a, b = 0.5 * np.array(BLOCK) * limits.size
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]])
    c, s = np.cos(joint.direction)[:, None], np.sin(joint.direction)[:, None]
    x, y = corners.T
    return joint.place[:, None] + np.stack([c * x - s * y, s * x + c * y], axis=-1)


def square(place: Array, limits: Limits) -> Array:
    """Corners (f, 5, 2) of a weld."""
    d = 0.9 * PIN * limits.size
    return place[:, None] + d * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])


def zigzag(ends: Array, limits: Limits) -> Array:
    """A spring (f, n, 2) between two ends (f, 2, 2)."""
    a, b = ends[:, 0], ends[:, 1]
    d = b - a
    length = np.linalg.norm(d, axis=1, keepdims=True)
    across = np.stack([-d[:, 1], d[:, 0]], axis=1) / np.where(length > 0.0, length, 1.0)
    along = np.concatenate([[0.0, 0.12], np.linspace(0.14, 0.86, _TEETH), [0.88, 1.0]])
    swing = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], _TEETH // 2), [0.0, 0.0]])
    swing = 0.4 * TRIANGLE * limits.size * swing
    return a[:, None] + along[:, None] * d[:, None] + swing[:, None] * across[:, None]


def figure_of(places: Array) -> Array:
    """The stations (s, 2) of a body that are joined by lines: of a closed figure, up to where it closes."""
    back = np.flatnonzero(np.all(places[1:] == places[0], axis=1))
    return places[: back[0] + 2] if back.size and back[0] > 1 else places


def scale_bar(limits: Limits) -> tuple[float, str]:
    """A round length that fits into the picture [m], and its name."""
    most = _BAR * (limits.right - limits.left)
    power = 10.0 ** np.floor(np.log10(most))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))
    if length >= 1.0:
        return length, f"{length:g} m"
    unit = display_unit("m", length)
    return length, f"{round(length * unit.factor, 6):g} {unit.name}"
