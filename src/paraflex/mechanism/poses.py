"""Approximate poses of bodies from the angles and the point positions of an assembly, by way of the joints."""

from collections.abc import Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from math import atan2, cos, hypot, sin

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from .bodies import Body, RigidBody
from .joints import GROUND, PointRef
from .members import Assembly, Members
from .modal import ModalBody

Place = tuple[float, float]
# Points of a body closer than this fraction of its size do not determine its angle.
_SAME_PLACE = 1e-9


@dataclass(frozen=True)
class Pose:
    """Angle of a body [rad], and the position of its frame's origin [m] if points determine it."""

    angle: float
    position: Place | None = None

    def place_of(self, local: Place) -> Place:
        """Return the position of a point of the undeformed body in the ground frame [m]."""
        assert self.position is not None
        c, s = cos(self.angle), sin(self.angle)
        return self.position[0] + c * local[0] - s * local[1], self.position[1] + s * local[0] + c * local[1]


@checked_arguments()
def approximate_poses(mechanism: Members, assembly: Assembly) -> dict[str, Pose]:
    """Compute the pose of every undeformed body, its angle as given or from two known points.

    Known points are those on the ground, those that the assembly gives, points joined to known ones, and all points of
    a body whose pose is known.

    Raises
    ------
    InputError
        The angle of a body is neither given nor determined by points.
    """
    poses: dict[str, Pose] = {name: Pose(angle) for name, angle in assembly.angles.items()}
    if assembly.points:
        poses |= _from_points(mechanism, assembly.angles, assembly.points)
    for body in mechanism.bodies:
        if body.name not in poses:
            hint = _joined(mechanism, body.name)
            remedy = f"give its approximate angle in rad, or the places of two of its points{hint}"
            raise InputError("no angle for a body", field=f"assembly.{assembly.name}", value=body.name, remedy=remedy)
    return poses


def placed_poses(mechanism: Members, assembly: Assembly) -> dict[str, Pose]:
    """Compute poses with the positions that follow from the angles, without closing loops.

    A slider that is held by nothing else is placed at the start of its axis.

    Raises
    ------
    InputError
        See `approximate_poses`.
    """
    angles = {name: pose.angle for name, pose in approximate_poses(mechanism, assembly).items()}
    return _from_points(mechanism, angles, assembly.points, sliding=True)


def _joined(mechanism: Members, body: str) -> str:
    """Return a hint for the error message about a body with fewer than two joints: one may be missing."""
    names = [joint.name for joint in mechanism.joints_at[body]]
    if not names:
        return "; no joint holds it: is one missing?"
    return f"; {names[0]} alone holds it: is a joint missing?" if len(names) == 1 else ""


def _from_points(
    mechanism: Members, angles: Mapping[str, float], points: Mapping[PointRef, Place], *, sliding: bool = False
) -> dict[str, Pose]:
    """Return poses with positions, by iteration over joints and bodies; sliding joints are used last, if at all."""
    poses: dict[str, Pose] = {}
    known = {PointRef(GROUND, name): place for name, place in mechanism.ground.items()} | dict(points)
    locals_of = [local_points(body) for body in mechanism.bodies]
    index = {body.name: i for i, body in enumerate(mechanism.bodies)}
    # Other joints do not determine the position of a point.
    for determining in ({"points"}, {"points", "axis"})[: 1 + sliding]:
        joints = [joint for joint in mechanism.joints if determining.intersection(joint.holds)]
        joints_at: dict[PointRef, list[int]] = {}
        for k, joint in enumerate(joints):
            for ref in (joint.a, joint.b):
                joints_at.setdefault(ref, []).append(k)
        # Joints and bodies with a point that became known, each in the order of the mechanism.
        waiting, changed = list(range(len(joints))), set(range(len(mechanism.bodies)))
        while waiting or changed:
            later: set[int] = set()
            while waiting:
                k = heappop(waiting)
                for one, other in ((joints[k].a, joints[k].b), (joints[k].b, joints[k].a)):
                    if one in known and other not in known:
                        known[other] = known[one]
                        changed.update({index[other.body]} if other.body in index else ())
                        for neighbour in joints_at[other]:
                            if neighbour > k:
                                heappush(waiting, neighbour)
                            else:
                                later.add(neighbour)
            for i in sorted(changed):
                body, local = mechanism.bodies[i], locals_of[i]
                if body.name not in poses:
                    found = {name: known[ref] for name in local if (ref := PointRef(body.name, name)) in known}
                    if sliding:
                        # One point only: approximate angles leave a gap, which is then at a single joint.
                        found = dict([*found.items()][:1])
                    if found and (pose := _fit(local, found, angles.get(body.name))):
                        poses[body.name] = pose
                        for name, place in local.items():
                            ref = PointRef(body.name, name)
                            known.setdefault(ref, pose.place_of(place))
                            later.update(joints_at.get(ref, ()))
            waiting, changed = sorted(later), set()
    return poses


def local_points(body: Body) -> Mapping[str, Place]:
    """Return the named points of the undeformed body in its frame [m]."""
    if isinstance(body, RigidBody):
        return body.points
    if isinstance(body, ModalBody):
        return {name: (float(point.position[0]), float(point.position[1])) for name, point in body.points.items()}
    return {name: (x, 0.0) for name, x in body.points.items()}


def _fit(local: Mapping[str, Place], found: Mapping[str, Place], angle: float | None) -> Pose | None:
    """Return the least-squares pose for the known positions of a body's points; None if these are too few."""
    cx, cy = (sum(local[name][k] for name in found) / len(found) for k in range(2))
    gx, gy = (sum(place[k] for place in found.values()) / len(found) for k in range(2))
    if angle is None:
        arms = [(local[name][0] - cx, local[name][1] - cy, x - gx, y - gy) for name, (x, y) in found.items()]
        size = max(hypot(x - cx, y - cy) for x, y in local.values())
        if max(min(hypot(ax, ay), hypot(bx, by)) for ax, ay, bx, by in arms) <= _SAME_PLACE * size:
            return None
        angle = atan2(
            sum(ax * by - ay * bx for ax, ay, bx, by in arms), sum(ax * bx + ay * by for ax, ay, bx, by in arms)
        )
    turned = Pose(angle, (0.0, 0.0)).place_of((cx, cy))
    return Pose(angle, (gx - turned[0], gy - turned[1]))
