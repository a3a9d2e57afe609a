"""Runs with few flexible coordinates beside the same runs with all of them: how far off they are, how much faster."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.findings import Finding
from paraflex.results.doubts import MODE, keep_findings, verdict_of
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.numbers import finite_or_none

if TYPE_CHECKING:
    # It needs the kernels, which who reads results does without.
    from paraflex.reduction import Size

# The variable by which such a dataset is known, and the prefix of numbers of the full runs.
DISTANCE, FULL = "reduction_distance", "full_"
# Attributes with what is kept and, with the prefix, what there is.
COUNTS = ("flexible_coordinates", "states")
# Numbers of full runs that are kept: tracking errors along a path, and what they cost.
_NUMBERS = (*HEADLINE.values(), "wall_time", "steps")
# A distance beyond this part of what flexibility does in the full run is a finding.
_FAR = 0.1


def beside_full(data: xr.Dataset, full: xr.Dataset, kept: Size, whole: Size) -> xr.Dataset:
    """The dataset of reduced runs with what the full runs came to, errors against these, and findings on large ones.

    Parameters
    ----------
    data, full : xarray.Dataset
        Of the same runs, from `tracking_dataset` or `motion_dataset`; the second may lack modes.
    kept, whole : Size
        Of the reduced and of the full system.
    """
    # Along a path it is the end-effector that matters, else any named point.
    along = "end_effector" in data
    places, exact = (one["end_effector" if along else "point_position"] for one in (data, full))
    squares = ((places - exact.reindex_like(places)) ** 2).sum("axis", skipna=False)
    apart: xr.DataArray = squares.max(["time"] if along else ["time", "point"]) ** 0.5
    whose = "the end-effector" if along else "a named point"
    apart.attrs = {"long_name": f"largest distance of {whose} from its place in the full run", "units": "m"}
    added = {DISTANCE: apart}
    for name in _NUMBERS:
        if name in full and name in data:
            number = full[name].reindex_like(data[name])
            meaning = f"{data[name].attrs.get('long_name', name)}, all flexible coordinates"
            added[f"{FULL}{name}"] = number.assign_attrs(data[name].attrs | {"long_name": meaning})
    out = data.assign(added)
    out.attrs |= kept._asdict() | {f"{FULL}{name}": count for name, count in whole._asdict().items()}
    keep_findings(out, [*verdict_of(data), *_far(out, full)])
    return out


def _far(data: xr.Dataset, full: xr.Dataset) -> Iterator[Finding]:
    """Runs that are far from the full ones."""
    along = "mode" in data.dims
    name = HEADLINE[ErrorSpan(data.attrs["error"])] if along else ""
    for mode in data["mode"].values if along else [""]:
        run = data.sel(mode=mode) if along else data
        size = float(run[f"{FULL}{name}"]) if along else float(np.abs(full["deflection"]).max())
        distance = float(run[DISTANCE])
        if distance > _FAR * size:
            kept, whole = data.attrs["flexible_coordinates"], data.attrs[f"{FULL}flexible_coordinates"]
            what, whose = ("its tracking error", "the end-effector") if along else ("the largest deflection", "a point")
            yield Finding(
                "reduced-too-far", f"{MODE}{mode}" if along else "study.reduced",
                f"with {kept} flexible coordinates {whose} is up to {distance:.2g} m from its place with all {whole}, "
                f"{100.0 * distance / size:.0f} % of {what}", "keep more of them",
            )  # fmt: skip


def reduction_figures(data: xr.Dataset) -> dict[str, Any]:
    """Of a run, by itself in a dataset: `reduction`, its error and the full run's numbers; empty if it has all."""
    if DISTANCE not in data:
        return {}
    numbers = {name: finite_or_none(data[name].item()) for name in data if str(name).startswith(FULL)}
    counts = {name: int(data.attrs[name]) for each in COUNTS for name in (each, FULL + each)}
    return {"reduction": {"distance": finite_or_none(data[DISTANCE].item()), **numbers, **counts}}
