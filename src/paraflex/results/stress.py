"""Section forces, stresses and safety factors of beams in datasets, and the largest of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.dynamics import System
from paraflex.dynamics.sections import SectionLoads, Sections, sections_of
from paraflex.results.numbers import largest

Array = NDArray[np.float64]
Variables = dict[str, tuple[tuple[str, ...], NDArray[np.floating]]]
# The dimension of stations along beams, and the variable that every run with section forces has.
SECTION, MOMENT = "section", "section_moment"
_BODIES = ("stress_max", "stress_place", "stress_time", "bending_stress_max", "axial_stress_max", "safety_factor")
UNITS = {
    "section_moment": ("bending moment of a beam's section", "N m"),
    "section_force": ("axial force of a beam's section", "N"),
    "section_body": ("body of a section", "1"),
    "section_place": ("distance of a section from the beam's first end", "m"),
    "section_area": ("area of a section", "m^2"),
    "section_modulus": ("second moment of area over the distance of the outermost fibre", "m^3"),
    "section_strength": ("strength of the material at a section", "Pa"),
    "stress": ("largest magnitude of the stress along a beam, bending and axial", "Pa"),
    "stress_max": ("largest magnitude of the stress of a beam, bending and axial", "Pa"),
    "stress_place": ("distance from the beam's first end at which its stress is largest", "m"),
    "stress_time": ("time at which its stress is largest", "s"),
    "bending_stress_max": ("largest magnitude of a beam's bending stress, in the outermost fibre", "Pa"),
    "axial_stress_max": ("largest magnitude of a beam's axial stress", "Pa"),
    "safety_factor": ("least strength over stress of a beam", "1"),
}
COMMENTS = {
    "section_moment": "E I w'' of the shape functions: positive bends the beam anticlockwise from its first end on",
    "section_force": "positive in tension; NaN of beams whose coordinates do not stretch, as those of few modes",
    "stress": "|N| / A + |M| c / I in the outermost fibre; NaN where the section has no outer_fibre",
}


@dataclass(frozen=True)
class SectionResult:
    """Section forces of a run at its k samples."""

    sections: Sections
    loads: SectionLoads


def section_result(system: System, q: Array, v: Array, a: Array) -> SectionResult | None:
    """Section forces for coordinates (k, n) and their derivatives; None where no beam is flexible."""
    sections = sections_of(system)
    return None if sections is None else SectionResult(sections, sections.loads(system, q, v, a))


def section_variables(found: SectionResult, bodies: list[str]) -> Variables:
    """Variables over time, those of many stations in single precision."""
    stress = found.sections.stress(found.loads)
    along = np.full((len(stress), len(bodies)), np.nan)
    for b, body in enumerate(bodies):
        own = np.array(found.sections.bodies) == body
        if own.any() and np.isfinite(found.sections.modulus[own]).any():
            along[:, b] = np.fmax.reduce(stress[:, own], axis=1)
    return {
        "section_moment": ((SECTION,), found.loads.moment.astype(np.float32)),
        "section_force": ((SECTION,), found.loads.force.astype(np.float32)),
        "stress": (("body",), along),
    }


def section_coordinates(sections: Sections) -> dict[str, Any]:
    """What stations are, as coordinates of a dataset."""
    return {
        "section_body": (SECTION, list(sections.bodies)),
        "section_place": (SECTION, sections.x),
        "section_area": (SECTION, sections.area),
        "section_modulus": (SECTION, sections.modulus),
        "section_strength": (SECTION, sections.strength),
    }


class Stresses(NamedTuple):
    """Stresses of a run in all its sections, from its dataset.

    Attributes
    ----------
    bending, axial : (..., time, section) arrays
        In the outermost fibre, and in the mean of the section [Pa]; with signs.
    """

    bending: Array
    axial: Array

    @property
    def whole(self) -> Array:
        """Largest magnitude in the section; of bending alone where there is no axial force [Pa]."""
        return np.abs(np.nan_to_num(self.axial)) + np.abs(self.bending)


def stresses_of(data: xr.Dataset) -> Stresses:
    """Stresses of a dataset (..., time, section)."""
    moment, force = (data[name].transpose(..., "time", SECTION).values.astype(float)
                     for name in ("section_moment", "section_force"))  # fmt: skip
    return Stresses(moment / data["section_modulus"].values, force / data["section_area"].values)


def largest_stresses(data: xr.Dataset) -> xr.Dataset:
    """The largest stresses of every beam of every run, with place and time, and safety factors; NaN where unknown."""
    found = stresses_of(data)
    all_stresses = found.whole
    outer = [dim for dim in data["section_moment"].dims if dim not in ("time", SECTION)]
    shape = [data.sizes[dim] for dim in outer]
    out = {name: np.full([*shape, data.sizes["body"]], np.nan) for name in _BODIES}
    time, place, strength = (data[name].values for name in ("time", "section_place", "section_strength"))
    for b, body in enumerate(data["body"].values):
        own = np.flatnonzero(data["section_body"].values == body)
        for run in np.ndindex(*shape):
            bending, axial, where = found.bending[run][:, own], found.axial[run][:, own], (*run, b)
            whole = all_stresses[run][:, own]
            # None, where nothing is known, becomes NaN.
            out["bending_stress_max"][where] = largest(bending)
            out["axial_stress_max"][where] = largest(axial)
            if not np.isfinite(whole).any():
                continue
            k, station = np.unravel_index(np.nanargmax(whole), whole.shape)
            out["stress_max"][where] = whole[k, station]
            out["stress_time"][where], out["stress_place"][where] = time[k], place[own[station]]
            used = largest(whole / strength[own])
            out["safety_factor"][where] = 1.0 / used if used else np.nan
    return xr.Dataset({name: ((*outer, "body"), values) for name, values in out.items()})
