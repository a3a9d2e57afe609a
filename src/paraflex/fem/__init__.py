"""Flexible beams: element, mesh, reference conditions, shape integrals and eigenmodes, independent of mechanisms."""

from .assumed import (
    AssumedShapes as AssumedShapes,
    PlacedLump as PlacedLump,
    Polynomial as Polynomial,
    ShapeFunction as ShapeFunction,
    Sine as Sine,
    assumed_integrals as assumed_integrals,
)
from .foreshortening import (
    MassPoints as MassPoints,
    mass_points as mass_points,
    node_weights as node_weights,
    slope_square_integrals as slope_square_integrals,
)
from .integrals import (
    Lump as Lump,
    ShapeIntegrals as ShapeIntegrals,
    SpanProperties as SpanProperties,
    beam_integrals as beam_integrals,
    rigid_integrals as rigid_integrals,
)
from .mesh import BeamMesh as BeamMesh, mesh_beam as mesh_beam
from .modes import ModalBasis as ModalBasis, modal_basis as modal_basis, natural_frequencies as natural_frequencies
from .reference import ReferenceCondition as ReferenceCondition
