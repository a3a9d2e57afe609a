"""The animation: where bodies and joints are in some hundred frames of every run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from paraflex.report.packing import packed

MOST_FRAMES = 350
_SHAPES = ("shape", "shape_base", "joint_position", "joint_direction")
NO_SHAPES = (
    "These results do not hold the shapes of the links: they are of an earlier version. "
    "Run the study again to see the mechanism move."
)


@dataclass(frozen=True)
class Film:
    """Frames of all runs; drawn magnified by m, a body is at `base + m (shape - base)`.

    Attributes
    ----------
    time : (frames,) array
        [s]
    shape, base : (runs, frames, stations, 2) arrays
        Drawn points of all bodies, and where they were if nothing bent [m].
    bodies : sequence of (str, int, int)
        Name, first station and the one after the last.
    joints : (runs, frames, joints, 2) array
        [m]
    directions : (runs, frames, joints, 2) array
        Unit vectors along which joints slide; NaN for those that do not.
    springs : (runs, frames, springs, 2, 2) array, optional
        Both ends of springs between points [m].
    joint_names, joint_kinds : sequence of str
    grounded : sequence of bool
        Joints with the ground.
    tip : (runs, frames, 2) array, optional
        The end-effector, or another point whose trail is drawn [m].
    path : (samples, 2) or (runs, samples, 2) array, optional
        Where it should go [m], in all runs or in each.
    """

    time: NDArray[np.float64]
    shape: NDArray[np.float64]
    base: NDArray[np.float64]
    bodies: Sequence[tuple[str, int, int]]
    joints: NDArray[np.float64]
    directions: NDArray[np.float64]
    joint_names: Sequence[str]
    joint_kinds: Sequence[str]
    grounded: Sequence[bool]
    springs: NDArray[np.float64] | None = None
    tip: NDArray[np.float64] | None = None
    path: NDArray[np.float64] | None = None

    def told(self) -> dict[str, Any]:
        """The film as JSON holds it."""
        return {
            "time": self.time.tolist(),
            "base": packed(self.base),
            "bend": packed(self.shape - self.base),
            "bodies": [list(body) for body in self.bodies],
            "joints": packed(self.joints),
            "directions": packed(self.directions),
            "springs": None if self.springs is None else packed(self.springs),
            "jointNames": list(self.joint_names),
            "jointKinds": list(self.joint_kinds),
            "grounded": [bool(one) for one in self.grounded],
            "tip": None if self.tip is None else packed(self.tip),
            "path": None if self.path is None else packed(self.path.reshape(-1, *self.path.shape[-2:])),
            "view": _view(self.shape, self.joints, self.path, self.springs),
        }


def film(data: xr.Dataset, dims: Sequence[str] = ("mode",)) -> Film | None:
    """The film of a dataset whose runs lie along these dimensions; None where it holds no shapes."""
    if any(name not in data for name in _SHAPES):
        return None
    time = data["time"].values
    kept = frames_of(time.size)
    shape, base, joints, angles = (_runs(data[name].isel(time=kept), dims) for name in _SHAPES)
    springs = _runs(data["spring_position"].isel(time=kept), dims) if "spring_position" in data else None
    followed = data["end_effector"] if "end_effector" in data else _free_point(data)
    tip = None if followed is None else _runs(followed.isel(time=kept), dims)
    path = None
    if "end_effector_desired" in data:
        path = _runs(data["end_effector_desired"], dims)
        path = path[:, frames_of(path.shape[1], 2 * MOST_FRAMES)]
        path = path[0] if all(np.array_equal(path[0], each) for each in path) else path
    names = [str(name) for name in data["joint"].values]
    return Film(
        time=time[kept],
        shape=shape,
        base=base,
        bodies=_bodies(data["station_body"].values),
        joints=joints,
        directions=np.stack([np.cos(angles), np.sin(angles)], axis=-1),
        springs=springs,
        joint_names=names,
        joint_kinds=[str(kind) for kind in data["joint_kind"].values],
        grounded=[bool(one) for one in data["joint_grounded"].values],
        tip=tip,
        path=path,
    )


def frames_of(samples: int, most: int = MOST_FRAMES) -> NDArray[np.intp]:
    """Indices of at most so many samples, the first and the last among them."""
    return np.unique(np.rint(np.linspace(0, samples - 1, min(samples, most))).astype(np.intp))


def _runs(values: xr.DataArray, dims: Sequence[str]) -> NDArray[np.float64]:
    """Values (runs, ...): the dimensions of runs as one, which a single run does not have."""
    rest = [dim for dim in values.dims if dim not in dims]
    array = np.asarray(values.transpose(*dims, *rest).values, dtype=float)
    return array.reshape(-1, *array.shape[len(dims) :])


def _free_point(data: xr.Dataset) -> xr.DataArray | None:
    """The end-effector's point, or else the one at no joint that goes farthest; None where there is none."""
    places = data["point_position"].transpose("point", "time", "axis")
    names = [str(name) for name in data["point"].values]
    if data.attrs.get("end_effector_point") in names:
        return places.isel(point=names.index(data.attrs["end_effector_point"]))
    joints = data["joint_position"].transpose("joint", "time", "axis").values.astype(float)
    travelled = []
    for place in places.values:
        apart = np.linalg.norm(joints - place, axis=-1)
        held = bool((np.nanmax(apart, axis=1, initial=0.0) < 1e-6).any()) if len(apart) else False
        way = np.nansum(np.linalg.norm(np.diff(place, axis=0), axis=-1))
        travelled.append(0.0 if held else float(way))
    if not travelled or max(travelled) < 1e-6:
        return None
    return places.isel(point=int(np.argmax(travelled)))


def _bodies(station_body: ArrayLike) -> list[tuple[str, int, int]]:
    names = [str(name) for name in np.asarray(station_body)]
    starts = [k for k, name in enumerate(names) if k == 0 or name != names[k - 1]]
    return [(names[a], a, b) for a, b in zip(starts, [*starts[1:], len(names)], strict=True)]


def _view(*places: NDArray[np.float64] | None) -> list[float]:
    """Smallest and largest x, y of what is drawn but for stray samples: a run that comes apart does not rule it."""
    drawn = [each.reshape(-1, 2) for each in places if each is not None]
    points = np.concatenate([each[np.isfinite(each).all(axis=1)] for each in drawn])
    if not points.size:
        return [-1.0, -1.0, 1.0, 1.0]
    low, high = np.percentile(points, [0.2, 99.8], axis=0)
    return [*low.tolist(), *high.tolist()]
