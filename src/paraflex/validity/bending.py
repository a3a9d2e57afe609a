"""How far each flexible body of a run bent, and what axial force it carried."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import BodyCoordinates, System
from paraflex.fem import ReferenceCondition
from paraflex.fem.element import AXIAL, transverse_shape
from paraflex.fem.integrals import GAUSS_POINTS
from paraflex.integrators import Solution
from paraflex.kernel.packed import POINT
from paraflex.mechanism import AssumedModesBeam, Body, FlexibleBeam
from paraflex.mechanism.bodies import span_properties

# Coordinates that hold less than this of the stiffness of a uniform stretch do not tell the axial force.
_STRETCHES = 0.5
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(GAUSS_POINTS)


class Bending(NamedTuple):
    """A flexible body over the k samples.

    Attributes
    ----------
    name : str
        Of the beam that it is a part of, where that has several frames.
    frames : int
        How many that has.
    linear : bool
        Whether its geometry is linear.
    given : bool
        Whether its shapes are the user's own: its geometry is linear in any mechanism.
    tangent : bool
        Whether its frame is on the tangent at its first end.
    slope : (k,) array
        Largest along it, in its frame [rad].
    shortening : (k,) array
        1/2 int slope^2 dx [m]; NaN of a modal body.
    axial : (k,) array
        Axial force where it is largest, over the buckling load of the body as its frame holds it; positive in
        tension; NaN of a modal body.
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
    """How a flexible body bent over a run of one or more samples."""
    body, described = system.body(name), system.mechanism.body(name)
    u, line = solution.q[:, body.flexible], _line(body, described)
    given = not isinstance(described, FlexibleBeam)
    tangent = not given and described.reference is ReferenceCondition.CANTILEVER
    slopes = u @ line.slopes.T
    # Slopes are largest at ends more often than not, and Gauss points stop short of them.
    ends = u @ (body.shape.slopes @ body.integrals.D).T
    slope = np.maximum(np.max(np.abs(slopes), axis=1, initial=0.0), np.max(np.abs(ends), axis=1, initial=0.0))
    shortening = axial = np.full(solution.t.size, np.nan)
    if line.weights.size:
        shortening = 0.5 * slopes**2 @ line.weights
        axial = _axial_force(system, body, line, solution) / _buckling_load(body, line)
    whole = system.carrier(name)[0]
    return Bending(whole, len(system.parts(whole)), body.points is None, given, tangent, slope, shortening, axial)


class _Line(NamedTuple):
    """Stations along a body: weights of an integral over its length [m], slopes and strains per coordinate, E A [N].

    Of a modal body there are none.
    """

    weights: Array
    slopes: Array
    strains: Array
    stiffness: Array


def _line(body: BodyCoordinates, described: Body) -> _Line:
    """Gauss points of a beam, or of a bar of assumed modes."""
    D = body.integrals.D
    if isinstance(described, FlexibleBeam):
        mesh, spans = described.mesh, described.spans
        lengths = np.diff(mesh.nodes)
        weights = (0.5 * lengths[:, None] * _WEIGHTS).ravel()
        places = [0.5 * length * (_POINTS + 1.0) for length in lengths]
        rows = [mesh.scatter(e, transverse_shape(x, lengths[e], derivative=1)) for e, x in enumerate(places)]
        stretch = np.diff(D[mesh.rows_of(AXIAL)], axis=0) / lengths[:, None]
        stiffness = np.array([spans[span].axial_stiffness for span in mesh.spans])
        each = np.repeat(np.arange(lengths.size), GAUSS_POINTS)
        return _Line(weights, np.concatenate(rows) @ D, stretch[each], stiffness[each])
    if isinstance(described, AssumedModesBeam):
        shapes = described.shapes
        x, weights = shapes.quadrature()
        bent = len(shapes.transverse)
        slopes = shapes.transverse_rows(x, derivative=1) @ D[:bent]
        strains = shapes.axial_rows(x, derivative=1) @ D[bent:]
        stiffness = span_properties(described.section, described.material).axial_stiffness
        return _Line(weights, slopes, strains, np.full(x.size, stiffness))
    none = np.zeros(0)
    return _Line(none, np.zeros((0, body.nf)), np.zeros((0, body.nf)), none)


def _buckling_load(body: BodyCoordinates, line: _Line) -> float:
    """Least uniform axial force under which the body buckles, held as its frame holds it [N].

    Coordinates are modes of stiffness omega^2: 1 / N is the largest eigenvalue of W^-1 G W^-1, W = diag(omega),
    G = int slope^T slope dx.
    """
    largest = np.linalg.norm(np.sqrt(line.weights)[:, None] * line.slopes / body.modes.omega, ord=2) ** 2
    return float(1.0 / largest) if largest > 0.0 else np.inf


def _axial_force(system: System, body: BodyCoordinates, line: _Line, solution: Solution) -> Array:
    """Axial force where it is largest, positive in tension (k,) [N].

    That of the stretch; where the coordinates do not stretch, as of a beam reduced to its lowest modes, the largest
    part along the body of its joints' forces, taken as compression.
    """
    # How much of what a uniform tension stretches is left in the coordinates.
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
            # Multipliers have a pole at singular positions: NaN there.
            largest = np.fmax(largest, np.abs(port["weight"] * (c * x + s * y)))
    return -largest
