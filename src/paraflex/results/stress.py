"""Section forces, stresses and safety factors of beams in datasets, and the largest stresses of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.sections import SectionLoads, Sections, sections_of
from paraflex.results.loads import OF_BEAMS
from paraflex.results.numbers import largest, single

# Dimensions besides time, and values at the samples reached, by name of the variable.
Variables = dict[str, tuple[tuple[str, ...], NDArray[np.floating]]]
# Dimensions of stations along beams and of joints that slide along them, and the variable that every run with section
# forces has.
SECTION, CONTACT, MOMENT = "section", "contact", "section_moment"
UNITS = {
    "section_moment": ("bending moment of a beam's section", "N m"),
    "section_force": ("axial force of a beam's section", "N"),
    "section_body": ("body of a section", "1"),
    "section_place": ("distance of a section from the beam's first end", "m"),
    "section_area": ("area of a section", "m^2"),
    "section_modulus": ("second moment of area over the distance of the outermost fibre", "m^3"),
    "section_strength": ("strength of the material at a section", "Pa"),
    "contact_body": ("body that a joint slides along", "1"),
    "contact_place": ("distance of a sliding joint from the beam's first end", "m"),
    "contact_moment": ("bending moment of the section under a sliding joint", "N m"),
    "contact_force": ("axial force of the section under a sliding joint", "N"),
    "contact_area": ("area of the section under a sliding joint", "m^2"),
    "contact_modulus": ("section_modulus of the section under a sliding joint", "m^3"),
    "contact_strength": ("strength of the material under a sliding joint", "Pa"),
    "stress": ("largest magnitude of the stress along a beam, bending and axial", "Pa"),
    "stress_max": ("largest magnitude of the stress of a beam, bending and axial", "Pa"),
    "stress_place": ("distance from the beam's first end at which its stress is largest", "m"),
    "stress_time": ("time at which its stress is largest", "s"),
    "bending_stress_max": ("largest magnitude of a beam's bending stress, in the outermost fibre", "Pa"),
    "axial_stress_max": ("largest magnitude of a beam's axial stress", "Pa"),
    "safety_factor": ("least strength over stress of a beam", "1"),
}
# Variables of contacts, and the fields of `SectionLoads` that hold their values.
_OF_CONTACTS = {name: name for name in ("moment", "force", "area", "modulus", "strength")} | {"place": "x"}
COMMENTS = {
    "section_moment": "E I w'' of the shape functions, with what the force of a joint that slides along adds; "
    "positive bends the beam anticlockwise from its first end on",
    "section_force": "positive in tension; NaN for beams whose coordinates have no stretch, such as few modes",
    "stress": "|N| / A + |M| c / I in the outermost fibre; NaN where the section has no outer_fibre",
}


@dataclass(frozen=True)
class SectionResult:
    """Sections of the beams of a run, and section forces at its k samples."""

    sections: Sections
    loads: SectionLoads


def section_result(system: System, q: Array, v: Array, a: Array, multipliers: Array) -> SectionResult | None:
    """Return section forces for coordinates q (k, n), derivatives and multipliers; None without flexible beams."""
    sections = sections_of(system)
    if sections is None:
        return None
    loads = sections.loads(system, q, v, a, multipliers)
    owners, starts = zip(*(system.carrier(name) for name in sections.bodies), strict=True)
    if owners == sections.bodies:
        return SectionResult(sections, loads)
    # Places on parts of a beam are measured from the first end of the whole beam.
    x = loads.x.copy()
    x[:, : len(starts)] += starts
    return SectionResult(replace(sections, bodies=owners, x=sections.x + starts), loads._replace(x=x))


def section_variables(found: SectionResult, bodies: list[str]) -> Variables:
    """Return the variables over time: section forces in single precision, stresses, and forces under contacts."""
    stress, number = found.loads.stress, len(found.sections.bodies)
    along = np.full((len(stress), len(bodies)), np.nan)
    for b, body in enumerate(bodies):
        own = np.array(found.sections.owners) == body
        if own.any() and np.isfinite(found.loads.modulus[:, own]).any():
            along[:, b] = np.fmax.reduce(stress[:, own], axis=1)
    out: Variables = {
        "section_moment": ((SECTION,), single(found.loads.moment[:, :number])),
        "section_force": ((SECTION,), single(found.loads.force[:, :number])),
        "stress": (("body",), along),
    }
    if found.sections.contacts:
        out |= {
            f"contact_{name}": ((CONTACT,), getattr(found.loads, field)[:, number:])
            for name, field in _OF_CONTACTS.items()
        }
    return out


def section_coordinates(sections: Sections) -> dict[str, Any]:
    """Return the coordinates of a dataset that describe sections and contacts."""
    return {
        "section_body": (SECTION, list(sections.bodies)),
        "section_place": (SECTION, sections.x),
        "section_area": (SECTION, sections.area),
        "section_modulus": (SECTION, sections.modulus),
        "section_strength": (SECTION, sections.strength),
    } | (
        {CONTACT: list(sections.contacts), "contact_body": (CONTACT, list(sections.contacts.values()))}
        if sections.contacts
        else {}
    )


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
