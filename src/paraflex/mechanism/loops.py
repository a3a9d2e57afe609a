"""Closed loops of a mechanism, each a closed chain of joints."""

from collections import deque

from .joints import GROUND
from .mechanism import Mechanism


def loops(mechanism: Mechanism) -> list[tuple[str, ...]]:
    """Return a set of independent loops, each as the names of its joints in order.

    Bodies and the ground are the nodes of a graph, joints its edges. A spanning tree is grown from the ground by
    breadth-first search; every other joint closes a loop with the tree paths from its bodies to their common ancestor.
    With a connection to the ground the number of loops is that of joints less that of bodies. Loops near the ground are
    short.
    """
    parent = _tree(mechanism)
    in_tree = {entry[0] for entry in parent.values() if entry is not None}
    found = []
    for joint in mechanism.joints:
        if joint.name in in_tree:
            continue
        up_a, up_b = _joints_to_root(parent, joint.a.body), _joints_to_root(parent, joint.b.body)
        while up_a and up_b and up_a[-1] == up_b[-1]:
            up_a.pop()
            up_b.pop()
        found.append((*reversed(up_a), joint.name, *up_b))
    return found


def _tree(mechanism: Mechanism) -> dict[str, tuple[str, str] | None]:
    """Return for each body the joint and the body towards the root of the spanning tree; None for the root."""
    parent: dict[str, tuple[str, str] | None] = {}
    for root in (GROUND, *(body.name for body in mechanism.bodies)):
        if root in parent:
            continue
        parent[root] = None
        queue = deque([root])
        while queue:
            here = queue.popleft()
            for joint in mechanism.joints_at[here]:
                other = joint.b.body if joint.a.body == here else joint.a.body
                if other not in parent:
                    parent[other] = (joint.name, here)
                    queue.append(other)
    return parent


def _joints_to_root(parent: dict[str, tuple[str, str] | None], body: str) -> list[str]:
    """Return the joints from a body to the root of its tree, the nearest first."""
    way = []
    while (step := parent[body]) is not None:
        way.append(step[0])
        body = step[1]
    return way
