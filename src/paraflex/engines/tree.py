"""Mechanism as a tree of bodies on hinges, for engines with joint coordinates, and the motion of its bodies."""

from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.errors import InputError
from paraflex.mechanism import GROUND, Joint, Mechanism, PointRef
from paraflex.tracking import TrackingTask


@dataclass(frozen=True)
class Link:
    """Body connected by a hinge to its parent in the tree, which may be the ground."""

    joint: Joint
    own: PointRef  # points of the hinge on the body and on the parent
    other: PointRef

    @property
    def name(self) -> str:
        """Name of the body."""
        return self.own.body

    @property
    def parent(self) -> str:
        """Name of the parent body, or of the ground."""
        return self.other.body

    @property
    def sign(self) -> float:
        """Sign of the joint angle relative to the hinge angle, which is that of the child relative to the parent."""
        return 1.0 if self.joint.b == self.own else -1.0


@dataclass(frozen=True)
class Tree:
    """Bodies on hinges, parents before children, and the joints that close loops.

    Attributes
    ----------
    links : tuple of Link
        One link per body, in the order of the coordinates, which are the hinge angles.
    closing : tuple of Joint
        Joints that close loops.
    angles : mapping of str to (links,) array
        Weights of the hinge angles in the angle of each body; zero for the ground.
    """

    links: tuple[Link, ...]
    closing: tuple[Joint, ...]
    angles: dict[str, Array]

    def relative_angle(self, joint: Joint) -> Array:
        """Return the weights (links,) of the hinge angles in the angle of a joint of the mechanism."""
        return self.angles[joint.b.body] - self.angles[joint.a.body]


def spanning_tree(mechanism: Mechanism) -> Tree:
    """Return a spanning tree from the ground, of joints with springs or gears first, then of those with motors.

    Raises
    ------
    InputError
        No joints connect a body with the ground.
    """
    from scipy.cluster.hierarchy import DisjointSet

    held = {spring.joint for spring in mechanism.springs} | {name for one in mechanism.relations for name in one.joints}
    driven = {motor.joint for motor in mechanism.motors}
    ranked = sorted(mechanism.joints, key=lambda joint: (joint.name not in held, joint.name not in driven))
    # Joints that connect separate parts are kept, in order; the others close loops (Kruskal).
    parts = DisjointSet([GROUND, *(body.name for body in mechanism.bodies)])
    kept = [joint for joint in ranked if parts.merge(joint.a.body, joint.b.body)]
    links: list[Link] = []
    angles = {GROUND: np.zeros(len(mechanism.bodies))}
    for own_angle in np.eye(len(mechanism.bodies)):
        hanging = (
            Link(joint, child, parent)
            for joint in kept
            for parent, child in ((joint.a, joint.b), (joint.b, joint.a))
            if parent.body in angles and child.body not in angles
        )
        link = next(hanging, None)
        if link is None:
            loose = next(body.name for body in mechanism.bodies if body.name not in angles)
            raise InputError("nothing joins it to the ground", field=f"body.{loose}", remedy="add a joint")
        links.append(link)
        angles[link.name] = angles[link.parent] + own_angle
    return Tree(tuple(links), tuple(joint for joint in ranked if joint not in kept), angles)


def joint_state(task: TrackingTask, tree: Tree) -> tuple[Array, Array]:
    """Return angles and rates of the hinges at the start of a task, each (links,)."""
    found = []
    for state in (task.start.q, task.start.v):
        angle = {GROUND: 0.0} | {body.name: state[body.angle] for body in task.system.bodies}
        found.append(np.array([angle[link.name] - angle[link.parent] for link in tree.links]))
    return found[0], found[1]


def body_motion(system: System, tree: Tree, hinges: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """Compute coordinates, velocities and accelerations of rigid bodies (k, n) from those of the hinges (k, links)."""
    k = hinges[0].shape[0]
    q, v, a = out = tuple(np.zeros((k, system.n)) for _ in range(3))

    def arm(ref: PointRef) -> tuple[Array, Array, Array]:
        """Return the vector from a body's origin to one of its points, with two derivatives."""
        angle = system.body(ref.body).angle
        x, y = system.marker(ref).x0
        c, s, w = np.cos(q[:, angle]), np.sin(q[:, angle]), v[:, angle, None]
        turned = np.column_stack([c * x - s * y, s * x + c * y])
        quarter = np.column_stack([-turned[:, 1], turned[:, 0]])
        return turned, w * quarter, a[:, angle, None] * quarter - w**2 * turned

    for link in tree.links:
        body = system.body(link.name)
        for values, angles in zip(out, hinges, strict=True):
            values[:, body.angle] = angles @ tree.angles[link.name]
        if link.parent == GROUND:
            hinge = [np.broadcast_to(system.marker(link.other).x0, (k, 2)), np.zeros((k, 2)), np.zeros((k, 2))]
        else:
            origin = system.body(link.parent).position
            hinge = [values[:, origin] + part for values, part in zip(out, arm(link.other), strict=True)]
        for values, there, part in zip(out, hinge, arm(link.own), strict=True):
            values[:, body.position] = there - part
    return q, v, a
