"""Reference conditions, which attach the floating frame to the deforming beam.

Each is a basis of the same space: the nodal coordinates without the three rigid-body motions and without the
curvature of the last node, unless it is separate (it is zero in the paper's Eq. 9, which is exact unless a moment acts
there). A beam of n elements has 4n flexible coordinates under each condition, and one more for each separate curvature.
"""

from enum import Enum

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import as_enum
from .eigen import eigenpairs
from .element import AXIAL, CURVATURE, SLOPE, TRANSVERSE
from .mesh import BeamMesh

N_RIGID = 3


class ReferenceCondition(Enum):
    """Position and orientation of the body frame on the deformed beam.

    CANTILEVER (the paper's Eq. 9)
        Origin at the first node, x axis along the tangent there.
    PINNED
        Origin at the first node, x axis along the chord to the last node.
    FREE
        Frame in which the elastic motion has no momentum (linearised Tisserand frame): the coordinates are the
        elastic modes of the free beam with its lumps.
    """

    CANTILEVER = "cantilever"
    PINNED = "pinned"
    FREE = "free"


def reference_basis(mesh: BeamMesh, condition: ReferenceCondition | str, mass: Array, stiffness: Array) -> Array:
    """Return the transformation D from independent flexible coordinates to nodal coordinates (Eq. 7).

    Parameters
    ----------
    mesh : BeamMesh
        Mesh of the beam.
    condition : ReferenceCondition or str
        Reference condition.
    mass, stiffness : (n_nodal, n_nodal) arrays
        Nodal mass and stiffness matrix of the beam with its lumps, before any condition; used by FREE only.

    Returns
    -------
    (n_nodal, nf) array
        Transformation D; nf is 4 per element and one more for each separate curvature.
    """
    condition = as_enum(ReferenceCondition, condition, "reference")
    kept = np.ones(mesh.n_nodal, dtype=bool)
    kept[mesh.column(-1, CURVATURE)] = mesh.n_elements in mesh.separate
    if condition is ReferenceCondition.CANTILEVER:
        kept[[mesh.column(0, AXIAL), mesh.column(0, TRANSVERSE), mesh.column(0, SLOPE)]] = False
    elif condition is ReferenceCondition.PINNED:
        kept[[mesh.column(0, AXIAL), mesh.column(0, TRANSVERSE), mesh.column(-1, TRANSVERSE)]] = False
    basis = np.eye(mesh.n_nodal)[:, kept]
    if condition is ReferenceCondition.FREE:
        _, modes = eigenpairs(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
        basis = basis @ modes[:, N_RIGID:]
    return basis
