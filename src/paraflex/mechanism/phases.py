"""Phases of gears and other relations, by the first assembly."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

from paraflex.errors import InputError
from paraflex.mechanism.gears import Relation
from paraflex.mechanism.groups import Group, groups_of
from paraflex.mechanism.joints import Joint, PointRef
from paraflex.mechanism.members import Members
from paraflex.mechanism.poses import Place, Pose, approximate_poses, local_points, placed_in, placed_poses


def with_phases(mechanism: Members) -> dict[str, tuple[Relation, ...]]:
    """The relations of a mechanism by the fields that have them, each with its phase.

    Raises
    ------
    InputError
        One without a phase where there is no assembly to take it from.
    """
    found = {}
    for name, group in groups_of(type(mechanism)).items():
        if group.relates:
            members = getattr(mechanism, name)
            found[name] = tuple(_with_phase(mechanism, group, one) if one.phase is None else one for one in members)
    return found


def _with_phase(mechanism: Members, group: Group, relation: Any) -> Any:
    """A relation with its phase in the first assembly."""
    field = f"{group.table}.{relation.name}.phase"
    if not mechanism.assemblies:
        raise InputError(
            f"a {group.word}'s phase is not given, and there is no assembly to take it from", field=field,
            remedy="give it in rad (in m where the second joint slides), or an [assembly.NAME] table",
        )  # fmt: skip
    assembly = mechanism.assemblies[0]
    poses = approximate_poses(mechanism, assembly) | placed_poses(mechanism, assembly)
    first, second = (joint_value(mechanism, mechanism.joint(name), poses) for name in relation.joints)
    if first is None or second is None:
        raise InputError(
            f"a {group.word}'s phase is not given, and assembly {assembly.name} does not determine its joints",
            field=field, remedy="give it, or places of points in the assembly",
        )  # fmt: skip
    return replace(relation, phase=second - relation.transmission * first)


def joint_value(mechanism: Members, joint: Joint, poses: dict[str, Pose]) -> float | None:
    """A joint's angle or travel at approximate poses of the bodies; None if a place is not known."""

    def angle(ref: PointRef) -> float:
        return 0.0 if ref.on_ground else poses[ref.body].angle

    def place(ref: PointRef) -> Place | None:
        if ref.on_ground:
            return mechanism.ground[ref.point]
        pose = poses[ref.body]
        return None if pose.position is None else placed_in(pose, local_points(mechanism.body(ref.body))[ref.point])

    if not joint.slides:
        return angle(joint.b) - angle(joint.a)
    a, b, direction = place(joint.a), place(joint.b), angle(joint.a) + joint.direction
    if a is None or b is None:
        return None
    return cos(direction) * (b[0] - a[0]) + sin(direction) * (b[1] - a[1])
