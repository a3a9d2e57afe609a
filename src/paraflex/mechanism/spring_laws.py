"""Laws of springs at joints, as loads between the bodies of the joint."""

from dataclasses import replace
from math import cos, sin
from typing import Any

from paraflex.errors import InputError
from .loads import AppliedTorque, Load, PointForce, TorsionalSpring
from .members import Members

# Components of a direction below this are rounding.
_ROUNDING = 1e-15


def with_spring_laws(mechanism: Members) -> dict[str, tuple[Any, ...]]:
    """Return the springs and loads of a mechanism by field, laws of springs at joints among the loads.

    Raises
    ------
    InputError
        A load has the name of a spring with a law, or the axis of its joint moves.
    """
    laws = [spring for spring in mechanism.springs if spring.torque is not None]
    names = [load.name for load in mechanism.loads]
    for spring in laws:
        if spring.name in names:
            problem, remedy = "a load has its name, under which results list the law", "rename one of them"
            raise InputError(problem, field=f"spring.{spring.name}", remedy=remedy)
    springs = (replace(one, torque=None) if one in laws else one for one in mechanism.springs if one.stiffness)
    return {"springs": tuple(springs), "loads": (*mechanism.loads, *(_load(mechanism, spring) for spring in laws))}


def _load(mechanism: Members, spring: TorsionalSpring) -> Load:
    """Return the law of a spring as a load on the second body of its joint, with the opposite on the first."""
    joint, field = mechanism.joint(spring.joint), f"spring.{spring.name}.torque"
    assert spring.torque is not None
    law = replace(spring.torque, field=field)
    if joint.slides:
        # On another body the opposite would act at the joint's point there, and the direction would turn with it.
        if not joint.a.on_ground:
            raise InputError(
                "the axis of its joint moves, along which its force would act", field=field,
                value=joint.name, remedy="give a stiffness, or the force of a [linear_spring] between two points",
            )  # fmt: skip
        axis = (cos(joint.direction), sin(joint.direction))
        x, y = (law.scaled(part) if abs(part) > _ROUNDING else 0.0 for part in axis)
        return PointForce(spring.name, joint.b, (x, y))
    if joint.b.on_ground:
        return AppliedTorque(spring.name, joint.a, law.scaled(-1.0))
    return AppliedTorque(spring.name, joint.b, law, reaction=None if joint.a.on_ground else joint.a)
