"""Distance of a pose from a singular configuration, of the constraints or of the mechanism with motors held."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paraflex.arrays import Array, Indices, Numbers
from .joint_coordinates import joint_rows
from .system import System

# Rows with a smaller singular value than this are redundant at all poses; closure errors are far smaller.
_DEPENDENT = 1e-6


@dataclass(frozen=True)
class SingularityMeasure:
    """Dimensionless distance from a singular configuration: 0 there, at most 1.

    The matrix has the rows of Phi_q and, with motors, those of their joint coordinates, restricted to the motion of
    bodies that keep their present shape: flexible bodies yield at a singular configuration and hide it. Lengths are
    scaled by kinetic energy, rows to length one. The measure is a singular value of this matrix:

    - Constraints alone: the smallest that is not zero at the start; rows that are redundant at all poses are left out.
      It is zero where constraints lose rank.
    - With motors: the smallest of all columns, which bounds from below how much a motion of unit energy turns held
      motors or opens joints. It is zero where the mechanism can move with motors held (Type II), and if there are too
      few motors.

    Attributes
    ----------
    system : System
        System of the mechanism.
    start : (n,) array
        Coordinates of a pose that is not singular.
    motors : tuple of str
        Motors that are held; none by default, for the constraints alone.
    """

    system: System
    start: Array
    motors: tuple[str, ...] = ()

    def __call__(self, q: Array) -> Array:
        """Return the distances (k,) of poses (k, n)."""
        if self._number == 0:
            return np.zeros(len(q)) if self.motors else np.ones(len(q))
        return np.array([self._values(pose)[self._number - 1] for pose in q])

    @cached_property
    def _number(self) -> int:
        """Number of the singular value, counted from the largest; 0 for none."""
        values, columns = self._values(self.start), 3 * len(self.system.bodies)
        if self.motors:
            return columns if values.size == columns else 0
        return int(np.sum(values > _DEPENDENT))

    def _values(self, q: Array) -> Numbers:
        """Return the singular values of the matrix by motions of the bodies' centres of mass, scaled by inertia."""
        rows, (at, root_m, root_J, cx, cy) = self._rows(q), self._bodies
        x, y, turn = rows[:, at], rows[:, at + 1], rows[:, at + 2]
        c, s = np.cos(q[at + 2]), np.sin(q[at + 2])
        arm_x, arm_y = c * cx - s * cy, s * cx + c * cy
        about = turn + x * arm_y - y * arm_x
        scaled = np.hstack([x / root_m, y / root_m, about / root_J])
        return np.linalg.svd(scaled / np.linalg.norm(scaled, axis=1, keepdims=True), compute_uv=False)

    def _rows(self, q: Array) -> Array:
        jacobian = self.system.jacobian(q)[self.system.constrained]
        if not self.motors:
            return jacobian
        return np.vstack([jacobian, self._turning, joint_rows(self.system, self._joints(slides=True), q)])

    @cached_property
    def _turning(self) -> Array:
        """Rows of revolute joints, which do not depend on the pose."""
        return joint_rows(self.system, self._joints(slides=False), self.start)

    def _joints(self, *, slides: bool) -> list[str]:
        mechanism = self.system.mechanism
        joints = [motor.joint for motor in mechanism.motors if motor.name in self.motors]
        return [joint for joint in joints if mechanism.slides(joint) is slides]

    @cached_property
    def _bodies(self) -> tuple[Indices, Array, Array, Array, Array]:
        """Start of each body's coordinates, roots of its mass and inertia, centre of mass of the undeformed body."""
        bodies = self.system.bodies
        m = np.array([body.integrals.m for body in bodies])
        cx, cy = (np.array([body.integrals.S1[k] for body in bodies]) / m for k in range(2))
        J = np.array([body.integrals.I0 + body.integrals.J for body in bodies]) - m * (cx**2 + cy**2)
        return np.array([body.offset for body in bodies]), np.sqrt(m), np.sqrt(J), cx, cy
