"""Animation of a page: scenes of all its runs for the player, in at most `MOST_FRAMES` frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array, Brief, NDArray
from paraflex.errors import InputError
from paraflex.figures.shapes import figure_of
from paraflex.formatting import ROUNDING, peak
from paraflex.plots.marks import DOT, LOOKS, Mark, key_arrow, moving_marks, still_marks
from paraflex.plots.scene import JOINT_BASES, Limits, Scene, common_limits, default_magnification, is_plate, scene
from .packing import packed

MOST_FRAMES = 350
_SHAPES = ("shape", "shape_base", "joint_position", "joint_direction")
NO_SHAPES = (
    "These results do not hold the shapes of the links: they are of an earlier version. "
    "Run the study again to see the mechanism move."
)


@dataclass(frozen=True)
class Animation(Brief):
    """Frames of all runs; with magnification m, bodies and symbols are drawn at `base + m (shape - base)`.

    Attributes
    ----------
    time : (frames,) array
        Times of the frames [s].
    shape, base : (runs, frames, stations, 2) arrays
        Stations of all bodies, deformed and undeformed [m].
    bodies : sequence of (str, int, int)
        Name of each body, its first station, and the one after its last.
    scenes : sequence of Scene or None
        Scene of each run with true deflections; None for a run without a sample.
    stiff : sequence of Scene or None
        Scene of each run without deflections; None if its joints are at the same positions.
    path : (samples, 2) or (runs, samples, 2) array, optional
        Desired path of the end-effector [m], common to all runs or one for each.
    magnify : float
        Initial magnification of deflections.
    periodic : bool
        Whether the frames are one period of a repeated motion; the time is then shown as a phase.
    moments : sequence of str
        Text for each frame in place of its time, for frames that are not instants.
    """

    time: Array
    shape: Array
    base: Array
    bodies: Sequence[tuple[str, int, int]]
    scenes: Sequence[Scene | None]
    stiff: Sequence[Scene | None]
    path: Array | None = None
    magnify: float = 1.0
    periodic: bool = False
    moments: Sequence[str] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the animation as plain values for JSON."""
        known = [one for one in self.scenes if one is not None]
        limits = common_limits(known) if known else Limits(-1.0, 1.0, -1.0, 1.0)
        shown = next((k for k, one in enumerate(self.scenes) if one is not None), 0)
        figures = [figure_of(self.base[shown, :, first:end]) for _, first, end in self.bodies]
        return {
            "time": self.time.tolist(),
            "base": packed(self.base),
            "bend": packed(self.shape - self.base),
            # Name, range of stations, and whether the figure is filled.
            "bodies": [
                [name, first, first + figure.shape[1], is_plate(figure[0])]
                for (name, first, _), figure in zip(self.bodies, figures, strict=True)
            ],
            "looks": LOOKS,
            "bends": peak(self.shape - self.base) > ROUNDING * limits.size or any(self.stiff),
            "magnify": self.magnify,
            "periodic": self.periodic,
            "moments": list(self.moments),
            "marks": [one and [_marks(still_marks(one, limits), 1), _marks(moving_marks(one, limits), self.time.size)]
                      for one in self.scenes],
            # Displacements of the moving symbols from their undeformed positions.
            "swing": [None if one is None or stiff is None else _swing(one, stiff, limits)
                      for one, stiff in zip(self.scenes, self.stiff, strict=True)],
            "dot": DOT * limits.size,
            # Key arrows of the largest force and torque: line, head, text.
            "keys": [one and [[*(part.ravel().tolist() for part in key_arrow(kind, limits)), text]
                              for kind, text in one.load_keys.items()] for one in self.scenes],
            "tips": [one and one.followed for one in self.scenes],
            "path": None if self.path is None else packed(self.path.reshape(-1, *self.path.shape[-2:])),
            "view": [limits.left, limits.bottom, limits.right, limits.top],
        }  # fmt: skip


def _marks(marks: list[Mark], frames: int) -> dict[str, Any]:
    """Return looks and names of symbols, the ranges of their points, and the points."""
    ends = np.cumsum([0, *(mark.places.shape[1] for mark in marks)]).tolist()
    pieces = [[mark.look, mark.name, first, end] for mark, first, end in zip(marks, ends, ends[1:], strict=False)]
    places = np.concatenate([np.zeros((frames, 0, 2)), *(mark.places for mark in marks)], axis=1)
    return {"pieces": pieces, "places": packed(places[None])}


def _swing(one: Scene, stiff: Scene, limits: Limits) -> dict[str, Any]:
    """Return the positions of the moving symbols minus those without deflections."""
    pairs = zip(moving_marks(one, limits), moving_marks(stiff, limits), strict=True)
    return packed(np.concatenate([bent.places - still.places for bent, still in pairs], axis=1)[None])


def animation(data: xr.Dataset, dims: Sequence[str] = ("mode",)) -> Animation | None:
    """Return the animation of a dataset with runs along these dimensions; None if it has no shapes."""
    if any(name not in data for name in _SHAPES):
        return None
    few = data.isel(time=frames_of(data.sizes["time"]))
    path = None
    if "end_effector_desired" in data:
        path = _runs(data["end_effector_desired"], dims)
        path = path[:, frames_of(path.shape[1], 2 * MOST_FRAMES)]
        path = path[0] if all(np.array_equal(path[0], each) for each in path) else path
    names = [str(name) for name in data["station_body"].values]
    runs = [
        few.isel(dict(zip(dims, chosen, strict=True))) for chosen in product(*(range(data.sizes[dim]) for dim in dims))
    ]
    starts = [k for k, name in enumerate(names) if k == 0 or name != names[k - 1]]
    return Animation(
        time=few["time"].values,
        shape=_runs(few["shape"], dims),
        base=_runs(few["shape_base"], dims),
        bodies=[(names[a], a, b) for a, b in zip(starts, [*starts[1:], len(names)], strict=True)],
        scenes=[_scene(run) for run in runs],
        stiff=[_scene(run, 0.0) if _swings(run) else None for run in runs],
        path=path,
        magnify=default_magnification([few]),
    )


def frames_of(samples: int, most: int = MOST_FRAMES) -> NDArray[np.intp]:
    """Return the indices of at most `most` samples, evenly spaced, including the first and the last."""
    return np.unique(np.rint(np.linspace(0, samples - 1, min(samples, most))).astype(np.intp))


def _runs(values: xr.DataArray, dims: Sequence[str]) -> Array:
    """Return values (runs, ...) with the dimensions of runs merged into one; a single run has a first axis as well."""
    rest = [dim for dim in values.dims if dim not in dims]
    array = np.asarray(values.transpose(*dims, *rest).values, dtype=float)
    return array.reshape(-1, *array.shape[len(dims) :])


def _swings(run: xr.Dataset) -> bool:
    """Return whether deflections move joints from their undeformed positions or directions."""
    return any(base in run and bool((run[name] != run[base]).where(run[name].notnull(), False).any())
               for name, base in JOINT_BASES.items())  # fmt: skip


def _scene(run: xr.Dataset, magnify: float = 1.0) -> Scene | None:
    try:
        return scene(run, run["time"].values, magnify)
    except InputError:
        return None
