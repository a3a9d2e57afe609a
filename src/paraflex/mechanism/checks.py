"""Structural checks of a mechanism. A mechanism that passes all of them can be assembled into a system."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from paraflex.contexts import holding
from paraflex.errors import InputError, suggestion
from .bodies import FlexibleBeam
from .body_checks import check_body
from .groups import Group, grouped, groups_of
from .joints import GROUND, PointRef, points_named
from .laws import MotionQuantity
from .members import Assembly, Members
from .poses import approximate_poses, placed_poses
from .quantities import JointThat, check_numbers, finite, joints_named, known
from .rotors import check_actuators
from .sensors import Sensor

_LOOSE: ContextVar[bool] = ContextVar("loose", default=False)


def check_mechanism(mechanism: Members) -> None:
    """Run all structural checks.

    Raises
    ------
    InputError
        The first check that fails.
    """
    check_names(mechanism)
    for body in mechanism.bodies:
        check_body(body)
    for name, position in mechanism.ground.items():
        finite(position, f"ground.{name}")
    check_joints(mechanism)
    check_members_at_joints(mechanism)
    check_relations(mechanism)
    check_assemblies(mechanism)
    if not _LOOSE.get():
        check_connected(mechanism)
    check_task(mechanism)
    check_loads(mechanism)
    for sensor in mechanism.sensors:
        _check_measured(mechanism, sensor)
    check_actuators(mechanism)


def check_names(mechanism: Members) -> None:
    """Check that names are admissible and unique in each group, none is "ground", and there is at least one body."""
    for group, members in grouped(mechanism):
        counts = Counter(member.name for member in members)
        for name, count in counts.items():
            if count > 1:
                raise InputError("duplicate name", field=group.table, value=name, remedy="rename one of them")
            if not name or "." in name or name == GROUND:
                raise InputError(
                    "not usable as a name", field=group.table, value=name, remedy=f'avoid dots, blanks and "{GROUND}"'
                )
    if not mechanism.bodies:
        raise InputError("a mechanism needs at least one body", field="body", remedy="add a beam or a rigid body")


def check_joints(mechanism: Members) -> None:
    """Check that joints refer to existing points of two bodies, and that joints along beams slide on a beam."""
    for joint in mechanism.joints:
        field = f"joint.{joint.name}"
        _two_bodies(mechanism, joint.a, joint.b, field, "a joint", "one side must lie on another body or on the ground")
        if joint.follows_beam:
            body = None if joint.a.on_ground else mechanism.body(joint.a.body)
            if not isinstance(body, FlexibleBeam):
                raise InputError(
                    f"a {joint.kind} joint needs a beam to slide on",
                    field=field,
                    value=str(joint.a),
                    remedy='name a point of a beam first; on other bodies use a "slot"',
                )
        check_numbers(joint, field)


def check_members_at_joints(mechanism: Members) -> None:
    """Check that members at joints refer to joints with the required motion, and actuation modes to motors."""
    for group, members in grouped(mechanism):
        for member in members:
            _check_joints_of(mechanism, member, group)
    motors = [motor.name for motor in mechanism.motors]
    for mode in mechanism.modes:
        for name in mode.motors:
            known(name, motors, f"mode.{mode.name}", "motor")


def _check_joints_of(mechanism: Members, member: Any, group: Group) -> None:
    for name, joint, does in joints_named(member):
        known(joint, mechanism.joints_by_name, field := f"{group.table}.{member.name}.{name}", "joint")
        mechanism.joints_by_name[joint].check_moves(field, does)


def check_relations(mechanism: Members) -> None:
    """Check that gears and the like relate two different joints."""
    for group, members in grouped(mechanism):
        for one in members if group.relates else ():
            if len(one.joints) < 2:
                raise InputError(
                    f"a {group.noun} needs two different joints", field=f"{group.table}.{one.name}.joints",
                    value=", ".join(one.joints), remedy="name the two whose angles or travels are coupled",
                )  # fmt: skip


def check_assemblies(mechanism: Members) -> None:
    """Check that assemblies refer to bodies and points of bodies, and determine the angle of every body."""
    bodies = {body.name: body for body in mechanism.bodies}
    for assembly in mechanism.assemblies:
        for name, angle in assembly.angles.items():
            known(name, bodies, f"assembly.{assembly.name}", "body")
            finite([angle], f"assembly.{assembly.name}.{name}")
        for ref, place in assembly.points.items():
            field = f"assembly.{assembly.name}.points"
            known_point(mechanism, ref, field)
            finite(place, f"{field}.{ref}")
            _on_body(ref, field, "the places of ground points are given in [ground]")
        # Raises an error with the name of a body whose angle is not determined.
        approximate_poses(mechanism, assembly)
        _check_suspended(mechanism, assembly)


def _check_suspended(mechanism: Members, assembly: Assembly) -> None:
    """Check that bodies with distance joints only have a position, unless the mechanism was derived from another."""
    hung = [name for name, joints in mechanism.joints_at.items() if {each.holds for each in joints} == {("distance",)}]
    placed = placed_poses(mechanism, assembly) if hung and mechanism.cut is None else hung
    for name in (name for name in hung if name not in {GROUND, *placed}):
        raise InputError(
            "distances alone do not determine a body's place", field=f"assembly.{assembly.name}.points", value=name,
            remedy=f'give the place of one of its points: points = {{"{name}.POINT" = [x, y]}}',
        )  # fmt: skip


@contextmanager
def loose_bodies() -> Iterator[None]:
    """Accept bodies that no joint connects with the ground, as a drawing has them before it is finished."""
    with holding(_LOOSE, True):
        yield


def check_connected(mechanism: Members) -> None:
    """Check that joints connect every body with the ground, or all bodies with one another if none is on the ground."""
    start = GROUND if mechanism.joints_at[GROUND] else mechanism.bodies[0].name
    reached = mechanism.reached(start)
    lost = [body.name for body in mechanism.bodies if body.name not in reached]
    if lost:
        raise InputError(
            "the mechanism is not connected",
            field="joint",
            value=", ".join(lost),
            remedy=f"join it to {start} or to a body that is",
        )


def check_task(mechanism: Members) -> None:
    """Check that the end-effector is a point of a body."""
    if mechanism.end_effector is not None:
        point, field = mechanism.end_effector.point, "end_effector.point"
        known_point(mechanism, point, field)
        _on_body(point, field, "the end-effector is a point of the ground, which does not move")


def check_loads(mechanism: Members) -> None:
    """Check that loads and gravity are finite, and that loads act on bodies."""
    finite(mechanism.gravity, "gravity")
    for group, members in grouped(mechanism):
        for member in members if group.kinds else ():
            _check_points_of(mechanism, group, member)
    places = [(f"load.{load.name}", law) for load in mechanism.loads for law in load.laws]
    places += [(f"linear_spring.{one.name}", law) for one in mechanism.linear_springs for law in one.laws]
    places += [(f"spring.{one.name}", one.torque) for one in mechanism.springs if one.torque is not None]
    for place, law in places:
        for quantity in law.quantities.values():
            _check_quantity(
                mechanism, quantity, law.field if law.field.startswith("spring.") else f"{place}.{law.field}"
            )


def _check_quantity(mechanism: Members, quantity: MotionQuantity, field: str) -> None:
    """Check that the joint or point of a quantity exists, and that the joint has such a coordinate."""
    if quantity.point is not None:
        known_point(mechanism, quantity.point, field)
        return
    if quantity.spring:
        known(quantity.spring, [one.name for one in mechanism.linear_springs], field, "spring between points")
        return
    known(quantity.joint, mechanism.joints_by_name, field, "joint")
    does: dict[str, JointThat] = {"angle": "turns", "travel": "slides", "rate": "moves"}
    mechanism.joint(quantity.joint).check_moves(field, does[quantity.word])


def _check_points_of(mechanism: Members, group: Group, member: Any) -> None:
    field, points = f"{group.table}.{member.name}", points_named(member)
    if "a" in points:
        remedy = "one end must be on another body or on the ground"
        _two_bodies(mechanism, member.a, member.b, f"{field}.points", f"a {group.noun}", remedy)
    for name, point in points.items():
        if name not in ("a", "b"):
            known_point(mechanism, point, f"{field}.{name}")
            _on_body(point, f"{field}.{name}", "the ground does not move")
    if "reaction" in points and points["reaction"] == points["point"]:
        problem, remedy = "at its own point the opposite leaves no load", "name a point of another body"
        raise InputError(problem, field=f"{field}.reaction", value=str(points["reaction"]), remedy=remedy)
    check_numbers(member, field)


def check_sensor(mechanism: Members, sensor: Sensor) -> None:
    """Check that the joints, points, body and position of a sensor exist in a mechanism and can be measured.

    Raises
    ------
    InputError
        One of them does not exist or is not of the required kind.
    """
    group = groups_of(type(mechanism))["sensors"]
    _check_joints_of(mechanism, sensor, group)
    _check_points_of(mechanism, group, sensor)
    _check_measured(mechanism, sensor)


def _check_measured(mechanism: Members, sensor: Sensor) -> None:
    """Check what a sensor measures, and its location, which a class of the user's own defines."""
    field = f"sensor.{sensor.name}"
    sensor.check(mechanism, field)
    location = sensor.location
    known(location.frame, mechanism.points, f"{field}.location.frame", "body")
    if location.point is not None:
        known_point(mechanism, location.point, f"{field}.location.point")
    elif location.at is None:
        known(location.joint, mechanism.joints_by_name, f"{field}.location.joint", "joint")


def _two_bodies(mechanism: Members, a: PointRef, b: PointRef, field: str, what: str, remedy: str) -> None:
    known_point(mechanism, a, field)
    known_point(mechanism, b, field)
    if a.body == b.body:
        raise InputError(f"{what} needs two different bodies", field=field, value=f"{a}, {b}", remedy=remedy)


def _on_body(ref: PointRef, field: str, problem: str) -> None:
    if ref.on_ground:
        raise InputError(problem, field=field, value=str(ref), remedy="name a body's point")


def known_point(mechanism: Members, ref: PointRef, field: str) -> None:
    """Raise an `InputError` unless the mechanism has a point."""
    points = mechanism.points
    known(ref.body, points, field, "body")
    if ref.point not in points[ref.body]:
        remedy = suggestion(ref.point, points[ref.body]) if points[ref.body] else "add it to the table [ground]"
        raise InputError("unknown point", field=field, value=str(ref), remedy=remedy)
