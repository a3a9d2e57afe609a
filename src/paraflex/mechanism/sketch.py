"""A drawing of a mechanism as assembled, as inline SVG: links, joints, ground, in the colours of the page it is on."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import cos, sin
from typing import TYPE_CHECKING

from paraflex.errors import InputError
from paraflex.mechanism.joints import GROUND, AxisJoint, Joint, PointRef
from paraflex.mechanism.poses import Place, Pose, approximate_poses, local_points

if TYPE_CHECKING:
    from paraflex.mechanism.mechanism import Mechanism

# Size of the drawing [px], room round it, and radii of joints and other points, as shares of it.
_SIZE, _ROOM, _JOINT, _POINT = 320.0, 0.09, 0.014, 0.007
# Okabe and Ito's colours that are neither too light nor too dark for one of the two kinds of page.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def sketch(mechanism: Mechanism) -> str:
    """SVG of the first assembly, undeformed and with its angles as given; empty where places do not follow from them.

    Loops are closed as well as the angles of the file close them.
    """
    bodies = {name: list(places.values()) for name, places in places_of(mechanism).items()}
    drawn = {name: places for name, places in bodies.items() if places}
    if not drawn:
        return ""
    every = [place for places in drawn.values() for place in places] + list(mechanism.ground.values())
    left, bottom = (min(place[k] for place in every) for k in range(2))
    width, height = (max(place[k] for place in every) - least for k, least in ((0, left), (1, bottom)))
    scale = _SIZE * (1.0 - 2.0 * _ROOM) / (max(width, height) or 1.0)
    room = _ROOM * _SIZE

    def put(place: Place) -> Place:
        return room + scale * (place[0] - left), room + scale * (bottom + height - place[1])

    lines = [
        _link(name, [put(place) for place in places], _COLOURS[k % len(_COLOURS)])
        for k, (name, places) in enumerate(drawn.items())
    ]
    pivots = {put(mechanism.ground[end.point]) for joint in mechanism.joints for end in (joint.a, joint.b)
              if end.on_ground}  # fmt: skip
    marks = [_pivot(place) for place in sorted(pivots)]
    found = places_of(mechanism)
    for joint in mechanism.joints:
        end = joint.b if joint.b.point in found.get(joint.b.body, {}) else joint.a
        place = mechanism.ground[end.point] if end.on_ground else found.get(end.body, {}).get(end.point)
        if place is not None:
            marks.append(_joint(joint.name, put(place), slides=isinstance(joint, AxisJoint)))
    across, up = scale * width + 2.0 * room, scale * height + 2.0 * room
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{across:.0f}" height="{up:.0f}" '
        f'viewBox="0 0 {across:.1f} {up:.1f}" role="img" aria-label="{escape(mechanism.name)} as assembled" '
        f'style="color: inherit; max-width: 100%">{"".join(lines + marks)}</svg>'
    )


def places_of(mechanism: Mechanism) -> dict[str, dict[str, Place]]:
    """Where the named points of bodies are in the first assembly [m], of the bodies whose places follow."""
    if not mechanism.assemblies:
        return {}
    assembly = mechanism.assemblies[0]
    try:
        poses = approximate_poses(mechanism, assembly)
    except InputError:
        return {}
    known = {PointRef(GROUND, name): place for name, place in mechanism.ground.items()} | dict(assembly.points)
    out: dict[str, dict[str, Place]] = {}
    while _joined(mechanism.joints, known, sliding=False) or _carried(mechanism, poses, known, out):
        pass
    # A slider that hangs on nothing else is drawn where its axis begins.
    while _joined(mechanism.joints, known, sliding=True) or _carried(mechanism, poses, known, out):
        pass
    return out


def _joined(joints: Sequence[Joint], known: dict[PointRef, Place], *, sliding: bool) -> bool:
    """Points that joints hold at known ones become known; whether there were any."""
    before = len(known)
    for joint in joints:
        if sliding or not isinstance(joint, AxisJoint):
            for one, other in ((joint.a, joint.b), (joint.b, joint.a)):
                if one in known:
                    known.setdefault(other, known[one])
    return len(known) > before


def _carried(
    mechanism: Mechanism, poses: dict[str, Pose], known: dict[PointRef, Place], out: dict[str, dict[str, Place]]
) -> bool:
    """Bodies with a known point get their place, and their other points with them; whether there were any."""
    before = len(out)
    for body in mechanism.bodies:
        local = local_points(body)
        held = next((name for name in local if PointRef(body.name, name) in known), None)
        if body.name in out or held is None:
            continue
        angle = poses[body.name].angle
        c, s = cos(angle), sin(angle)
        (x, y), (hx, hy) = known[PointRef(body.name, held)], local[held]
        out[body.name] = {
            name: (x + c * (px - hx) - s * (py - hy), y + s * (px - hx) + c * (py - hy))
            for name, (px, py) in local.items()
        }
        for name, place in out[body.name].items():
            known.setdefault(PointRef(body.name, name), place)
    return len(out) > before


def _link(name: str, places: list[Place], colour: str) -> str:
    shape = "polygon" if len(places) > 2 and not _on_a_line(places) else "polyline"
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (_hull(places) if shape == "polygon" else places))
    look = f'fill="{colour if shape == "polygon" else "none"}" fill-opacity="0.25" stroke="{colour}"'
    return (
        f'<{shape} points="{points}" {look} stroke-width="3.5" stroke-linecap="round" stroke-linejoin="round">'
        f"<title>{escape(name)}</title></{shape}>"
    )


def _on_a_line(places: list[Place]) -> bool:
    (x, y), *rest = places
    far = max(rest, key=lambda place: (place[0] - x) ** 2 + (place[1] - y) ** 2)
    u, v = far[0] - x, far[1] - y
    return all(abs(u * (py - y) - v * (px - x)) < 0.02 * (u * u + v * v) for px, py in rest)


def _hull(places: list[Place]) -> list[Place]:
    """The corners of the smallest convex outline, in order: Andrew's monotone chain."""

    def chain(ordered: list[Place]) -> list[Place]:
        corners: list[Place] = []
        for x, y in ordered:
            while len(corners) > 1:
                (ax, ay), (bx, by) = corners[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                corners.pop()
            corners.append((x, y))
        return corners[:-1]

    ordered = sorted(set(places))
    return chain(ordered) + chain(ordered[::-1])


def _pivot(place: Place) -> str:
    x, y = place
    a, b = 0.03 * _SIZE, 0.045 * _SIZE
    return (
        f'<path d="M{x:.1f},{y:.1f} l{-a:.1f},{b:.1f} h{2 * a:.1f} z M{x - 1.5 * a:.1f},{y + b:.1f} h{3 * a:.1f}" '
        'fill="currentColor" fill-opacity="0.2" stroke="currentColor" stroke-width="1"/>'
    )


def _joint(name: str, place: Place, *, slides: bool) -> str:
    x, y = place
    r = _JOINT * _SIZE
    told = f"<title>{escape(name)}</title>"
    look = 'fill="currentColor" fill-opacity="0.25" stroke="currentColor" stroke-width="1.2"'
    if slides:
        corner = f'x="{x - 1.6 * r:.1f}" y="{y - r:.1f}" width="{3.2 * r:.1f}" height="{2.0 * r:.1f}"'
        return f"<rect {corner} {look}>{told}</rect>"
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" {look}>{told}</circle>'
