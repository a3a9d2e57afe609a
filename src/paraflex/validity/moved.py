"""Bodies that start far from the angles given: another elbow, or drives that start elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator

from paraflex.arrays import Array
from paraflex.dynamics import System
from paraflex.findings import Finding
from paraflex.mechanism import Assembly
from paraflex.mechanism.poses import approximate_poses

# A body that closing the loops turned further than this had another angle in mind, or another elbow [rad].
_FAR = 0.5


def moved_far(system: System, assembly: Assembly, q: Array) -> Iterator[Finding]:
    """Bodies that closing the loops of an assembly, or moving to the start of drives, turned far; q (n,)."""
    given = {name: pose.angle for name, pose in approximate_poses(system.mechanism, assembly).items()}
    found = {body.name: float(q[body.angle]) for body in system.bodies}
    turned = {name: abs(math.remainder(found[name] - given[name], 2.0 * math.pi)) for name in found}
    far = sorted((name for name in turned if turned[name] > _FAR), key=lambda name: -turned[name])
    if not far:
        return
    which = ", ".join(
        f"{name} at {_both(found[name])} where {given[name]:.3g} rad "
        f"{'was given' if name in assembly.angles else 'follows from the points given'}"
        for name in far[:3]
    )
    drives = ", ".join(one.name for one in system.mechanism.prescribed)
    away = f"; or {drives} starts elsewhere: give angles there, or leave its start out" if drives else ""
    yield Finding(
        "assembly-elbow", f"assembly.{assembly.name}",
        f"it closed far from what was given: {which}{' and others' if len(far) > 3 else ''}",
        f"if another elbow was meant, give angles nearer to it, in rad{away}",
    )  # fmt: skip


def _both(angle: float) -> str:
    """An angle within half a turn, in radians and degrees."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return f"{turned:.3g} rad ({math.degrees(turned):.3g} degrees)"
