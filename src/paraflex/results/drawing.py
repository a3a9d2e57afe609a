"""Geometry of drawings of a mechanism: stations of all bodies, joints and springs over time, from any model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief, Complex, Numbers
from paraflex.dynamics import System, material_angle
from paraflex.errors import InputError
from paraflex.mechanism import GROUND, Body, Joint, Mechanism, PointRef, Pose, Relation, RigidBody, placed_poses
from paraflex.mechanism.gears import SumRelation
from paraflex.mechanism.poses import local_points
from .numbers import stacked
from .outlines import Hold, Outline, in_line, outline_motion, outlines, stiff_shape, turned
from .stiff import rigid_frames

# Joints of wheels and of racks: whether they slide, and the constraints they hold.
_WHEEL, _RACK = (False, {"points"}), (True, {"axis", "angle"})
# Range of the distance of a rack's axis from its pinion, in radii.
_NEAREST, _FARTHEST = 0.5, 2.0


@dataclass(frozen=True)
class Drawing(Brief):
    """Geometry of a mechanism at k samples, in the ground frame.

    With deflections magnified by a factor m, stations are at `base + m (shape - base)`, and so are joints. Bodies stay
    connected for any m, as both the deformed bodies and the undeformed base satisfy the joints.

    Attributes
    ----------
    shape, base : (k, stations, 2) arrays
        Stations of the deformed bodies, body after body, and of the undeformed bodies [m]. If a joint slides along a
        beam that is held at three or more places in line, the undeformed bodies are in the nearest pose of the rigid
        mechanism; otherwise each is placed between the joints that hold it.
    joints, joint_bases : (k, joints, 2) arrays
        Positions of the joints, on the second body (of a rod to the ground, on the ground), and in the base [m].
    directions, direction_bases : (k, joints) arrays
        Directions of the axes of sliding joints, NaN for other joints, and in the base [rad].
    springs : (k, springs, 2, 2) array
        Both ends of the springs between points [m].
    """

    shape: Array
    base: Array
    joints: Array
    joint_bases: Array
    directions: Array
    direction_bases: Array
    springs: Array


class Values(NamedTuple):
    """Variable of a drawn run."""

    values: Any


class DrawnRun:
    """Drawing at k times with what scenes use of a run's dataset; xarray takes longer to import than all else to do.

    Attributes
    ----------
    coords : mapping of str to array
        Labels, as of a dataset.
    attrs : mapping of str to str
        Name of the mechanism, and the point of its end-effector if there is one.
    """

    coords: Mapping[str, Any]
    attrs: Mapping[str, str]

    def __init__(self, moving: Mapping[str, Numbers], coords: Mapping[str, Any], attrs: Mapping[str, str]) -> None:
        self._moving, self.coords, self.attrs = moving, coords, attrs

    def __contains__(self, name: str) -> bool:
        return name in self._moving or name in self.coords

    def __getitem__(self, name: str) -> Values:
        return Values(self._moving[name] if name in self._moving else self.coords[name])

    def isel(self, time: slice) -> "DrawnRun":
        """Return the drawing at some of its times."""
        return DrawnRun({name: values[time] for name, values in self._moving.items()}, self.coords, self.attrs)


def drawing(
    mechanism: Mechanism,
    shapes: Mapping[str, Array],
    angle: Callable[[PointRef], Array],
    frame: Callable[[str], tuple[Array, Array]],
) -> Drawing:
    """Return the drawing of a mechanism from the motion of its bodies in any model.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described, not divided into finite segments.
    shapes : mapping of str to (k, s, 2) array
        Positions of the stations of each body [m]: see `outlines`.
    angle : callable
        Function that returns the angle (k,) of the material at a point [rad].
    frame : callable
        Function that returns the origin (k, 2) [m] and angle (k,) [rad] of a body's frame.
    """
    drawn = {one.body: one for one in outlines(mechanism)}
    samples = len(next(iter(shapes.values())))

    def place(ref: PointRef, of: Mapping[str, Array] = shapes) -> Array:
        if ref.on_ground:
            return np.broadcast_to(np.array(mechanism.ground[ref.point], dtype=float), (samples, 2))
        return of[ref.body][:, drawn[ref.body].points[ref.point]]

    joined = _joined(mechanism)
    joints = stacked([place(_drawn_ends(joint)[0]) for joint in mechanism.joints], samples, 2)
    directions = _directions(mechanism, samples, angle, frame)
    springs = [[place(spring.a), place(spring.b)] for spring in mechanism.linear_springs]
    posed = None
    if any(_bends_between_holds(mechanism.body(name), one, joined[name]) for name, one in drawn.items()):
        driven = _driven(mechanism, directions, place, angle)
        posed = rigid_frames(mechanism, [*drawn.values()], shapes, lambda name: frame(name)[1], driven)
    if posed is None:
        bases = {
            name: _base(mechanism.body(name), one, joined[name], shapes[name], place, angle, frame)
            for name, one in drawn.items()
        }
        joint_bases, direction_bases = joints, directions
    else:
        bases = {name: turned(*posed[name], one.places) for name, one in drawn.items()}
        joint_bases = stacked([place(_drawn_ends(joint)[0], bases) for joint in mechanism.joints], samples, 2)
        direction_bases = _directions(mechanism, samples, lambda ref: posed[ref.body][1], posed.__getitem__)
    return Drawing(
        shape=np.concatenate([shapes[name] for name in drawn], axis=1),
        base=np.concatenate([bases[name] for name in drawn], axis=1),
        joints=joints,
        joint_bases=joint_bases,
        directions=directions,
        direction_bases=direction_bases,
        springs=np.moveaxis(np.array(springs), 2, 0) if springs else np.zeros((samples, 0, 2, 2)),
    )


def system_drawing(system: System, q: Array) -> Drawing:
    """Return the drawing of a system for coordinates q (k, n)."""

    def frame(name: str) -> tuple[Array, Array]:
        body = system.body(name)
        return q[:, body.position], q[:, body.angle]

    shapes = {one.body: outline_motion(system, one, q) for one in outlines(system.described)}
    return drawing(system.described, shapes, lambda ref: material_angle(system, ref, q), frame)


def assembled_data(mechanism: Mechanism) -> DrawnRun | None:
    """Return the drawing variables of a mechanism in its first assembly, undeformed, as a run of one sample.

    Loops are closed only as accurately as the given angles close them. Bodies whose poses cannot be derived from the
    assembly are NaN. Return None without an assembly, or if no pose can be derived.
    """
    try:
        poses = placed_poses(mechanism, mechanism.assemblies[0]) if mechanism.assemblies else {}
    except InputError:
        poses = {}
    if not poses:
        return None

    def frame(name: str) -> tuple[Array, Array]:
        pose = poses.get(name, Pose(np.nan))
        return np.array([pose.position or (np.nan, np.nan)]), np.array([pose.angle])

    shapes = {one.body: turned(*frame(one.body), one.places) for one in outlines(mechanism)}
    return drawing_data(mechanism, drawing(mechanism, shapes, lambda ref: frame(ref.body)[1], frame), np.zeros(1))


def drawing_data(mechanism: Mechanism, one: Drawing, time: Array) -> DrawnRun:
    """Return a drawing at times (k,) as a run that holds the drawn variables only."""
    effector = mechanism.end_effector
    labels = drawing_coordinates(mechanism).items()
    return DrawnRun(
        {"time": time, **{name: values for name, (_, values) in drawing_variables(one).items()}},
        {name: np.array(given[1] if isinstance(given, tuple) else given) for name, given in labels},
        {"mechanism": mechanism.name} | ({} if effector is None else {"end_effector_point": str(effector.point)}),
    )


def drawing_variables(
    one: Drawing, keep: Callable[[Array], Numbers] = np.asarray
) -> dict[str, tuple[tuple[str, ...], Numbers]]:
    """Return the variables of a drawing: dimensions besides time, and values (k, ...); springs if there are any.

    The function `keep` converts the values; by default they are unchanged.
    """
    found = {
        "shape": (("station", "axis"), one.shape),
        "shape_base": (("station", "axis"), one.base),
        "joint_position": (("joint", "axis"), one.joints),
        "joint_base": (("joint", "axis"), one.joint_bases),
        "joint_direction": (("joint",), one.directions),
        "joint_direction_base": (("joint",), one.direction_bases),
        "spring_position": (("spring", "end", "axis"), one.springs),
    }
    return {name: (dims, keep(values)) for name, (dims, values) in found.items() if values.size or "spring" not in dims}


def drawing_coordinates(mechanism: Mechanism) -> dict[str, Any]:
    """Return the labels of drawing variables: points, joints, bodies of stations, stations of points, kinds of joints.

    Points are ordered body after body, as everywhere in the results. The station is -1 for the end of a spring on the
    ground, and for the rail of a joint that has none on a moving body.
    """
    drawn = outlines(mechanism)
    first = dict(zip([one.body for one in drawn], np.cumsum([0, *(len(one.places) for one in drawn)]), strict=False))
    stations = {
        PointRef(body.name, point): int(first[body.name]) + one.points[point]
        for body, one in zip(mechanism.bodies, drawn, strict=True)
        for point in body.points
    }
    joints, springs = mechanism.joints, mechanism.linear_springs
    driven = {one.joint for one in (*mechanism.motors, *mechanism.prescribed)}
    out: dict[str, Any] = {
        "point": [str(ref) for ref in stations],
        "joint": [joint.name for joint in joints],
        "station_body": ("station", [one.body for one in drawn for _ in one.places]),
        "station_place": (("station", "axis"), np.concatenate([one.places for one in drawn])),
        "point_station": ("point", np.array(list(stations.values()), dtype=np.int32)),
        "joint_kind": ("joint", [joint.symbol for joint in joints]),
        "joint_grounded": ("joint", np.array([joint.a.on_ground or joint.b.on_ground for joint in joints], dtype=bool)),
        "joint_driven": ("joint", np.array([joint.name in driven for joint in joints], dtype=bool)),
        "joint_rail": ("joint", np.array([_rail_station(joint, stations) for joint in joints], dtype=np.int32)),
    }
    if springs:
        ends = [[stations.get(ref, -1) for ref in (spring.a, spring.b)] for spring in springs]
        out["spring"] = [spring.name for spring in springs]
        out["spring_station"] = (("spring", "end"), np.array(ends, dtype=np.int32))
    if related := mechanism.relations:
        number = {joint.name: k for k, joint in enumerate(joints)}
        pairs = [(one, names) for one in related for names in pairwise(one.joints)]
        held = [[number[name] for name in names] for _, names in pairs]
        out["gear"] = [one.name if len(one.joints) == 2 else f"{one.name} {'-'.join(names)}" for one, names in pairs]
        out["gear_joint"] = (("gear", "end"), np.array(held, dtype=np.int32))
        out["gear_radius"] = (("gear", "end"), np.array([pitch_radii(mechanism, one) for one, _ in pairs]))
    if loads := mechanism.loads:
        out["load"] = [load.name for load in loads]
        out["load_station"] = ("load", np.array([stations[load.point] for load in loads], dtype=np.int32))
    return out


def _drawn_ends(joint: Joint) -> tuple[PointRef, PointRef]:
    """Return the point at which a joint is drawn (of a rod, the point on the ground if any), and its other point."""
    return (joint.a, joint.b) if "distance" in joint.holds and joint.a.on_ground else (joint.b, joint.a)


def _rail_station(joint: Joint, stations: Mapping[PointRef, int]) -> int:
    """Return the station that a joint's rail or rod passes through; -1 without one, or if the rail is the beam."""
    drawn = (joint.slides and not joint.follows_beam) or "distance" in joint.holds
    return stations.get(_drawn_ends(joint)[1], -1) if drawn else -1


def pitch_radii(mechanism: Mechanism, one: Relation) -> tuple[float, float]:
    """Return the pitch radii [m] of two external gears, or of a pinion and its rack, at joints on one carrier body.

    The radius of a rack, whose joint slides without turning, is infinite: positive if its pitch line lies to the right
    of the joint's direction as seen from the pinion, else negative. Radii are NaN for any other relation, and if the
    distance of the rack's axis from the pinion is far from the radius: the ratio of a screw is not a radius.
    """
    unknown = np.nan, np.nan
    if isinstance(one, SumRelation):
        return unknown
    joints = first, second = [mechanism.joint(name) for name in one.joints]
    carriers = {first.a.body, first.b.body} & {second.a.body, second.b.body}
    kinds = [(joint.slides, set(joint.holds)) for joint in joints]
    if len(carriers) != 1 or any(kind not in (_WHEEL, _RACK) for kind in kinds):
        return unknown
    (carrier,) = carriers
    # Ratio of their rotations and travels relative to the carrier.
    sides = [1.0 if joint.a.body == carrier else -1.0 for joint in joints]
    ratio = one.transmission * sides[0] * sides[1]
    places = mechanism.ground if carrier == GROUND else local_points(mechanism.body(carrier))
    ends = [places[(joint.a if joint.a.body == carrier else joint.b).point] for joint in joints]
    if kinds in ([_WHEEL, _RACK], [_RACK, _WHEEL]):
        radius, rack = (abs(ratio), 1) if kinds[1] == _RACK else (abs(1.0 / ratio), 0)
        if not _touches(joints[rack], sides[rack], np.subtract(ends[rack], ends[1 - rack]), radius):
            return unknown
        return (radius, np.copysign(np.inf, ratio)) if rack else (np.copysign(np.inf, ratio), radius)
    if kinds == [_RACK, _RACK] or ratio > 0.0:
        return unknown
    apart = float(np.hypot(*np.subtract(ends[1], ends[0])))
    return apart * ratio / (ratio - 1.0), apart / (1.0 - ratio)


def _touches(rail: Joint, side: float, arm: Array, radius: float) -> bool:
    """Check whether the distance of a rail from a pinion is about the radius; `arm` is from the pinion to the rail."""
    direction = rail.direction - (0.0 if side > 0.0 else rail.angle)
    distance = abs(arm[0] * np.sin(direction) - arm[1] * np.cos(direction))
    return bool(_NEAREST * radius <= distance <= _FARTHEST * radius)


def _joined(mechanism: Mechanism) -> dict[str, list[tuple[Joint, PointRef]]]:
    """Return the joints of each body, each with its point on the body."""
    joined: dict[str, list[tuple[Joint, PointRef]]] = {body.name: [] for body in mechanism.bodies}
    for joint in mechanism.joints:
        for ref in (joint.a, joint.b):
            if not ref.on_ground:
                joined[ref.body].append((joint, ref))
    return joined


def _bends_between_holds(body: Body, one: Outline, joined: list[tuple[Joint, PointRef]]) -> bool:
    """Check whether joints hold a flexible beam at three or more places in line, one of which slides along it."""
    if isinstance(body, RigidBody) or not body.flexible:
        return False
    moving = [joint for joint, ref in joined if joint.follows_beam and ref is joint.a]
    held = {one.points[ref.point] for joint, ref in joined if not (joint.follows_beam and ref is joint.a)}
    return bool(moving) and len(held) + len(moving) > 2 and in_line(one)


def _driven(
    mechanism: Mechanism, directions: Array, place: Callable[[PointRef], Array], angle: Callable[[PointRef], Array]
) -> dict[str, Array]:
    """Return the coordinates (k,) of the joints with motors or prescribed motions [rad, m]."""
    names = {one.joint for one in (*mechanism.motors, *mechanism.prescribed)}
    out = {}
    for joint, direction in zip(mechanism.joints, directions.T, strict=True):
        if joint.name in names and joint.slides:
            step = place(joint.b) - place(joint.a)
            out[joint.name] = np.cos(direction) * step[:, 0] + np.sin(direction) * step[:, 1]
        elif joint.name in names:
            sides = [0.0 if ref.on_ground else angle(ref) for ref in (joint.a, joint.b)]
            out[joint.name] = sides[1] - sides[0]
    return out


def _base(
    body: Body,
    one: Outline,
    joined: list[tuple[Joint, PointRef]],
    shape: Array,
    place: Callable[[PointRef], Array],
    angle: Callable[[PointRef], Array],
    frame: Callable[[str], tuple[Array, Array]],
) -> Array:
    """Return the stations (k, s, 2) of the undeformed body placed between the joints that hold it [m]."""
    if isinstance(body, RigidBody) or not body.flexible:
        return shape
    held: dict[int, PointRef] = {}
    moving = []
    for joint, ref in joined:
        if joint.follows_beam and ref is joint.a:
            # Abscissa of the sliding point on the undeformed beam.
            there, (origin, turn) = _complex(place(joint.b)), frame(one.body)
            moving.append(Hold(((there - _complex(origin)) * np.exp(-1j * turn)).real.astype(complex), there))
        else:
            held.setdefault(one.points[ref.point], ref)
    holds = [
        Hold(np.full(len(shape), complex(*one.places[station])), _complex(shape[:, station])) for station in held
    ] + moving
    origin, turn = frame(one.body)
    if held:
        turn = angle(next(iter(held.values())))
    if not holds:
        holds = [Hold(np.zeros(len(shape), dtype=complex), _complex(origin))]
    return stiff_shape(one, holds, turn)


def _directions(
    mechanism: Mechanism,
    samples: int,
    angle: Callable[[PointRef], Array],
    frame: Callable[[str], tuple[Array, Array]],
) -> Array:
    """Return the directions (k, joints) of the axes of sliding joints, NaN for other joints [rad]."""
    out = np.full((samples, len(mechanism.joints)), np.nan)
    for i, joint in enumerate(mechanism.joints):
        if joint.slides and joint.follows_beam:
            out[:, i] = frame(joint.a.body)[1]
        elif joint.slides:
            out[:, i] = joint.direction + (0.0 if joint.a.on_ground else angle(joint.a))
    return out


def _complex(places: Array) -> Complex:
    return places[..., 0] + 1j * places[..., 1]
