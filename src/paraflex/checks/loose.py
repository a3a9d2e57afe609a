"""Points likely meant to be joined: of one name, close together, in a mechanism with undriven freedoms."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.dynamics.state import point_position
from paraflex.findings import Finding
from paraflex.mechanism import Mechanism
from paraflex.mechanism.joints import GROUND, PointRef
from paraflex.validity.actions import numbered_alike
from paraflex.validity.numbers import mechanism_size

# Distance of two such points relative to the mechanism's size: without its joint an assembly closes only roughly.
NEAR_POINTS = 0.2


def loose_points(rigid: System, q: Array) -> Iterator[Finding]:
    """Yield unused points close to a point of the same name on another body, at coordinates q of the rigid mechanism.

    B and B3 count as the same name if both points are unused.
    """
    mechanism = rigid.mechanism
    unused = _unused(mechanism)
    ground = [PointRef(GROUND, name) for name in mechanism.ground]
    known = [*ground, *(PointRef(body.name, name) for body in mechanism.bodies for name in body.points)]
    direct = {frozenset((one.a.body, one.b.body)) for one in mechanism.joints}
    # An assembly by angles leaves the travels of sliding joints open.
    sliding = {end.body for joint in mechanism.joints if joint.slides for end in (joint.a, joint.b)}
    sliding.discard(GROUND)
    reported: set[PointRef] = set()
    size = mechanism_size(mechanism)
    pairs: list[tuple[bool, float, PointRef, PointRef]] = []
    for one, other in product(unused, known):
        apart = one.body != other.body and frozenset((one.body, other.body)) not in direct
        if apart and (one.point == other.point or (other in unused and numbered_alike(one, other))):
            gap = float(np.linalg.norm(point_position(rigid, q, one) - point_position(rigid, q, other)))
            if gap < size * (1.0 if {one.body, other.body} & sliding else NEAR_POINTS):
                pairs.append((other not in unused, gap, one, other))
    # Pairs with both points unused come first, then the nearest.
    for _, gap, one, other in sorted(pairs, key=lambda pair: pair[:2]):
        if not reported & {one, other}:
            reported |= {one, other}
            yield Finding(
                "joint-missing", "joint", f"nothing holds {one} and {other}, which lie {gap:.3g} m apart",
                "is a joint of the two missing?",
            )  # fmt: skip


def _unused(mechanism: Mechanism) -> list[PointRef]:
    """Return the points of bodies that no joint, spring, load, lump or end-effector refers to."""
    used = mechanism.points_used
    named = [PointRef(body.name, name) for body in mechanism.bodies for name in body.points]
    return [point for point in named if point not in used]
