"""Default phases of relations and lengths of distance joints, from the first assembly."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import cos, dist, sin
from typing import Any

from paraflex.errors import InputError
from .groups import Group, groups_of
from .joints import Joint, PointRef
from .members import Members
from .poses import Place, Pose, approximate_poses, local_points, placed_poses
from .quantities import positive

Poses = Callable[[], dict[str, Pose]]


def with_phases(mechanism: Members) -> dict[str, tuple[Any, ...]]:
    """Return the joints and relations of a mechanism by field, with their missing lengths and phases filled in.

    Raises
    ------
    InputError
        A length or phase is not given, and no assembly determines it.
    """
    first = mechanism.assemblies[:1]
    poses = cache(lambda: approximate_poses(mechanism, *first) | placed_poses(mechanism, *first))
    found: dict[str, tuple[Any, ...]] = {
        "joints": tuple(_with_length(mechanism, poses, one) if one.length is None else one for one in mechanism.joints)
    }
    for name, group in groups_of(type(mechanism)).items():
        if group.relates:
            members = getattr(mechanism, name)
            found[name] = tuple(
                _with_phase(mechanism, poses, group, one) if one.phase is None else one for one in members
            )
    return found


def _with_length(mechanism: Members, poses: Poses, joint: Any) -> Joint:
    """Return a distance joint with the distance of its points in the first assembly."""
    field = f"joint.{joint.name}.length"
    a, b = _in_first(mechanism, poses, "the length", field, "give it in m", _place, (joint.a, joint.b))
    positive(dist(a, b), field, f"m: {joint.a} and {joint.b} coincide in assembly {mechanism.assemblies[0].name}")
    return replace(joint, length=dist(a, b))


def _with_phase(mechanism: Members, poses: Poses, group: Group, relation: Any) -> Any:
    """Return a relation with its phase in the first assembly."""
    field, shares = f"{group.table}.{relation.name}.phase", relation.shares
    joints = [mechanism.joint(name) for name in shares]
    remedy = "give it in rad (in m where the second joint slides)"
    values = _in_first(mechanism, poses, f"a {group.noun}'s phase", field, remedy, joint_value, joints)
    return replace(relation, phase=sum(weight * value for weight, value in zip(shares.values(), values, strict=True)))


def _in_first(
    mechanism: Members, poses: Poses, what: str, field: str, remedy: str, value: Callable[..., Any], of: Any
) -> list[Any]:
    """Return values of points or joints in the first assembly, for a field that is not given."""
    if not mechanism.assemblies:
        raise InputError(
            f"{what} is not given, and there is no assembly to take it from", field=field,
            remedy=f"{remedy}, or an [assembly.NAME] table",
        )  # fmt: skip
    assembly = mechanism.assemblies[0]
    found = [value(mechanism, one, poses()) for one in of]
    if None in found:
        raise InputError(
            f"{what} is not given, and assembly {assembly.name} does not determine it",
            field=field, remedy="give it, or places of points in the assembly",
        )  # fmt: skip
    return found


def _place(mechanism: Members, ref: PointRef, poses: dict[str, Pose]) -> Place | None:
    """Return the position of a point at approximate poses of the bodies [m]; None if it is not known."""
    if ref.on_ground:
        return mechanism.ground[ref.point]
    pose = poses[ref.body]
    return None if pose.position is None else pose.place_of(local_points(mechanism.body(ref.body))[ref.point])


def joint_value(mechanism: Members, joint: Joint, poses: dict[str, Pose]) -> float | None:
    """Return a joint's angle [rad] or travel [m] at approximate poses; None if a pose or position is not known."""
    if any(not ref.on_ground and ref.body not in poses for ref in (joint.a, joint.b)):
        return None
    turn_a, turn_b = (0.0 if ref.on_ground else poses[ref.body].angle for ref in (joint.a, joint.b))
    if not joint.slides:
        return turn_b - turn_a
    a, b, direction = _place(mechanism, joint.a, poses), _place(mechanism, joint.b, poses), turn_a + joint.direction
    if a is None or b is None:
        return None
    return cos(direction) * (b[0] - a[0]) + sin(direction) * (b[1] - a[1])
