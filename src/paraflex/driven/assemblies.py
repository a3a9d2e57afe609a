"""All assemblies of a mechanism at one position of its drives."""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import reference_pose
from paraflex.kernel.closure import LOOPS_CLOSED
from paraflex.mechanism import Assembly
from paraflex.paths.loops import LoopClosure
from .exact import ExactMotion

# Random starts, and the distance within which two poses are one [sizes of the mechanism, rad].
_STARTS, _SAME = 200, 1e-6


class FoundAssembly(NamedTuple):
    """Assembly: angles of the bodies [rad], by name, and the number of random starts that led to it."""

    angles: dict[str, float]
    found: int


def assemblies_of(motion: ExactMotion, starts: int = _STARTS) -> list[FoundAssembly]:
    """Search for the assemblies in which the loops close with the drives as at the start of a motion.

    Newton's method starts from random angles of all bodies (fixed seed). An assembly that few starts lead to suggests
    that others may be missing.

    Parameters
    ----------
    motion : ExactMotion
        Motion whose first sample gives the drives.
    starts : int
        Number of random starts.

    Returns
    -------
    list of FoundAssembly
        Assemblies, that of the motion first.
    """
    loops = motion.loops
    return [
        FoundAssembly({body.name: float(q[body.angle]) for body in loops.system.bodies}, count)
        for q, count in poses_of(loops, motion.solution.q[0], starts)
    ]


def poses_of(loops: LoopClosure, first: Array, starts: int = _STARTS) -> list[tuple[Array, int]]:
    """Return the poses (n,) in which loops close, and the number of random starts that led to each: see above."""
    system, random = loops.system, np.random.default_rng(0)
    angles = [body.angle for body in system.bodies]
    poses, counts = [first], [0]
    for _ in range(starts):
        turned = Assembly("", {body.name: random.uniform(-np.pi, np.pi) for body in system.bodies})
        status, _, (found, *_) = loops.run(np.zeros(1), np.zeros((1, 3, 0)), reference_pose(system, turned))
        if status != LOOPS_CLOSED:
            continue
        q = found[0]
        for k, other in enumerate(poses):
            apart = (q - other) / system.units
            apart[angles] = (apart[angles] + np.pi) % (2.0 * np.pi) - np.pi
            if np.max(np.abs(apart)) < _SAME:
                counts[k] += 1
                break
        else:
            q[angles] = (q[angles] + np.pi) % (2.0 * np.pi) - np.pi
            poses.append(q)
            counts.append(1)
    return list(zip(poses, counts, strict=True))
