"""Phases of gears that are as an assembly stands."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin

from paraflex.errors import InputError
from paraflex.mechanism.gears import Gear
from paraflex.mechanism.joints import Joint, PointRef
from paraflex.mechanism.members import Members
from paraflex.mechanism.poses import Place, Pose, approximate_poses, local_points, placed_in, placed_poses


def with_phases(mechanism: Members) -> tuple[Gear, ...]:
    """The gears of a mechanism, each with its phase.

    Raises
    ------
    InputError
        A gear without one where there is no assembly to take it from.
    """
    if all(gear.phase is not None for gear in mechanism.gears):
        return mechanism.gears
    if not mechanism.assemblies:
        gear = next(gear for gear in mechanism.gears if gear.phase is None)
        raise InputError(
            "a gear's phase is not given, and there is no assembly to take it from", field=f"gear.{gear.name}.phase",
            remedy="give it in rad (in m where the second joint slides), or an [assembly.NAME] table",
        )  # fmt: skip
    assembly = mechanism.assemblies[0]
    poses = approximate_poses(mechanism, assembly) | placed_poses(mechanism, assembly)

    def phase(gear: Gear) -> float:
        first, second = (_coordinate(mechanism, mechanism.joint(name), poses) for name in gear.joints)
        if first is None or second is None:
            raise InputError(
                f"a gear's phase is not given, and assembly {assembly.name} does not tell where its joints stand",
                field=f"gear.{gear.name}.phase", remedy="give it, or places of points in the assembly",
            )  # fmt: skip
        return second - gear.ratio * first

    return tuple(replace(gear, phase=phase(gear)) if gear.phase is None else gear for gear in mechanism.gears)


def _coordinate(mechanism: Members, joint: Joint, poses: dict[str, Pose]) -> float | None:
    """A joint's angle or travel at approximate poses of the bodies; None where a place is not known."""

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
