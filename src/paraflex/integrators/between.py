"""Check whether the largest loads of a run lie between the samples that it keeps.

A run keeps few samples of many steps. Its time loop takes additional samples at little cost, from which the largest
loads are computed again; the requested samples are kept.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Mask
from paraflex.dynamics import System
from paraflex.dynamics.joint_loads import drive_torques, joint_loads
from paraflex.dynamics.sections import sections_of
from paraflex.findings import Finding
from .limits import StepLimits
from .solution import Solution

# Code of the finding, and the field it refers to: the number of samples.
COARSE = "samples-coarse"
SAMPLES = "study.samples"
# Least ratio of the samples examined to those kept, and least number of samples examined.
_FINER, _LEAST = 2, 1401
# Spacing of additional samples where inputs change fast, as a part of the longest step there.
_PART_OF_STEP = 0.25
# Largest number of coordinates of all samples together, for memory.
_MOST_NUMBERS = 4_000_000
# Numbers of one kind of load that are processed at a time, to fit into the processor's cache.
_AT_A_TIME = 32_000
# Negligible loads: stress [MPa], and forces as a part of the total weight.
_NO_STRESS, _NO_FORCE = 1e-3, 1e-3
_GRAVITY = 9.81
# Excess of a load between samples that gives a finding, and accuracy of the load with the samples of the remedy.
LARGER, _NEARLY = 0.05, 0.01


class RefinedTimes(NamedTuple):
    """Times of samples with additional samples between them.

    Attributes
    ----------
    times : (k,) array
        Sample times [s].
    stored : (k,) array of bool
        Whether a sample is kept.
    """

    times: Array
    stored: Mask

    def kept(self, solution: Solution) -> Solution:
        """Return the solution with the requested samples and the state at an event only."""
        keep = np.ones(solution.t.size, dtype=bool)
        keep[: solution.samples] = self.stored[: solution.samples]
        names = ("t", "q", "v", "a", "multipliers", "kinetic_energy", "strain_energy", "work")
        return replace(solution, **{name: getattr(solution, name)[keep] for name in names})


def with_between(times: Array, coordinates: int, limits: StepLimits | None = None) -> RefinedTimes | None:
    """Return sample times with additional ones evenly between them.

    There are more where inputs change fast, as in a pulse. The result is None if there are no intervals, or if the
    additional samples would take too much memory.

    Parameters
    ----------
    times : (k,) array
        Sample times, ascending [s].
    coordinates : int
        Number of coordinates of the system.
    limits : StepLimits, optional
        Longest steps that resolve the inputs; None for no limits.
    """
    pieces = times.size - 1
    if pieces < 1:
        return None
    finer = max(_FINER, math.ceil((_LEAST - 1) / pieces))
    if pieces * finer * coordinates > _MOST_NUMBERS:
        return None
    fractions = np.arange(finer) / finer
    steps = times[:-1, None] + np.diff(times)[:, None] * fractions
    found = np.append(steps.ravel(), times[-1])
    if limits is not None and limits.times.size:
        more = list(_fast_pieces(limits, float(np.min(np.diff(found))), times))
        if (found.size + sum(part.size for part in more)) * coordinates <= _MOST_NUMBERS:
            found = np.unique(np.concatenate([found, *more]))
    return RefinedTimes(found, np.isin(found, times))


def _fast_pieces(limits: StepLimits, spacing: float, times: Array) -> Iterator[Array]:
    """Yield times in pieces in which inputs change faster than samples at a spacing resolve."""
    ends = np.append(limits.times[1:], times[-1])
    for first, last, step in zip(limits.times, np.minimum(ends, times[-1]), _PART_OF_STEP * limits.steps, strict=True):
        first = max(first, times[0])
        if step < spacing and last > first and (last - first) / step <= _MOST_NUMBERS:
            yield np.linspace(first, last, math.ceil((last - first) / step) + 1)


def samples_too_few(
    system: System, whole: Solution, kept: Solution, samples: int, more: Iterable[tuple[str, str, Array]] = ()
) -> Finding | None:
    """Return a finding on loads that are larger between the samples that a run keeps, or None if there are none.

    Parameters
    ----------
    system : System
        System of the run.
    whole, kept : Solution
        Solution with the additional samples and without them.
    samples : int
        Number of samples requested for the run.
    more : iterable of (str, str, (k,) array)
        Name, unit and magnitudes of further loads.
    """
    if whole.t.size == kept.t.size:
        return None
    weight = _GRAVITY * system.total_mass
    least = {"MPa": _NO_STRESS, "N": _NO_FORCE * weight, "N m": _NO_FORCE * weight * system.size}
    found, times_as_many = [], 1.0
    # Values of a failed run may overflow.
    with np.errstate(all="ignore"):
        for name, unit, loads in (*_largest_loads(system, whole), *more):
            most, most_kept = float(np.max(loads)), float(np.max(loads[np.isin(whole.t, kept.t)]))
            if most > max((1.0 + LARGER) * most_kept, least[unit]):
                when = whole.t[np.argmax(loads)]
                found.append(
                    f"{name} is up to {most_kept:.4g} {unit} in them and {most:.4g} {unit} at t = {when:.4g} s"
                )
                enough = _pieces(whole.t, loads, (1.0 - _NEARLY) * most)
                times_as_many = max(times_as_many, enough / max(kept.t.size - 1, 1))
    if not found:
        return None
    remedy = _round_number(times_as_many * (samples - 1)) + 1
    text = f"{samples} samples are too few to show the largest loads: {'; '.join(found)}"
    return Finding(COARSE, SAMPLES, text, f"give samples = {remedy}")


def _largest_loads(system: System, solution: Solution) -> Iterator[tuple[str, str, Array]]:
    """Yield the largest of each kind of load at all samples (k,), with its name and unit."""
    multipliers = np.nan_to_num(solution.multipliers)
    motion = solution.q, solution.v, solution.a, multipliers
    sections = sections_of(system)
    if sections is not None and np.isfinite(sections.modulus).any():
        widest = max(len(part.x) for part in sections.parts)
        yield "the stress", "MPa", 1e-6 * _largest(partial(sections.largest_stress, system), motion, widest)
    # Forces have poles at singular positions.
    if solution.singular_positions:
        return
    names = [joint.name for joint in system.mechanism.joints]
    if names:
        none, largest = np.zeros((len(solution.q), len(system.mechanism.motors))), np.zeros(len(solution.q))
        for name in names:
            force = joint_loads(system, [name], solution.q, multipliers, none).force[:, 0]
            np.maximum(largest, np.hypot(*force.T), out=largest)
        yield "the force in a joint", "N", largest
    for one, effort in zip(system.mechanism.prescribed, drive_torques(system, multipliers).T, strict=True):
        unit = "N" if system.mechanism.slides(one.joint) else "N m"
        yield f"the {'force' if unit == 'N' else 'torque'} of {one.place}", unit, np.abs(effort)


def _largest(loads: Callable[..., Array], motion: Sequence[Array], width: int) -> Array:
    """Return the loads at k samples (k,), computed for some at a time, each with so many numbers."""
    count = max(_AT_A_TIME // width, 1)
    parts = range(0, len(motion[0]), count)
    return np.concatenate([loads(*(each[first : first + count] for each in motion)) for first in parts])


def _pieces(t: Array, loads: Array, enough: float) -> float:
    """Return the least number of equal pieces of a run whose ends show a load of at least `enough`.

    All larger numbers up to that of the samples show it as well.
    """
    span = t[-1] - t[0]
    if t.size * np.min(np.diff(t)) < 0.9 * span:
        # There are more samples in a pulse: pieces are no longer than the pulse.
        low = np.flatnonzero(loads < enough)
        at = np.searchsorted(low, int(np.argmax(loads)))
        first, last = t[low[at - 1]] if at > 0 else t[0], t[low[at]] if at < low.size else t[-1]
        return float(span / (last - first))
    step = 1
    while step + 1 < loads.size and np.max(loads[:: step + 1]) >= enough:
        step += 1
    return (t.size - 1) / step


def _round_number(number: float) -> int:
    """Return the next larger number with two significant digits."""
    unit = 10 ** max(int(math.log10(max(number, 1.0))) - 1, 0)
    return unit * math.ceil(number / unit)
