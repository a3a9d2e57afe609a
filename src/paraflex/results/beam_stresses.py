"""Stresses in the sections of beams of a run, from its dataset, and the largest of them."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Array, NDArray
from .loads import OF_BEAMS
from .numbers import largest

# Dimensions of stations along beams and of joints that slide along them.
SECTION, CONTACT = "section", "contact"


class Stresses(NamedTuple):
    """Stresses of a run in all its sections, from its dataset.

    Attributes
    ----------
    bending, axial : (..., time, section) arrays
        Signed bending stress in the outermost fibre, and mean axial stress of the section [Pa].
    place, strength : (..., time, section) arrays
        Distance of each section from the beam's first end [m], and strength of its material [Pa].
    owners : (section,) array of str
        Body of each section.
    """

    bending: Array
    axial: Array
    place: Array
    strength: Array
    owners: NDArray[np.str_]

    @property
    def whole(self) -> Array:
        """Largest magnitude in the section [Pa]; that of bending alone if the axial force is unknown."""
        return np.abs(np.nan_to_num(self.axial)) + np.abs(self.bending)


def stresses_of(data: xr.Dataset, dim: str = SECTION) -> Stresses:
    """Return the stresses (..., time, section) of a dataset in one kind of sections, at stations or under contacts."""
    moment = data[f"{dim}_moment"].transpose(..., "time", dim)

    def values(name: str) -> Array:
        return data[f"{dim}_{name}"].broadcast_like(moment).transpose(*moment.dims).values.astype(float)

    bending, axial = values("moment") / values("modulus"), values("force") / values("area")
    return Stresses(bending, axial, values("place"), values("strength"), data[f"{dim}_body"].values)


def _everywhere(data: xr.Dataset) -> Stresses:
    """Return the stresses at all stations and under all contacts."""
    found = stresses_of(data)
    if "contact_moment" not in data:
        return found
    pairs: Any = zip(found, stresses_of(data, CONTACT), strict=True)
    return Stresses(*(np.concatenate(pair, axis=-1) for pair in pairs))


def largest_stresses(data: xr.Dataset) -> xr.Dataset:
    """Return the largest stresses of every beam and run, with place, time and safety factor; NaN if unknown."""
    found = _everywhere(data)
    all_stresses = found.whole
    outer = [dim for dim in data["section_moment"].dims if dim not in ("time", SECTION)]
    shape = [data.sizes[dim] for dim in outer]
    out = {name: np.full([*shape, data.sizes["body"]], np.nan) for name in OF_BEAMS}
    time = data["time"].values
    for b, body in enumerate(data["body"].values):
        own = np.flatnonzero(found.owners == body)
        for run in np.ndindex(*shape):
            bending, axial, place, strength = (
                each[run][:, own] for each in (found.bending, found.axial, found.place, found.strength)
            )
            whole, where = all_stresses[run][:, own], (*run, b)
            # None, for beams without known stresses, becomes NaN.
            out["bending_stress_max"][where] = largest(bending)
            out["axial_stress_max"][where] = largest(axial)
            if not np.isfinite(whole).any():
                continue
            k, station = np.unravel_index(np.nanargmax(whole), whole.shape)
            out["stress_max"][where] = whole[k, station]
            out["stress_time"][where], out["stress_place"][where] = time[k], place[k, station]
            used = largest(whole / strength)
            out["safety_factor"][where] = 1.0 / used if used else np.nan
    return xr.Dataset({name: ((*outer, "body"), values) for name, values in out.items()})
