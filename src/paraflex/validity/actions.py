"""Plausibility of joints and actions: joints given twice, springs, friction, damping and loads.

As in `numbers`, each bound is wide: values beyond it are hardly ever intended.
"""

from collections.abc import Iterator

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.findings import Finding
from paraflex.mechanism import AssumedModesBeam, FlexibleBeam, Mechanism, ModalBody, PointForce
from paraflex.mechanism.bodies import Body
from paraflex.mechanism.damping import LossFactor, ModalDamping
from paraflex.mechanism.joints import PointRef

# Sum of applied forces relative to the weight of all bodies, for a mechanism under gravity and without gravity.
LOADED, LOADED_AT_REST = 100.0, 1000.0
# Dry friction relative to the torque (at the mechanism's size) or force that the weight of all bodies exerts.
RUBBING_TURN, RUBBING_SLIDE = 30.0, 100.0
# Speed of a friction law [rad/s or m/s] below which time steps become very small.
SHARP = 1e-5
# Ratio of structural damping above that of any structure, even of rubber.
DAMPED = 0.5
# Free length of a spring relative to the mechanism's size.
LONG = 5.0
_G = 9.81


def implausible_actions(mechanism: Mechanism, size: float, mass: float, times: Array) -> Iterator[Finding]:
    """Yield findings about joints, springs, friction, damping and loads, from the description alone.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    size : float
        Largest length of the mechanism [m].
    mass : float
        Mass of all its bodies [kg].
    times : (k,) array
        Times at which loads in time are evaluated [s].
    """
    yield from _duplicates(mechanism)
    yield from _beside(mechanism)
    yield from _springs(mechanism, size)
    yield from _damped(mechanism)
    yield from _sharp_friction(mechanism)
    if mass > 0.0 and size > 0.0:
        yield from _excessive_friction(mechanism, size, mass * _G)
        yield from _loaded(mechanism, size, mass * _G, times)


def _duplicates(mechanism: Mechanism) -> Iterator[Finding]:
    first: dict[frozenset[PointRef], str] = {}
    for joint in mechanism.joints:
        held = frozenset((joint.a, joint.b))
        if held in first:
            yield Finding(
                "joint-twice", f"joint.{joint.name}",
                f"it joins {joint.a} and {joint.b}, as {first[held]} does",
                "leave one of them out, or name other points",
            )  # fmt: skip
        first.setdefault(held, joint.name)


def _beside(mechanism: Mechanism) -> Iterator[Finding]:
    """Yield findings of two joints at one numbered point of a body, and none at another: B2 and B3 both at B3."""
    held: dict[PointRef, list[str]] = {}
    for joint in mechanism.joints:
        for point in (joint.a, joint.b):
            held.setdefault(point, []).append(joint.name)
    used = mechanism.points_used
    for body in mechanism.bodies:
        points = [PointRef(body.name, name) for name in body.points]
        for free in (point for point in points if point not in used and point.point[-1:].isdigit()):
            for point in points:
                if len(held.get(point, ())) > 1 and free.point in held[point] and numbered_alike(free, point):
                    yield Finding(
                        "point-unused", f"joint.{free.point}",
                        f"it and another joint hold {point}, and nothing holds {free}",
                        f"should it hold {free}?",
                    )  # fmt: skip


def numbered_alike(one: PointRef, other: PointRef) -> bool:
    """Return whether two points have the same name except for the number at its end."""
    return one.point.rstrip("0123456789") == other.point.rstrip("0123456789")


def _springs(mechanism: Mechanism, size: float) -> Iterator[Finding]:
    place = _places(mechanism)
    for spring in mechanism.linear_springs:
        if place.get(spring.a, spring.a) == place.get(spring.b, spring.b):
            yield Finding(
                "spring-idle", f"linear_spring.{spring.name}.points",
                f"joints hold {spring.a} and {spring.b} together: it has no effect",
                "name the points that it stretches between",
            )  # fmt: skip
        if size and spring.length > LONG * size:
            yield Finding(
                "size", f"linear_spring.{spring.name}.length",
                f"a free length of {spring.length:.3g} m, in a mechanism of {size:.3g} m",
                "lengths are in m: is it in mm?",
            )  # fmt: skip


def _places(mechanism: Mechanism) -> dict[PointRef, PointRef]:
    """Return for each point of a pin or weld a representative of all points at its position."""
    place: dict[PointRef, PointRef] = {}

    def representative(point: PointRef) -> PointRef:
        while (at := place.setdefault(point, point)) != point:
            # Paths to representatives are halved, so that long chains take no longer.
            place[point] = place[at]
            point = at
        return point

    for joint in mechanism.joints:
        if "points" in joint.holds:
            place[representative(joint.b)] = representative(joint.a)
    return {point: representative(point) for point in tuple(place)}


def _damped(mechanism: Mechanism) -> Iterator[Finding]:
    for body in mechanism.bodies:
        ratio, field = _damping_ratio(body)
        if ratio > DAMPED:
            yield Finding(
                "damping-large", f"body.{body.name}.damping",
                f"a damping ratio of {ratio:.3g}: no structure is damped so strongly that it hardly vibrates",
                f"{field} a fraction, not a percentage: 1 % is 0.01",
            )  # fmt: skip


def _damping_ratio(body: Body) -> tuple[float, str]:
    """Return the largest damping ratio of a body's structure, and the field that gives it."""
    damping = body.damping if isinstance(body, FlexibleBeam | AssumedModesBeam | ModalBody) else None
    if isinstance(damping, ModalDamping):
        return max(damping.ratios, default=0.0), "ratios are each"
    if isinstance(damping, LossFactor):
        return 0.5 * damping.loss_factor, "loss_factor, twice the ratio, is"
    return 0.0, ""


def _sharp_friction(mechanism: Mechanism) -> Iterator[Finding]:
    for one in mechanism.frictions:
        if 0.0 < one.speed < SHARP:
            unit = "m/s" if mechanism.slides(one.joint) else "rad/s"
            yield Finding(
                "friction-sharp", f"friction.{one.name}.speed",
                f"its force changes sign within {one.speed:.3g} {unit}: every change of direction needs tiny steps",
                "give the speed below which creeping does not matter, a hundredth of the joint's largest, say",
            )  # fmt: skip


def _excessive_friction(mechanism: Mechanism, size: float, weight: float) -> Iterator[Finding]:
    for one in mechanism.frictions:
        slides = mechanism.slides(one.joint)
        bound, unit = (RUBBING_SLIDE * weight, "N") if slides else (RUBBING_TURN * weight * size, "N m")
        if one.limit > bound:
            yield Finding(
                "friction-large", f"friction.{one.name}.limit",
                f"{one.limit:.3g} {unit}, where all bodies weigh {weight:.3g} N"
                + ("" if slides else f", in a mechanism of {size:.3g} m"),
                f"it is in {unit}",
            )  # fmt: skip


def _loaded(mechanism: Mechanism, size: float, weight: float, times: Array) -> Iterator[Finding]:
    most = (LOADED if any(mechanism.gravity) else LOADED_AT_REST) * weight
    for load in mechanism.loads:
        force = isinstance(load, PointForce)
        try:
            largest = load.largest(times)
        except InputError:
            # The profile may be undefined beyond an earlier end of the run; otherwise the run reports the error.
            continue
        if largest > (most if force else most * size):
            yield Finding(
                "load-large", f"load.{load.name}.{load.kind}",
                f"{'up to ' if load.profiles else ''}{largest:.3g} {load.unit}, where all bodies weigh {weight:.3g} N"
                + ("" if force else f", in a mechanism of {size:.3g} m"),
                f"it is in {load.unit}: is it in another unit, or are masses?",
            )  # fmt: skip
