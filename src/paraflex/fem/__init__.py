"""Flexible beams: element, mesh, reference conditions, inertia shape integrals, eigenmodes. Knows no mechanisms."""

from paraflex.fem.assumed import AssumedShapes, PlacedLump, Polynomial, ShapeFunction, Sine, assumed_integrals
from paraflex.fem.foreshortening import MassPoints, mass_points, node_weights, slope_square_integrals, slope_squares
from paraflex.fem.integrals import Lump, ShapeIntegrals, SpanProperties, beam_integrals, rigid_integrals
from paraflex.fem.mesh import BeamMesh, mesh_beam
from paraflex.fem.modes import ModalBasis, modal_basis, natural_frequencies
from paraflex.fem.reference import ReferenceCondition, reference_basis

__all__ = [
    "AssumedShapes",
    "BeamMesh",
    "Lump",
    "MassPoints",
    "ModalBasis",
    "PlacedLump",
    "Polynomial",
    "ReferenceCondition",
    "ShapeFunction",
    "ShapeIntegrals",
    "Sine",
    "SpanProperties",
    "assumed_integrals",
    "beam_integrals",
    "mass_points",
    "mesh_beam",
    "modal_basis",
    "natural_frequencies",
    "node_weights",
    "reference_basis",
    "rigid_integrals",
    "slope_square_integrals",
    "slope_squares",
]
