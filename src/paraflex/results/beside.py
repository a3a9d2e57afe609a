"""Runs of the same study in another geometry of the beams, beside those of a dataset, with errors from elsewhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import xarray as xr

from paraflex.findings import Finding, Level, Verdict
from .findings import verdict_of
from .following import headline
from .numbers import finite_or_none

# Attribute of a dataset with the content of `Beside` as JSON, and variable with the places of the end-effector.
BESIDE, PLACES = "beside", "end_effector_beside"


@dataclass(frozen=True)
class Beside:
    """Tracking errors of the runs of a study in another geometry, and of others.

    Attributes
    ----------
    geometry, other : str
        Geometry of the runs of the dataset, and of those beside them.
    errors : dict of str to float or None
        RMS tracking errors beside those of the dataset, by mode [m]; None for a run that failed.
    elsewhere : dict
        Errors from other sources by mode [m], by geometry and source.
    findings : list of dict
        Findings on the runs beside those of the dataset.
    """

    geometry: str
    other: str
    errors: dict[str, float | None]
    elsewhere: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    findings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def verdict(self) -> Verdict:
        """Findings on the runs beside those of the dataset."""
        return Verdict(map(Finding.from_dict, self.findings))

    @property
    def sound(self) -> bool:
        """Whether all runs beside those of the dataset are complete, and no check gives reason for doubt."""
        return None not in self.errors.values() and self.verdict.level is Level.SOUND


def with_beside(
    data: xr.Dataset, other: xr.Dataset, geometries: tuple[str, str], elsewhere: Mapping[str, Any]
) -> xr.Dataset:
    """Return a dataset with the tracking errors and places of runs in another geometry.

    Parameters
    ----------
    data, other : xarray.Dataset
        Results of both from `tracking_dataset`; the latter may lack modes.
    geometries : tuple of str
        Geometry of each.
    elsewhere : mapping
        Errors from other sources, see `Beside`.
    """
    found = headline(other)[0].reindex_like(data["mode"])
    errors = {str(mode): finite_or_none(found.sel(mode=mode).item()) for mode in data["mode"].values}
    beside = Beside(*geometries, errors, dict(elsewhere), [one.to_dict() for one in verdict_of(other)])
    own = data["end_effector"]
    meaning = {"long_name": f"{own.attrs.get('long_name', 'end-effector')}, {geometries[1]} geometry"}
    places = other["end_effector"].reindex_like(own).assign_attrs(own.attrs | meaning)
    return data.assign({PLACES: places}).assign_attrs({BESIDE: json.dumps(asdict(beside))})


def beside_of(data: xr.Dataset) -> Beside | None:
    """Return the runs in another geometry beside those of a dataset; None if there are none."""
    return Beside(**json.loads(data.attrs[BESIDE])) if BESIDE in data.attrs else None
