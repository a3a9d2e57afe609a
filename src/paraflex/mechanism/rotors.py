"""Contributions of actuators to a mechanism: rotors as lumps at joints, back-EMF as dampers."""

from typing import Any

from paraflex.arguments import with_fields
from paraflex.errors import InputError
from .actuators import Actuator
from .bodies import Body
from .cut import Cut
from .joints import Joint, Motor, PointRef
from .loads import PointForce, TorsionalDamper
from .members import Members
from .payload import with_lump
from .quantities import known


def actuator_motors(actuator: Actuator, mechanism: Members) -> tuple[str, ...]:
    """Return the names of the motors of a mechanism that an actuator describes."""
    return actuator.motors or tuple(motor.name for motor in mechanism.motors)


def actuators_by_motor(mechanism: Members) -> dict[str, Actuator]:
    """Return the actuator of each motor that has one, in the order of the motors."""
    found = {name: one for one in mechanism.actuators for name in actuator_motors(one, mechanism)}
    return {motor.name: found[motor.name] for motor in mechanism.motors if motor.name in found}


def check_actuators(mechanism: Members) -> None:
    """Check that actuators refer to motors, each motor once, and that a single body can take each rotor's inertia.

    Raises
    ------
    InputError
        The first check that fails.
    """
    names, taken = [motor.name for motor in mechanism.motors], dict[str, str]()
    for one in mechanism.actuators:
        field = f"actuator.{one.name}.motors"
        for name in actuator_motors(one, mechanism):
            known(name, names, field, "motor")
            if name in taken:
                raise InputError(
                    f"motor {name} has actuator {taken[name]} already", field=field, value=name,
                    remedy="name the motors of each actuator, every one once",
                )  # fmt: skip
            taken[name] = one.name
    for motor in mechanism.motors:
        if motor.name in taken:
            _check_rotor(mechanism, motor, next(one for one in mechanism.actuators if one.name == taken[motor.name]))


def _check_rotor(mechanism: Members, motor: Motor, actuator: Actuator) -> None:
    joint = mechanism.joint(motor.joint)
    if actuator.rotor_inertia and _driven_point(joint) is None:
        carrier = f"a joint that slides on {joint.a.body}" if joint.slides else "two bodies that both move"
        raise InputError(
            f"inertia n^2 J_m between {carrier} ({motor.name} at {joint.name}) belongs to no single body",
            field=f"actuator.{actuator.name}.rotor_inertia", value=actuator.rotor_inertia,
            remedy="make the rotor a rigid body on a pin with a [gear.NAME], or leave its inertia out",
        )  # fmt: skip


def _driven_point(joint: Joint) -> PointRef | None:
    """Return the joint's point on the only body whose motion determines the joint rate; None if two bodies do.

    At a joint on the ground the rate is that of the body's angle, or the speed of a point along a fixed axis.
    """
    if joint.a.on_ground:
        return joint.b
    # An axis on the body rotates with it, unless the joint holds the body's angle.
    on_fixed_axis = not joint.slides or ("angle" in joint.holds and not joint.follows_beam)
    return joint.a if joint.b.on_ground and on_fixed_axis else None


def with_actuators(mechanism: Any) -> Any:
    """Return the mechanism for computation, with rotors as lumps and back-EMF as dampers at joints.

    A lump of mass n^2 J_m on a fixed axis represents a rotor without weight, so a force at its point cancels gravity.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with actuators.

    Returns
    -------
    Mechanism
        Derived mechanism, whose `described` is that of the given one; without actuators the given one.
    """
    if not mechanism.actuators:
        return mechanism
    bodies: dict[str, Body] = {body.name: body for body in mechanism.bodies}
    dampers, forces, actuators = [], [], actuators_by_motor(mechanism)
    for motor in mechanism.motors:
        one = actuators.get(motor.name)
        if one is None:
            continue
        joint = mechanism.joint(motor.joint)
        if one.damping != 0.0:
            damper = TorsionalDamper(f"back-EMF of {motor.name}", motor.joint, 1.0)
            dampers.append(with_fields(damper, coefficient=one.damping))
        if one.rotor_inertia != 0.0:
            point = _driven_point(joint)
            assert point is not None
            lump = (one.reflected_inertia, 0.0) if joint.slides else (0.0, one.reflected_inertia)
            bodies[point.body] = with_lump(bodies[point.body], point.point, *lump)
            if joint.slides and any(mechanism.gravity):
                balance = PointForce(f"rotor of {motor.name}", point, (0.0, 0.0))
                forces.append(with_fields(balance, force=tuple(-lump[0] * g for g in mechanism.gravity)))
    return with_fields(
        mechanism, bodies=tuple(bodies.values()), dampers=(*mechanism.dampers, *dampers),
        loads=(*mechanism.loads, *forces), actuators=(), cut=mechanism.cut or Cut(mechanism, {}, {}),
    )  # fmt: skip


def rotor_mass(mechanism: Members) -> float:
    """Return the sum of the reflected inertias n^2 J_m of rotors at joints that slide, which have no weight [kg]."""
    found = actuators_by_motor(mechanism)
    sliding = (found[motor.name] for motor in mechanism.motors if motor.name in found and mechanism.slides(motor.joint))
    return sum(one.reflected_inertia for one in sliding)
