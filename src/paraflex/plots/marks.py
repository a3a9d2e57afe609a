"""Symbols of a scene in metres, with their looks: supports, rails, blocks, pins, welds, springs, gears and loads."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from .scene import ARROW, BLOCK, TURN, DrawnJoint, DrawnLoad, Limits, Scene

# Sizes as shares of the picture's larger side.
PIN, TRIANGLE, RAIL, MOTOR = 0.008, 0.028, 0.02, 0.0125
# Radius of a pin's dot, smaller than the disc of a motor; small pictures have larger dots.
DOT = 0.0056
# Length of an arrow's head as a share of the picture, its half width relative to its length, and its largest share of a
# short arrow.
_HEAD, _HALF_HEAD, _MOST_HEAD = 0.026, 0.36, 0.6
# Start angle and sweep of the arrow of the largest torque around its point [rad].
_TURN_FROM, _TURN_BY = -0.4, 1.5 * np.pi
# Radius of a torque's arrow in the key relative to that in the picture.
_KEY_TURN = 0.4
_TEETH = 14
# Numbers of points of a disc and of an arc.
_ROUND, _ARC = 25, 40
# A joint that moves by less than this fraction of the picture is drawn at rest.
_STILL_SHARE = 1e-3


class MarkLook(NamedTuple):
    """Look of a symbol: names of theme colours for fill and stroke (empty for none), line width, whether dashed."""

    fill: str
    stroke: str
    width: float
    dashed: bool = False


# Looks from the back to the front; links are drawn before the first symbol that moves.
LOOKS = {
    "ground": MarkLook("", "earth", 1.2),
    "hatching": MarkLook("", "earth", 0.8),
    "gear": MarkLook("", "earth", 0.9, dashed=True),
    "spring": MarkLook("", "earth", 1.1),
    "rail": MarkLook("", "earth", 1.6),
    "block": MarkLook("ground", "ink", 1.2),
    "rod": MarkLook("ground", "ink", 1.2),
    "motor": MarkLook("ink", "ink", 0.8),
    "weld": MarkLook("ink", "ink", 0.8),
    "pin": MarkLook("ground", "ink", 1.3),
    "load": MarkLook("", "trail", 1.8),
    "head": MarkLook("trail", "trail", 0.6),
}


class Mark(NamedTuple):
    """Symbol with one of the `LOOKS` at f times: a line (f, n, 2), with gaps where it is NaN, or a dot (f, 1, 2)."""

    look: str
    name: str
    places: Array


def still_marks(shown: Scene, limits: Limits) -> list[Mark]:
    """Return the symbols of the ground, at one time."""
    # A joint that neither slides nor holds a point has no support.
    held = [joint for joint in shown.joints if joint.slides or {"pin", "weld"} & SYMBOLS.get(joint.kind, {}).keys()]
    found = [(joint.name, ground_of(joint, limits)) for joint in held if joint.grounded]
    found += [("", support(place, limits)) for place in shown.anchors]
    return [
        Mark(look, name, _joined(pieces)[None])
        for name, (lines, strokes) in found
        for look, pieces in (("ground", lines), ("hatching", strokes))
    ]


def moving_marks(shown: Scene, limits: Limits) -> list[Mark]:
    """Return the symbols of gears, springs, rails, joints and their motors, and the arrows of loads, back to front."""
    out = [Mark("gear", gear.name, line) for gear in shown.gears for line in gear.lines]
    out += [Mark("spring", name, zigzag(ends, limits)) for name, ends in shown.springs.items()]
    parts = [(joint, look, shape) for joint in shown.joints for look, shape in SYMBOLS.get(joint.kind, {}).items()]
    out += [Mark("rail", "", rail(joint, limits)) for joint in shown.joints if joint.slides and joint.rail is not None]
    out += [Mark(look, joint.name, shape(joint, limits)) for joint, look, shape in parts]
    out += [Mark("motor", "", motor(joint, limits)) for joint in shown.joints if joint.driven]
    for load in shown.loads:
        line, head = load_arrow(load, limits)
        out += [Mark("load", load.name, line), Mark("head", "", head)]
    return sorted(out, key=lambda mark: list(LOOKS).index(mark.look))


def by_look(marks: Sequence[Mark]) -> dict[str, list[Mark]]:
    """Group marks by their look, from the back to the front."""
    found = {look: [mark for mark in marks if mark.look == look] for look in LOOKS}
    return {look: some for look, some in found.items() if some}


def _joined(pieces: Sequence[Array] | Array) -> Array:
    """Concatenate lines with gaps (NaN) between them."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([part for piece in pieces for part in (piece, gap)])[:-1]


def is_guide(joint: DrawnJoint, limits: Limits) -> bool:
    """Return whether a joint is drawn as a fixed guide through which a slider moves, not as a block along a rail."""
    return len(joint.place) > 1 and bool(np.max(np.ptp(joint.place, axis=0)) <= _STILL_SHARE * limits.size)


def hatching(start: Array, end: Array, limits: Limits) -> Array:
    """Return strokes (n, 2, 2) of ground on the right of a line from start to end."""
    d = 0.45 * RAIL * limits.size
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    count = max(3, round(length / d))
    feet = start + np.outer((np.arange(count) + 0.6) / count * length, along)
    return np.stack([feet, feet + d * (across - 0.7 * along)], axis=1)


def support(place: Array, limits: Limits) -> tuple[list[Array], Array]:
    """Return the lines of a support under a point, and the hatching (n, 2, 2) of its ground."""
    d, wide = TRIANGLE * limits.size, 0.35 * TRIANGLE * limits.size
    held = place + d * np.array([[0.0, 0.0], [-0.6, -1.0], [0.6, -1.0], [0.0, 0.0]])
    base = np.array([held[1] - [wide, 0.0], held[2] + [wide, 0.0]])
    return [held, base], hatching(base[0], base[1], limits)


def ground_of(joint: DrawnJoint, limits: Limits) -> tuple[list[Array], Array]:
    """Return the lines of a joint's ground and its hatching (n, 2, 2): a rail if a block slides, else a support."""
    size = limits.size
    if joint.slides and not is_guide(joint, limits):
        along = np.array([np.cos(joint.direction[0]), np.sin(joint.direction[0])])
        middle = joint.place[0]
        reach = (joint.place - middle) @ along
        beyond = 1.2 * BLOCK[0] * size
        across = np.array([along[1], -along[0]])
        across = across if across[1] < 0.0 or (across[1] == 0.0 and across[0] > 0.0) else -across
        foot = middle + 0.5 * BLOCK[1] * size * across
        ends = [foot + (reach.min() - beyond) * along, foot + (reach.max() + beyond) * along]
        # Strokes are on the side away from the block.
        if np.dot(np.array([along[1], -along[0]]), across) < 0.0:
            ends.reverse()
        return [np.array(ends)], hatching(ends[0], ends[1], limits)
    return support(joint.place[0], limits)


def block(joint: DrawnJoint, limits: Limits) -> Array:
    """Return the corners (f, 5, 2) of a slider, or of the guide through which it slides."""
    a, b = 0.5 * np.array(BLOCK) * limits.size
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]])
    c, s = np.cos(joint.direction)[:, None], np.sin(joint.direction)[:, None]
    x, y = corners.T
    return joint.place[:, None] + np.stack([c * x - s * y, s * x + c * y], axis=-1)


def rail(joint: DrawnJoint, limits: Limits) -> Array:
    """Return the ends (f, 2, 2) of a rail carried by a moving body, 1.5 block lengths beyond the travel at each end."""
    assert joint.rail is not None
    along = np.stack([np.cos(joint.direction), np.sin(joint.direction)], axis=-1)
    travel = np.sum((joint.place - joint.rail) * along, axis=-1)
    beyond, far = 1.5 * BLOCK[0] * limits.size, 1.5 * limits.size
    ends = np.clip([np.nanmin(travel) - beyond, np.nanmax(travel) + beyond], -far, far)
    return joint.rail[:, None] + ends[None, :, None] * along[:, None]


def motor(joint: DrawnJoint, limits: Limits) -> Array:
    """Return the disc (f, n, 2) of a motor around its pin, or the core of a block that is driven along its rail."""
    if joint.slides:
        return joint.place[:, None] + 0.5 * (block(joint, limits) - joint.place[:, None])
    angle = np.linspace(0.0, 2.0 * np.pi, _ROUND)
    return joint.place[:, None] + MOTOR * limits.size * np.column_stack([np.cos(angle), np.sin(angle)])


def load_arrow(load: DrawnLoad, limits: Limits) -> tuple[Array, Array]:
    """Return line and head of a load's arrow: to its point for a force, around it for a torque.

    The arrow shrinks to a point where the load is zero.
    """
    if np.any(load.torque):
        return round_arrow(load.place, TURN * limits.size, _TURN_FROM, _TURN_BY * load.torque, limits)
    return straight_arrow(load.place - ARROW * limits.size * load.force, load.place, limits)


def key_arrow(kind: str, limits: Limits) -> tuple[Array, Array]:
    """Return line (n, 2) and head (4, 2) of the key arrow of the largest "force" or, on a smaller circle, "torque"."""
    middle = np.zeros((1, 2))
    if kind == "force":
        line, head = straight_arrow(middle - [ARROW * limits.size, 0.0], middle, limits)
    else:
        line, head = round_arrow(middle, _KEY_TURN * TURN * limits.size, _TURN_FROM, np.array([_TURN_BY]), limits)
    return line[0], head[0]


def straight_arrow(tail: Array, tip: Array, limits: Limits, size: float = 1.0) -> tuple[Array, Array]:
    """Return the line (f, 2, 2) of an arrow from tails to tips (f, 2), and its head (f, 4, 2), scaled by `size`."""
    length = np.linalg.norm(tip - tail, axis=1, keepdims=True)
    along = (tip - tail) / np.where(length > 0.0, length, 1.0)
    head = np.minimum(size * _HEAD * limits.size, _MOST_HEAD * length)
    return np.stack([tail, tip - head * along], axis=1), _head(tip, along, head)


def round_arrow(
    centre: Array, radius: float, start: float, sweep: Array, limits: Limits, size: float = 1.0
) -> tuple[Array, Array]:
    """Return the line (f, n, 2) of an arrow on circles around centres (f, 2), and its head (f, 4, 2).

    The arrow runs from the angle `start` through the angles `sweep` (f,) [rad].
    """
    head = np.minimum(size * _HEAD * limits.size, _MOST_HEAD * radius * np.abs(sweep))
    ends = start + sweep - np.sign(sweep) * head / radius
    angle = start + np.linspace(0.0, 1.0, _ARC) * (ends - start)[:, None]
    line = centre[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    tip = centre + radius * np.column_stack([np.cos(start + sweep), np.sin(start + sweep)])
    along = tip - line[:, -1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return line, _head(tip, along / np.where(length > 0.0, length, 1.0), head[:, None])


def _head(tip: Array, along: Array, length: Array) -> Array:
    """Return triangles (f, 4, 2) with tips (f, 2), directions (f, 2) and lengths (f, 1)."""
    across = _HALF_HEAD * length * np.column_stack([-along[:, 1], along[:, 0]])
    foot = tip - length * along
    return np.stack([tip, foot + across, foot - across, tip], axis=1)


def square(joint: DrawnJoint, limits: Limits) -> Array:
    """Return the corners (f, 5, 2) of a weld."""
    d = 0.9 * PIN * limits.size
    return joint.place[:, None] + d * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])


def dot(joint: DrawnJoint, _: Limits) -> Array:
    """Return the position (f, 1, 2) of a pin."""
    return joint.place[:, None]


def rod(joint: DrawnJoint, limits: Limits) -> Array:
    """Return the outline (f, n, 2) of a rod between the pins at its ends; in a legend it is as long as a block."""
    half = np.array([0.5 * BLOCK[0] * limits.size, 0.0])
    both = (joint.place + half, joint.place - half) if joint.rail is None else (joint.place, joint.rail)
    ends = np.stack(both, axis=1)
    along = np.arctan2(*(ends[:, 0] - ends[:, 1]).T[::-1])[:, None] + np.linspace(0.0, 2.0 * np.pi, _ROUND)
    rim = 0.5 * PIN * limits.size * np.stack([np.cos(along), np.sin(along)], axis=-1)
    return np.concatenate([ends[:, :1] - rim, ends[:, 1:] + rim], axis=1)


def zigzag(ends: Array, limits: Limits) -> Array:
    """Return the zigzag line (f, n, 2) of a spring between two ends (f, 2, 2)."""
    a, b = ends[:, 0], ends[:, 1]
    d = b - a
    length = np.linalg.norm(d, axis=1, keepdims=True)
    across = np.stack([-d[:, 1], d[:, 0]], axis=1) / np.where(length > 0.0, length, 1.0)
    along = np.concatenate([[0.0, 0.12], np.linspace(0.14, 0.86, _TEETH), [0.88, 1.0]])
    swing = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], _TEETH // 2), [0.0, 0.0]])
    swing = 0.4 * TRIANGLE * limits.size * swing
    return a[:, None] + along[:, None] * d[:, None] + swing[:, None] * across[:, None]


# Functions for the moving shapes of a joint by their looks, keyed by `Joint.symbol`; a joint without an entry is not
# drawn. A joint that slides and turns has a pin on its block.
SYMBOLS: dict[str, dict[str, Callable[[DrawnJoint, Limits], Array]]] = {
    "pin": {"pin": dot},
    "weld": {"weld": square},
    "rod": {"rod": rod, "pin": dot},
    "slider": {"block": block},
    "slot": {"block": block, "pin": dot},
    "sliding": {"block": block, "pin": dot},
}
