"""Comparison of runs with reduced bodies to the same runs with all flexible coordinates: errors and cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.findings import Finding
from paraflex.formatting import number, quantity
from .findings import MODE, keep_findings, verdict_of
from .following import HEADLINE, ErrorSpan
from .numbers import finite_or_none

if TYPE_CHECKING:
    # The module imports the kernels, which are not needed to read results.
    from paraflex.reduced_bodies import Size

# Variables that identify such a dataset, and prefix of the numbers of the full runs.
DISTANCE, ESTIMATE, FULL = "reduction_distance", "reduction_estimate", "full_"
# Attributes with the sizes of the reduced system and, with the prefix, of the full system.
COUNTS = ("flexible_coordinates", "states")
# Variables of full runs that are kept: tracking errors along a path, and the cost of the runs.
_NUMBERS = (*HEADLINE.values(), "wall_time", "steps")
# A distance above this fraction of the full run's tracking error or largest deflection is a finding.
_FAR = 0.1
# A strain energy above this multiple of that of planned static deflections is a finding: three times their amplitude.
_BEYOND = 9.0


def compared_with_full(data: xr.Dataset, full: xr.Dataset, kept: Size, whole: Size) -> xr.Dataset:
    """Return the dataset of reduced runs with numbers of the full runs, distances to them, and findings on large ones.

    Parameters
    ----------
    data, full : xarray.Dataset
        Results of the reduced and the full runs, from `tracking_dataset` or `motion_dataset`; the latter may lack
        modes.
    kept, whole : Size
        Sizes of the reduced and of the full system.
    """
    # The distance is that of the end-effector along a path, else the largest of any named point.
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
    out = data.assign(added).assign_attrs(_counts(kept, whole))
    keep_findings(out, [*verdict_of(data), *_distant_runs(out, full)])
    return out


def _counts(kept: Size, whole: Size) -> dict[str, int]:
    return kept._asdict() | {f"{FULL}{name}": count for name, count in whole._asdict().items()}


def with_estimate(
    data: xr.Dataset, deviation: float, energies: Mapping[str, float], planned: float, kept: Size, whole: Size
) -> xr.Dataset:
    """Return the dataset of reduced runs along a path with the estimated deviation of the end-effector.

    Parameters
    ----------
    data : xarray.Dataset
        Results of the runs.
    deviation : float
        Estimated deviation from the positions with all coordinates [m].
    energies : mapping of str to float
        Largest strain energy of each mode's run [J].
    planned : float
        Largest strain energy of the planned static deflections, for which the shapes are chosen [J]. A run with far
        more of it is a finding.
    kept, whole : Size
        Sizes of the reduced and of the full system.
    """
    meaning = "estimated deviation of the end-effector from its place with all flexible coordinates"
    out = data.assign({ESTIMATE: xr.DataArray(deviation, attrs={"long_name": meaning, "units": "m"})})
    out = out.assign_attrs(_counts(kept, whole))
    beyond = [
        Finding(
            "reduced-beyond-plan",
            f"{MODE}{mode}",
            f"beams store up to {quantity(energy, 'J', digits=2)}, and {quantity(planned, 'J', digits=2)} in the "
            "planned deflections for which their shapes are chosen: more may be missing than estimated",
            "keep all flexible coordinates, or compare with --reduced N",
        )
        for mode, energy in energies.items()
        if energy > _BEYOND * planned
    ]
    keep_findings(out, [*verdict_of(out), *beyond])
    return out


def _distant_runs(data: xr.Dataset, full: xr.Dataset) -> Iterator[Finding]:
    """Yield findings on runs that are far from the full ones."""
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
                f"with {kept} flexible coordinates {whose} is up to {quantity(distance, 'm', digits=2)} from its place "
                f"with all {whole}, {number(100.0 * distance / size, 2)} % of {what}", "keep more of them",
            )  # fmt: skip


def reduced_run_figures(data: xr.Dataset) -> dict[str, Any]:
    """Return `reduction` of the single run of a dataset: its estimated deviation, and distance to a full run.

    The dictionary is empty if the run has all flexible coordinates.
    """
    if DISTANCE not in data and ESTIMATE not in data:
        return {}
    known = {"estimate": ESTIMATE, "distance": DISTANCE}
    known |= {str(name): str(name) for name in data if str(name).startswith(FULL)}
    numbers = {key: finite_or_none(data[name].item()) for key, name in known.items() if name in data}
    counts = {name: int(data.attrs[name]) for each in COUNTS for name in (each, FULL + each)}
    return {"reduction": numbers | counts}
