"""Motion of rigid bodies and ANCF cables from the coordinates of Exudyn."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.dynamics.points import PointMotion, cross
from paraflex.fem import BeamMesh, SpanProperties
from paraflex.mechanism import Joint, PointRef
from paraflex.results.outlines import Outline, turned

Columns = Indices

# Numbers of Gauss points: those of Exudyn for a cable's virtual work, and those for a mass integrand of sixth degree.
_AXIAL_POINTS, _BENDING_POINTS, _MASS_POINTS = 5, 3, 4
# Cubic Hermite polynomials in z = x/L, ascending powers; position and slope of the first node, then of the second.
_CUBIC = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
# Power of L that scales each polynomial.
_LENGTH_POWER = np.array([0, 1, 0, 1])


class RigidState(NamedTuple):
    """Initial pose and velocity of a body [m, rad, m/s, rad/s]."""

    x: float
    y: float
    phi: float
    vx: float
    vy: float
    w: float

    def direction(self, x: float, y: float) -> tuple[list[float], list[float]]:
        """Return a vector of the body frame in the ground frame, and its rate."""
        c, s = float(np.cos(self.phi)), float(np.sin(self.phi))
        X, Y = c * x - s * y, s * x + c * y
        return [X, Y], [-self.w * Y, self.w * X]

    def point(self, x: float, y: float) -> tuple[list[float], list[float]]:
        """Return position [m] and velocity [m/s] of a point of the body frame."""
        (X, Y), (dX, dY) = self.direction(x, y)
        return [self.x + X, self.y + Y], [self.vx + dX, self.vy + dY]


@dataclass(frozen=True)
class Trajectory:
    """Results of Exudyn at its steps.

    Attributes
    ----------
    t : (k,) array
        Times of the steps [s].
    states : (3, k, n) array
        Coordinates and their first and second derivatives.
    multipliers : (k, m) array
        Multipliers with the sign convention of Exudyn.
    """

    t: Array
    states: Array
    multipliers: Array

    def thinned(self, every: int) -> "Trajectory":
        """Return the trajectory at every n-th step."""
        return Trajectory(self.t[::every], self.states[:, ::every], self.multipliers[::every])


class AngularMotion(NamedTuple):
    """Angle [rad], rate and angular acceleration of the material at a point, each (k,)."""

    angle: Array
    rate: Array
    acceleration: Array


@dataclass(frozen=True)
class Ground:
    """Ground of the mechanism, with the number of its object in the engine."""

    item: int
    points: Mapping[str, tuple[float, float]]
    start: ClassVar[float] = 0.0

    def place(self, point: str) -> dict[str, Any]:
        """Return the arguments of Exudyn for a marker at a named point."""
        return {"bodyNumber": self.item, "localPosition": [*self.points[point], 0.0]}

    def motion(self, point: str, history: Trajectory) -> PointMotion:
        """Return the motion of a named point, which is at rest."""
        still = np.zeros((history.t.size, 2))
        return PointMotion(still + self.points[point], still, still)

    def turn(self, point: str, history: Trajectory) -> AngularMotion:
        """Return zeros: the ground does not move."""
        return AngularMotion(*np.zeros((3, history.t.size)))


@dataclass(frozen=True)
class RigidLink:
    """Rigid body, with the coordinates of its centre of mass.

    Attributes
    ----------
    items : (int,)
        Number of the object in the engine.
    columns : (3,) array of int
        Indices of the coordinates x, y and angle.
    points : mapping
        Named points relative to the centre of mass, in the body frame [m].
    mass, inertia : float
        Mass [kg] and moment of inertia about the centre of mass [kg m^2].
    start : float
        Initial angle [rad].
    """

    items: tuple[int]
    columns: Columns
    points: Mapping[str, Array]
    mass: float
    inertia: float
    start: float
    # A cable has the positions and masses of its lumps.
    lumped: ClassVar[tuple[tuple[dict[str, Any], float], ...]] = ()

    def place(self, point: str) -> dict[str, Any]:
        """Return the arguments of Exudyn for a marker at a named point."""
        return {"bodyNumber": self.items[0], "localPosition": [*self.points[point], 0.0]}

    def motion(self, point: str, history: Trajectory) -> PointMotion:
        """Return the motion of a named point."""
        r, v, a = history.states[:, :, self.columns[:2]]
        angle, rate, acceleration = self.frame(history)
        x, y = self.points[point]
        c, s, w, dw = np.cos(angle), np.sin(angle), rate[:, None], acceleration[:, None]
        arm = np.column_stack([c * x - s * y, s * x + c * y])
        across = np.column_stack([-arm[:, 1], arm[:, 0]])
        return PointMotion(r + arm, v + w * across, a + dw * across - w**2 * arm)

    def curve(self, drawn: Outline, history: Trajectory) -> Array:
        """Return the positions of the stations of the body (k, s, 2) [m]."""
        # Any point gives the offset of the body frame from the centre of mass.
        point, station = next(iter(drawn.points.items()))
        places = drawn.places - drawn.places[station] + self.points[point]
        return turned(history.states[0][:, self.columns[:2]], self.frame(history).angle, places)

    def turn(self, point: str, history: Trajectory) -> AngularMotion:
        """Return the rotation of the material at a named point."""
        return self.frame(history)

    def frame(self, history: Trajectory) -> AngularMotion:
        """Return the rotation of the body."""
        return AngularMotion(*history.states[:, :, self.columns[2]])

    def chord(self, history: Trajectory) -> AngularMotion:
        """Return the rotation of the body."""
        return self.frame(history)

    def tip(self, history: Trajectory) -> Array:
        """Return zeros: a rigid body has no deflection."""
        return np.zeros((history.t.size, 3))

    def weighted(self, history: Trajectory) -> Array:
        """Return the first moment of mass, in the ground frame (k, 2) [kg m]."""
        return self.mass * history.states[0][:, self.columns[:2]]

    def kinetic_energy(self, history: Trajectory) -> Array:
        """Return the kinetic energy of the body (k,) [J]."""
        return 0.5 * history.states[1][:, self.columns] ** 2 @ [self.mass, self.mass, self.inertia]

    def strain_energy(self, history: Trajectory) -> Array:
        """Return zeros: a rigid body has no strain energy."""
        return np.zeros(history.t.size)


@dataclass(frozen=True)
class Cable:
    """Chain of ANCF cable elements, cubic in the positions r and slope vectors r' = dr/dx of the nodes.

    Attributes
    ----------
    mesh : BeamMesh
        Mesh of the beam.
    spans : tuple of SpanProperties
        Mass and stiffness of each element.
    items : tuple of int
        Numbers of the elements in the engine.
    columns : (2 nodes, 2) array of int
        Indices of the coordinates x and y of r and r', alternating node by node.
    lumps : (nodes, 2) array
        Lumped mass and moment of inertia at each node [kg, kg m^2].
    start : float
        Initial angle [rad].
    """

    mesh: BeamMesh
    spans: tuple[SpanProperties, ...]
    items: tuple[int, ...]
    columns: Columns
    lumps: Array
    start: float

    @property
    def points(self) -> Mapping[str, int]:
        """Node of each named point."""
        return self.mesh.points

    def place(self, point: str) -> dict[str, Any]:
        """Return the arguments of Exudyn for a marker at a named point."""
        return self._at(self.points[point])

    def _at(self, node: int) -> dict[str, Any]:
        element = min(node, self.mesh.n_elements - 1)
        along = float(self.mesh.nodes[node] - self.mesh.nodes[element])
        return {"bodyNumber": self.items[element], "localPosition": [along, 0.0, 0.0]}

    def motion(self, point: str, history: Trajectory) -> PointMotion:
        """Return the motion of a named point."""
        return PointMotion(*history.states[:, :, self.columns[2 * self.points[point]]])

    def curve(self, drawn: Outline, history: Trajectory) -> Array:
        """Return the positions of the stations of the centre line (k, s, 2) [m]."""
        x, nodes = drawn.places[:, 0], self.mesh.nodes
        element = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, self.mesh.n_elements - 1)
        rows = np.zeros((x.size, len(self.columns)))
        for i, (e, along) in enumerate(zip(element, x - nodes[element], strict=True)):
            length = float(nodes[e + 1] - nodes[e])
            rows[i, 2 * e : 2 * e + 4] = _shape(np.array([along / length]), length, 0)
        return rows @ history.states[0][:, self.columns]

    def turn(self, point: str, history: Trajectory) -> AngularMotion:
        """Return the rotation of the tangent at a named point."""
        return self._tangent(self.points[point], history)

    def frame(self, history: Trajectory) -> AngularMotion:
        """Return the rotation of the tangent at the first end."""
        return self._tangent(0, history)

    def chord(self, history: Trajectory) -> AngularMotion:
        """Return the rotation of the chord from the first to the last end."""
        return turn_of(self.start, *self._line(history))

    def tip(self, history: Trajectory) -> Array:
        """Return axial and transverse displacement and slope (k, 3) of the last end from the tangent at the first."""
        phi = self.frame(history).angle
        x, y = self._line(history)[0].T
        c, s = np.cos(phi), np.sin(phi)
        slope = self._tangent(-1, history).angle - phi
        return np.column_stack([c * x + s * y - self.mesh.length, c * y - s * x, slope])

    @property
    def lumped(self) -> list[tuple[dict[str, Any], float]]:
        """Positions and masses of the lumps."""
        return [(self._at(node), float(mass)) for node, (mass, _) in enumerate(self.lumps) if mass > 0.0]

    def weighted(self, history: Trajectory) -> Array:
        """Return the first moment of mass, in the ground frame (k, 2) [kg m]."""
        q = history.states[0][:, self.columns]
        weights, rows = self._weights("mass_per_length", _MASS_POINTS), self._rows(_MASS_POINTS, 0)
        return weights @ (rows @ q) + self.lumps[:, 0] @ q[:, ::2]

    def kinetic_energy(self, history: Trajectory) -> Array:
        """Compute 1/2 int rho A |r_t|^2 dx, plus 1/2 m |r_t|^2 + 1/2 J |r'_t|^2 of the lumps [J]."""
        weights, rows = self._weights("mass_per_length", _MASS_POINTS), self._rows(_MASS_POINTS, 0)
        mass = np.diag(self.lumps.ravel()) + (rows.T * weights) @ rows
        v = history.states[1][:, self.columns]
        return 0.5 * np.sum(v * (mass @ v), axis=(1, 2))

    def strain_energy(self, history: Trajectory) -> Array:
        """Compute 1/2 int EA (|r'| - 1)^2 + EI (r' x r'' / |r'|^2)^2 dx [J]."""
        q = history.states[0][:, self.columns]
        strain = np.linalg.norm(self._rows(_AXIAL_POINTS, 1) @ q, axis=2) - 1.0
        axial = strain**2 @ self._weights("axial_stiffness", _AXIAL_POINTS)
        first, second = (self._rows(_BENDING_POINTS, order) @ q for order in (1, 2))
        curvature = cross(first, second) / np.sum(first**2, axis=2)
        return 0.5 * (axial + curvature**2 @ self._weights("bending_stiffness", _BENDING_POINTS))

    def rounding(self, reference: Array) -> float:
        """Return the largest rounding error of the axial force, EA times that of positions over element length [N]."""
        far = float(np.max(np.abs(reference[self.columns[::2]])))
        stiffest = float(np.max([span.axial_stiffness for span in self.spans] / np.diff(self.mesh.nodes)))
        return float(np.finfo(float).eps) * stiffest * far

    def _tangent(self, node: int, history: Trajectory) -> AngularMotion:
        return turn_of(self.start, *history.states[:, :, self.columns[1::2][node]])

    def _line(self, history: Trajectory) -> Array:
        """Return the vector from the first to the last end, with two derivatives (3, k, 2)."""
        return history.states[:, :, self.columns[-2]] - history.states[:, :, self.columns[0]]

    def _weights(self, quantity: str, count: int) -> Array:
        """Return Gauss weights [m] along the beam times a property of its elements."""
        weights = np.polynomial.legendre.leggauss(count)[1]
        values = np.repeat([getattr(span, quantity) for span in self.spans], count)
        return np.outer(0.5 * np.diff(self.mesh.nodes), weights).ravel() * values

    def _rows(self, count: int, order: int) -> Array:
        """Return rows from r and r' at the nodes to a derivative of r at the Gauss points."""
        z, lengths = np.polynomial.legendre.leggauss(count)[0], np.diff(self.mesh.nodes)
        rows = np.zeros((lengths.size, count, len(self.columns)))
        for element, length in enumerate(lengths):
            rows[element, :, 2 * element : 2 * element + 4] = _shape(0.5 * (z + 1.0), length, order)
        return rows.reshape(-1, len(self.columns))


Link = RigidLink | Cable


@dataclass(frozen=True)
class Linkage:
    """Ground and bodies of a mechanism, in its order."""

    ground: Ground
    bodies: Mapping[str, Link]

    def part(self, ref: PointRef) -> Link | Ground:
        """Return the body of a point, or the ground."""
        return self.ground if ref.on_ground else self.bodies[ref.body]

    def motion(self, ref: PointRef, history: Trajectory) -> PointMotion:
        """Return the motion of a named point."""
        return self.part(ref).motion(ref.point, history)

    def gap(self, joint: Joint, history: Trajectory) -> Array:
        """Return the vector from point a to point b of a joint, with two derivatives (3, k, 2)."""
        return np.subtract(self.motion(joint.b, history), self.motion(joint.a, history))

    def joint_turn(self, joint: Joint, history: Trajectory) -> AngularMotion:
        """Return the rotation of the material at point b of a joint relative to that at point a."""
        a, b = (self.part(ref).turn(ref.point, history) for ref in (joint.a, joint.b))
        return AngularMotion(*np.subtract(b, a))


def turn_of(start: float, d: Array, v: Array, a: Array) -> AngularMotion:
    """Return the continuous angle of a vector d (k, 2), which begins near `start` [rad], with two derivatives.

    v and a are the first and second derivatives of d.
    """
    angle = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    angle += 2.0 * np.pi * np.round((start - angle[:1]) / (2.0 * np.pi))
    square = np.sum(d**2, axis=1)
    rate = cross(d, v) / square
    return AngularMotion(angle, rate, (cross(d, a) - 2.0 * rate * np.sum(d * v, axis=1)) / square)


def _shape(z: Array, length: float, order: int) -> Array:
    """Evaluate the cubic shape functions (points, 4), or one of their x-derivatives, at x = z L."""
    coefficients = np.polynomial.polynomial.polyder(_CUBIC, order, axis=1)
    return np.polynomial.polynomial.polyval(z, coefficients.T).T * float(length) ** (_LENGTH_POWER - order)
