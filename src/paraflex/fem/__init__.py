"""Flexible beams: element, mesh, reference conditions, inertia shape integrals, eigenmodes. Knows no mechanisms."""

from paraflex.fem.integrals import Lump, ShapeIntegrals, SpanProperties, beam_integrals, rigid_integrals
from paraflex.fem.mesh import BeamMesh, mesh_beam
from paraflex.fem.modes import ModalBasis, modal_basis, natural_frequencies
from paraflex.fem.reference import ReferenceCondition, reference_basis

__all__ = [
    "BeamMesh",
    "Lump",
    "ModalBasis",
    "ReferenceCondition",
    "ShapeIntegrals",
    "SpanProperties",
    "beam_integrals",
    "mesh_beam",
    "modal_basis",
    "natural_frequencies",
    "reference_basis",
    "rigid_integrals",
]
