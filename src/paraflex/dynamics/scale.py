"""Reference length for the tolerances of a mechanism."""

import math

import numpy as np

from .coordinates import BodyCoordinates


def mechanism_size(bodies: tuple[BodyCoordinates, ...]) -> float:
    """Return the largest distance between two points of a body, rounded to a power of two for exact division [m].

    If no body has two distinct points, it is the largest radius of gyration about a body's origin.
    """
    size = max(map(_extent, bodies))
    if not size > 0.0:
        inertias = [body.integrals for body in bodies]
        size = max(float(np.sqrt(np.real(one.I0 + one.J) / np.real(one.m))) for one in inertias)
    return 2.0 ** round(math.log2(size)) if size > 0.0 and math.isfinite(size) else 1.0


def _extent(body: BodyCoordinates) -> float:
    """Return the length of a beam; for another body the largest distance between two of its named points [m]."""
    if body.mesh is not None:
        return float(np.real(body.mesh.nodes[-1] - body.mesh.nodes[0]))
    places = np.array([np.real(point.x0) for point in body.shape.points.values()], dtype=float).reshape(-1, 2)
    return float(np.max(np.linalg.norm(places[:, None] - places[None], axis=2), initial=0.0))
