"""Steps of static equilibria in a dataset: units, kinds and parts of the branch, buckling shapes."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Mask

# Units of quantities of named coordinates: for lengths, and for angles.
NAMED_UNITS = {
    "place": ("m", "rad"), "travel": ("m", "rad"), "effort": ("N", "N m"), "stiffness": ("N/m", "N m/rad"),
    "compliance": ("m/N", "rad/(N m)"),
}  # fmt: skip


def step_kinds(data: xr.Dataset) -> list[str]:
    """Return for each step whether it is "stable", "unstable" or a "limit point"."""
    limit, stable = data["limit_point"].values, data["stable"].values
    return ["limit point" if at else "stable" if holds else "unstable" for at, holds in zip(limit, stable, strict=True)]


class BranchParts(NamedTuple):
    """Masks (steps,) for drawing a branch: a curve of stable steps, one of unstable steps, and limit points."""

    stable: Mask
    unstable: Mask
    limit: Mask


def branch_parts(data: xr.Dataset) -> BranchParts:
    """Return which steps belong to the curve of stable equilibria, which to that of unstable ones, and limit points.

    The curves meet at limit points. Without a limit point between a stable and an unstable step, the curve of unstable
    equilibria begins at the stable step.
    """
    kinds = np.array(step_kinds(data))
    stable, unstable, limit = (kinds == kind for kind in ("stable", "unstable", "limit point"))
    beside = np.zeros_like(stable)
    beside[1:] |= unstable[:-1]
    beside[:-1] |= unstable[1:]
    return BranchParts(stable | limit, unstable | limit | (stable & beside) if unstable.any() else unstable, limit)


def seen_buckling(data: xr.Dataset) -> tuple[int, list[int]] | None:
    """Return the last stable step with a buckling factor (else the first step with one), and the numbers of its shapes.

    Return None without buckling shapes.
    """
    if "buckling_shape" not in data:
        return None
    known = np.isfinite(data["buckling_factor"].values)
    steps = np.flatnonzero(known.any(axis=1))
    if not steps.size:
        return None
    stable = [step for step in steps if data["stable"].values[step]]
    step = int(stable[-1] if stable else steps[0])
    return step, np.flatnonzero(known[step]).tolist()


def as_samples(data: xr.Dataset) -> xr.Dataset:
    """Return equilibria as samples of a run, with step numbers in place of times [s]."""
    return data.rename(step="time").assign_coords(time=np.arange(float(data.sizes["step"])))
