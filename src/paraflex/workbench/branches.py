"""Quantities whose signs tell the assemblies of a mechanism apart: angles of elbows, determinants of its closure."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.dynamics import System, joint_coordinate
from paraflex.mechanism import Joint, PointRef
from paraflex.mechanism.poses import local_points

# Directions from a joint to two others of a body within this angle are one line [rad].
_IN_LINE = 1e-6
# Bodies that move less than this with an elbow held belong to a loop of one freedom.
_HELD = 1e-8
# A dragged pose stays this far from a zero of a quantity, or half its first value; smaller first values have no sign.
MARGIN, NO_SIGN = 1e-4, 1e-7
# Value from which on a quantity without a sign at first has one.
_CLEAR = 1e-3


class Elbow(NamedTuple):
    """Revolute joint of two moving bodies that are links: the sine of the angle between them keeps its sign.

    The sine is that of q[b] - q[a] + offset; `text` describes the pose in which it is zero.
    """

    joint: str
    a: int
    b: int
    offset: float
    text: str


@dataclass
class Guard:
    """Quantity that keeps its sign during a drag, at a distance from zero.

    Attributes
    ----------
    value : callable
        Function from a pose (n,) to the quantity, dimensionless.
    text : str
        Description of the poses in which it is zero.
    sign : float
        Sign to be kept; 0 as long as the quantity has been too close to zero for one.
    margin : float
        Smallest distance from zero.
    """

    value: Callable[[Array], float]
    text: str
    sign: float = 0.0
    margin: float = field(default=MARGIN)

    def begin(self, q: Array) -> None:
        """Take the sign at a pose, if it has one."""
        value = self.value(q)
        if not self.sign and abs(value) > NO_SIGN:
            self.sign = float(np.sign(value))
        self.margin = min(self.margin, 0.5 * max(abs(value), NO_SIGN))

    def pass_by(self, q: Array) -> None:
        """Take the sign at a pose on the way, if there was none and it is clear now."""
        if not self.sign and abs(value := self.value(q)) > _CLEAR:
            self.sign = float(np.sign(value))

    def room(self, q: Array) -> float:
        """Return how far a pose is from the margin, negative beyond it; infinite without a sign."""
        return self.sign * self.value(q) - self.margin if self.sign else np.inf


@dataclass(frozen=True)
class Branches:
    """Elbows and determinants of a rigid system without prescribed motions.

    Attributes
    ----------
    system : System
        System of the rigid mechanism.
    freedoms : int
        Degrees of freedom.
    start : (n,) array
        Pose with closed loops.
    """

    system: System
    freedoms: int
    start: Array

    @cached_property
    def elbows(self) -> list[Elbow]:
        """All elbows."""
        return self.elbows_to("", np.zeros(2))

    def elbows_to(self, tip: str, local: Array) -> list[Elbow]:
        """Return all elbows, also of a body with one joint only, towards a point in its frame [m]."""
        found = [self._elbow(joint, tip, local) for joint in self.system.mechanism.joints]
        return [one for one in found if one is not None]

    @cached_property
    def independent(self) -> Indices:
        """Rows of the constraints that do not depend on others."""
        jacobian = self.system.dimensionless_jacobian(self.start)
        pivots = scipy.linalg.qr(jacobian.T, mode="r", pivoting=True)[1]
        return np.sort(np.asarray(pivots)[: self.system.n - self.freedoms])

    def free(self, q: Array) -> Array:
        """Return an orthonormal basis (n, freedoms) of the dimensionless motions at a pose."""
        return np.linalg.svd(self.system.dimensionless_jacobian(q))[2][self.system.n - self.freedoms :].T

    def guarded_elbows(self, *, chains: bool) -> list[Guard]:
        """Return guards of elbows in loops of several freedoms; of those in open chains too, if asked for.

        Links of a loop of one freedom pass each other in line as a crank turns: see `determinant`.
        """
        free = self.free(self.start)
        return [
            Guard(lambda q, one=one: float(np.sin(q[one.b] - q[one.a] + one.offset)), one.text)
            for one in self.elbows
            if self._moves_with_held(free, one) and (chains or self._in_loop(one.joint))
        ]

    def determinant(self, rows: Callable[[Array], Array], text: str) -> Guard:
        """Return a guard of the constraints together with as many more dimensionless rows as there are freedoms.

        Its value is the smallest singular value, of rows of length one, with the sign of the determinant.
        """

        def value(q: Array) -> float:
            matrix = np.vstack([self.system.dimensionless_jacobian(q)[self.independent], rows(q)])
            matrix /= np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), np.finfo(float).tiny)
            return float(np.linalg.slogdet(matrix)[0] * np.linalg.svd(matrix, compute_uv=False)[-1])

        return Guard(value, text)

    def joint_rows(self, names: list[str]) -> Callable[[Array], Array]:
        """Return the function that gives the dimensionless derivatives of joints' coordinates."""
        system = self.system
        slides = [name for name in names if system.mechanism.slides(name)]
        turning = np.array([joint_coordinate(system, name, self.start[None]).rows[0] for name in names])
        where = [names.index(name) for name in slides]

        def rows(q: Array) -> Array:
            found = turning * system.units
            for k, name in zip(where, slides, strict=True):
                found[k] = joint_coordinate(system, name, q[None]).rows[0] * system.units / system.size
            return found

        return rows

    def _elbow(self, joint: Joint, tip: str, local: Array) -> Elbow | None:
        """Return the elbow at a joint; None if a body is no link there."""
        if joint.holds != ("points",) or joint.a.on_ground or joint.b.on_ground or joint.a.body == joint.b.body:
            return None
        first, second = (self._arm(joint, ref, tip, local) for ref in (joint.a, joint.b))
        if first is None or second is None:
            return None
        (one, along), (other, beside) = first, second
        a, b = (self.system.body(ref.body).angle for ref in (joint.a, joint.b))
        text = f"{joint.a.body} and {joint.b.body} in line"
        if along != beside:
            link, slide = (joint.b, joint.a) if along else (joint.a, joint.b)
            text = f"{link.body} square to the slide of {slide.body}"
        return Elbow(joint.name, a, b, other - one, text)

    def _arm(self, joint: Joint, ref: PointRef, tip: str, local: Array) -> tuple[float, bool] | None:
        """Return the angle in a body's frame of its line from a joint to all its others, and whether one slides.

        A joint that slides lies at infinity, across its axis.
        """
        angles, slides, body = [], False, self.system.mechanism.body(ref.body)
        places = local_points(body)
        for other in self.system.mechanism.joints_at[ref.body]:
            own = other.a if other.a.body == ref.body else other.b
            if other.name == joint.name or places[own.point] == places[ref.point]:
                continue
            if other.slides:
                if "angle" not in other.holds:
                    return None
                angles.append(other.direction - (0.0 if own == other.a else other.angle) + 0.5 * np.pi)
                slides = True
            else:
                x, y = np.subtract(places[own.point], places[ref.point])
                angles.append(float(np.arctan2(y, x)))
        if not angles and ref.body == tip:
            x, y = local - places[ref.point]
            angles.append(float(np.arctan2(y, x)))
        if not angles or any(abs(np.sin(one - angles[0])) > _IN_LINE for one in angles):
            return None
        return angles[0], slides

    def _moves_with_held(self, free: Array, one: Elbow) -> bool:
        """Return whether the bodies of an elbow still move where it is held."""
        left = scipy.linalg.null_space((free[one.b] - free[one.a])[None])
        return left.size > 0 and bool(np.max(np.abs((free @ left)[[one.a, one.b]])) > _HELD)

    def _in_loop(self, name: str) -> bool:
        """Return whether other joints connect the bodies of a joint."""
        joint, joints = self.system.mechanism.joint(name), self.system.mechanism.joints
        reached, size = {joint.a.body}, 0
        while len(reached) > size:
            size = len(reached)
            for other in joints:
                ends = {other.a.body, other.b.body}
                if other.name != name and ends & reached:
                    reached |= ends
        return joint.b.body in reached
