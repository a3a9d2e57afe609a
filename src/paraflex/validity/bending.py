"""Bending of each flexible body over a run, and its axial force."""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import BodyCoordinates, System
from paraflex.fem import ReferenceCondition
from paraflex.fem.element import AXIAL
from paraflex.fem.integrals import GAUSS_FRACTIONS, GAUSS_POINTS, GAUSS_WEIGHTS
from paraflex.integrators import Solution
from paraflex.kernel.packed import POINT
from paraflex.mechanism import AssumedModesBeam, Body, FlexibleBeam
from paraflex.mechanism.bodies import span_properties

# Coordinates with less than this fraction of the stiffness of uniform stretch do not give the axial force.
_STRETCHES = 0.5


class Bending(NamedTuple):
    """Bending of a flexible body over the k samples.

    Attributes
    ----------
    name : str
        Name of the body; that of the whole beam if it has several frames.
    frames : int
        Number of frames of the whole beam.
    linear : bool
        Whether its geometry is linear.
    given : bool
        Whether its shapes are given by the user: its geometry is then linear in any mechanism.
    tangent : bool
        Whether its frame is on the tangent at its first end.
    slope : (k,) array
        Largest slope along it, in its frame [rad].
    shortening : (k,) array
        Shortening by bending, 1/2 int slope^2 dx [m]; NaN for a modal body.
    axial : (k,) array
        Largest axial force relative to the buckling load of the body as held by its frame; positive in tension; NaN for
        a modal body.
    """

    name: str
    frames: int
    linear: bool
    given: bool
    tangent: bool
    slope: Array
    shortening: Array
    axial: Array


def bending_of(system: System, name: str, solution: Solution) -> Bending:
    """Return the bending of a flexible body over a run of one or more samples."""
    body, described = system.body(name), system.mechanism.body(name)
    u = solution.q[:, body.flexible]
    # Equal beams share integrals and with them this.
    line = system.once(("line", id(body.integrals)), lambda: _line(body, described))
    given = not isinstance(described, FlexibleBeam)
    tangent = not given and described.reference is ReferenceCondition.CANTILEVER
    slopes = u @ line.slopes.T
    # Slopes are usually largest at the ends, which Gauss points do not include.
    ends = u @ line.ends.T
    slope = np.maximum(np.max(np.abs(slopes), axis=1, initial=0.0), np.max(np.abs(ends), axis=1, initial=0.0))
    shortening = axial = np.full(solution.t.size, np.nan)
    if line.weights.size:
        shortening = 0.5 * slopes**2 @ line.weights
        axial = _axial_force(system, body, line, solution) / line.buckling
    whole = system.carrier(name)[0]
    return Bending(whole, len(system.parts(whole)), body.points is None, given, tangent, slope, shortening, axial)


class _Line(NamedTuple):
    """Stations along a body: weights of an integral over its length [m], slopes and strains per coordinate, E A [N].

    With them are slopes at its ends and nodes, and its buckling load [N].
    """

    weights: Array
    slopes: Array
    strains: Array
    stiffness: Array
    ends: Array
    buckling: float


def _line(body: BodyCoordinates, described: Body) -> _Line:
    """Return the Gauss points of a beam, or of a bar of assumed modes; a modal body has no stations."""
    D = body.integrals.D
    if isinstance(described, FlexibleBeam):
        mesh, spans = described.mesh, described.spans
        lengths = np.diff(mesh.nodes)
        weights = (0.5 * lengths[:, None] * GAUSS_WEIGHTS).ravel()
        each = np.repeat(np.arange(lengths.size), GAUSS_POINTS)
        strains = (np.diff(D[mesh.rows_of(AXIAL)], axis=0) / lengths[:, None])[each]
        stiffness = np.array([spans[span].axial_stiffness for span in mesh.spans])[each]
        slopes = mesh.transverse_at(GAUSS_FRACTIONS, 1).reshape(each.size, -1) @ D
    elif isinstance(described, AssumedModesBeam):
        shapes = described.shapes
        x, weights = shapes.quadrature()
        bent = len(shapes.transverse)
        slopes = shapes.transverse_rows(x, derivative=1) @ D[:bent]
        strains = shapes.axial_rows(x, derivative=1) @ D[bent:]
        stiffness = np.full(x.size, span_properties(described.section, described.material).axial_stiffness)
    else:
        weights, stiffness, slopes, strains = np.zeros(0), np.zeros(0), np.zeros((0, body.nf)), np.zeros((0, body.nf))
    # The body, held as by its frame, buckles under an axial force N, where 1 / N is the largest eigenvalue of
    # W^-1 G W^-1, W = diag(omega), G = int slope^T slope dx: coordinates are modes of stiffness omega^2.
    largest = np.linalg.norm(np.sqrt(weights)[:, None] * slopes / body.modes.omega, ord=2) ** 2 if weights.size else 0.0
    buckling = float(1.0 / largest) if largest > 0.0 else np.inf
    return _Line(weights, slopes, strains, stiffness, body.shape.slopes @ D, buckling)


def _axial_force(system: System, body: BodyCoordinates, line: _Line, solution: Solution) -> Array:
    """Return the largest axial force, positive in tension (k,) [N].

    It is that of the stretch. If the coordinates do not stretch, as for a beam reduced to its lowest modes, it is the
    largest component along the body of its joints' forces, taken as compression.
    """
    # Compliance of the coordinates under uniform tension.
    tension = line.weights @ line.strains / body.modes.omega
    if tension @ tension >= _STRETCHES * np.sum(line.weights / line.stiffness):
        found = solution.q[:, body.flexible] @ (line.stiffness[:, None] * line.strains).T
        return np.take_along_axis(found, np.argmax(np.abs(found), axis=1)[:, None], axis=1)[:, 0]
    phi = solution.q[:, body.angle]
    c, s = np.cos(phi), np.sin(phi)
    record = system.packed.bodies[system.index[body.name]]
    largest = np.zeros(solution.t.size)
    for port in system.packed.ports[record["port"] : record["port_end"]]:
        if port["kind"] == POINT:
            x, y = solution.multipliers[:, port["row"] : port["row"] + 2].T
            # Multipliers have a pole at singular configurations, and are NaN there.
            largest = np.fmax(largest, np.abs(port["weight"] * (c * x + s * y)))
    return -largest
