"""Section forces and stresses of beams as variables of datasets."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paraflex.arrays import Array, NDArray
from paraflex.dynamics import System
from paraflex.dynamics.sections import SectionLoads, Sections, sections_of
from .beam_stresses import CONTACT, SECTION
from .numbers import single

# Dimensions besides time, and values at the samples reached, by name of the variable.
Variables = dict[str, tuple[tuple[str, ...], NDArray[np.floating]]]
# Variable that every run with section forces has.
MOMENT = "section_moment"
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


def stress_errors(system: System, errors: Array) -> Array:
    """Return bounds of the errors of stresses (bodies,) [Pa], NaN without stresses, from those of coordinates (n,)."""
    bodies, sections = [body.name for body in system.described.bodies], sections_of(system)
    out = np.full(len(bodies), np.nan)
    for name, error in () if sections is None else sections.stress_errors(system, errors):
        b = bodies.index(system.carrier(name)[0])
        out[b] = np.fmax(out[b], error)
    return out


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
