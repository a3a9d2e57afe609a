"""Plausibility of the results of a run, against expectations from mass, size and speed of the mechanism."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import System, joint_coordinate, missing_rotations
from paraflex.dynamics.joint_loads import drive_torques, load_errors, undetermined_loads
from paraflex.dynamics.load_values import largest_loads
from paraflex.dynamics.rank import joint_of_row
from paraflex.dynamics.sections import sections_of
from paraflex.findings import RESOLVED, Finding
from paraflex.formatting import speed_text
from paraflex.integrators import METHODS, IntegrationOptions, Solution
from paraflex.integrators.method import NativeMethod
from paraflex.mechanism import Assembly, Mechanism, PointForce, approximate_poses, grouped
from paraflex.units import STRESS
from .bending import bending_of
from .causes import cause_among
from .numbers import FAST, STANDARD_GRAVITY, implausible_numbers, mechanism_size

# Energy error relative to the largest energy: the library's runs have up to 3e-4 with the default tolerance. Energies
# below the second fraction of weight times size count as zero.
UNBALANCED, NO_ENERGY = 1e-3, 1e-9
# Loads below this fraction of the weight, of the weight times the size, or of the largest load are ignored.
_NO_FORCE = 1e-3
_NAMED = 3
# Slope of a link in its frame above which it is more a spring than a link [rad].
STEEP = 0.7
# Tracking error over the diagonal of the path: the library's worst mode, RAParM-I's +-+-, has 0.34, dwell included.
LOST = 0.5
# Torque or force of a motor relative to that of the total mass at the acceleration of the path and under gravity, with
# all loads: the library's modes require at most 1.04 of it.
TORQUE = 30.0
# Force of a joint or drive, torques divided by the size, relative to the same; wide enough for the slowest mechanisms.
FORCE = 1000.0
# Fraction of the samples in which a force is at least as large, to exclude poles at singular configurations.
_PEAK_SHARE = 0.1
# Rotation of a body while loops are closed above which another angle or elbow was likely intended [rad].
_FAR = 0.5
# Condition number of the actuation matrix that explains large torques.
_NEAR_SINGULAR = 50.0


@dataclass(frozen=True)
class Driven:
    """Additional data of a run along a path.

    Attributes
    ----------
    mode : str
        Actuation mode of the run.
    desired, actual : (k, 2) arrays
        Desired and actual positions of the end-effector, at the samples reached [m].
    acceleration : float
        Largest acceleration of the desired motion [m/s^2].
    peaks : mapping of str to float
        Largest torque or force of each motor [N m or N].
    units : mapping of str to str
        Unit of each motor: "N m" or "N".
    condition : float
        Largest condition number of the actuation matrix.
    """

    mode: str
    desired: Array
    actual: Array
    acceleration: float
    peaks: Mapping[str, float]
    units: Mapping[str, str]
    condition: float

    @property
    def deviation(self) -> float:
        """Root mean square distance from the path [m]."""
        return float(np.sqrt(np.mean(np.sum((self.actual - self.desired) ** 2, axis=1))))


class _Context(NamedTuple):
    """Place of the findings of a run, and the mechanism whose numbers may have caused them."""

    place: str
    mechanism: Mechanism

    def likely_cause(self, *bodies: str) -> str:
        """Return the number of the model that is the most likely cause, named bodies first; empty for none."""
        return cause_among(implausible_numbers(self.mechanism), bodies)


def stiff_modes(system: System) -> Iterator[Finding]:
    """Yield bodies whose kept modes cannot represent the moments at their joints and loads."""
    for one in missing_rotations(system):
        yield Finding(
            "modes-too-stiff", f"body.{one.point.body}.modes",
            f"{one.modes} modes miss {100.0 * one.part:.0f} % of its rotation under a moment at {one.point.point} from "
            f"{one.cause}: it is too stiff there",
            'give reduction = "craig-bampton" beside modes, or leave modes out',
        )  # fmt: skip


def implausible_results(
    system: System, solution: Solution, driven: Driven | None = None, mechanism: Mechanism | None = None
) -> list[Finding]:
    """Return findings about implausible results of a run.

    Parameters
    ----------
    system : System
        System of the run.
    solution : Solution
        Samples of the whole run or of a part.
    driven : Driven, optional
        Data of a run along a path driven by torques.
    mechanism : Mechanism, optional
        Mechanism as described by the user, if the system is that of its finite segments.

    Returns
    -------
    list of Finding
        Findings whose remedies name the quantity of the model that is the most likely cause.
    """
    if not solution.t.size:
        return []
    mechanism = mechanism or system.described
    where = _Context("" if driven is None else f"mode {driven.mode}", mechanism)
    undamped = any(body.damping.size > 0 and not body.damping.any() for body in system.bodies)
    found = [
        *stiff_modes(system),
        *_large_slopes(where, system, solution),
        *implausible_stresses(system, solution, where),
        *_unbalanced(where, system, solution),
        # No default method resolves axial vibrations of undamped beams: tables give the errors with the values.
        *(_begun_singular(solution, where.place) if undamped else unresolved_loads(system, solution, where.place)),
        *_excessive_speeds(where, system, solution),
        *_large_forces(where, system, solution),
        *shared_loads(system, solution),
    ]
    if driven is not None:
        found += [*_lost_control(where, driven), *implausible_torques(system, driven, solution.t, mechanism)]
    return found


def shared_loads(system: System, solution: Solution) -> Iterator[Finding]:
    """Yield findings about loads of joints and drives that redundant constraints share arbitrarily."""
    names = [joint.name for joint in system.described.joints]
    found = undetermined_loads(system, names, solution.q, solution.acting)
    # Loads have poles at singular configurations.
    regular = np.isfinite(solution.multipliers).any(axis=1)
    drives = [one.place for one in system.described.prescribed]
    forces, moments, drives_too = (
        np.any(found.force[regular], axis=(0, 2)),
        np.any(found.moment[regular], axis=0),
        np.any(found.drive[regular], axis=0),
    )
    kinds = ("forces in", names, forces), ("moments in", names, moments), ("torques or forces of", drives, drives_too)
    named = [(kind, ", ".join(itertools.compress(whose, at))) for kind, whose, at in kinds]
    parts = [f"{kind} {which}" for kind, which in named if which]
    if parts:
        yield Finding(
            "loads-undetermined", "", f"{' and '.join(parts)} are not determined, because constraints are redundant, "
            "and tables omit them",
            "leave out redundant joints or drives, with `slot` or `revolute` in place of `prismatic` or `weld` "
            "ones, or make the links between them flexible",
        )  # fmt: skip


def _large_slopes(where: _Context, system: System, solution: Solution) -> Iterator[Finding]:
    bendings = [bending_of(system, body.name, solution) for body in system.bodies if body.nf]
    slopes = {
        name: np.max([one.slope for one in bendings if one.name == name], axis=0)
        for name in dict.fromkeys(one.name for one in bendings)
    }
    if not slopes:
        return
    worst = max(slopes, key=lambda name: np.max(slopes[name]))
    k = int(np.argmax(slopes[worst]))
    if slopes[worst][k] > STEEP:
        blame = where.likely_cause(worst) or (
            f"look at section and Young's modulus of {worst}, and at its motion and loads"
            + _moving(where.mechanism, system, solution)
        )
        yield Finding(
            "deflection-large", where.place,
            f"{worst} bends by {slopes[worst][k]:.2g} rad at {solution.instant(int(k), 4)}: more a spring than a link",
            blame,
        )  # fmt: skip


def implausible_stresses(system: System, solution: Solution, where: _Context | None = None) -> Iterator[Finding]:
    """Yield beams of equilibria or of a run that are stressed beyond the strength of their material."""
    where, sections = where or _Context("", system.described), sections_of(system)
    if sections is None or not np.isfinite(sections.strength).any():
        return
    loads = sections.loads(system, solution.q, solution.v, solution.a, solution.multipliers)
    used = np.nan_to_num(loads.stress / loads.strength)
    k, station = np.unravel_index(np.argmax(used), used.shape)
    if used[k, station] > 1.0:
        name, start = system.carrier(sections.owners[station])
        stress, strength = (STRESS.factor * one[k, station] for one in (loads.stress, loads.strength))
        yield Finding(
            "stress-over-strength", where.place,
            f"a stress of {stress:.3g} {STRESS.name} in {name} at {start + loads.x[k, station]:.3g} m, "
            f"{solution.instant(int(k), 4)}: its material bears {strength:.3g} {STRESS.name}, the safety factor is "
            f"{1.0 / used[k, station]:.2g}",
            where.likely_cause(name) or (
                f"give {name} a stronger section or material, or move and load it less"
                + _moving(where.mechanism, system, solution)
            ),
        )  # fmt: skip


def _unbalanced(where: _Context, system: System, solution: Solution) -> Iterator[Finding]:
    """Yield runs whose energy does not balance the work."""
    energy = np.abs(solution.kinetic_energy) + np.abs(solution.strain_energy)
    # Models without energies have NaN.
    largest = max(float(np.nanmax(each, initial=0.0)) for each in (energy, np.abs(solution.work)))
    largest = max(largest, _turned_over(system, solution))
    least = NO_ENERGY * system.total_mass * STANDARD_GRAVITY * system.size
    off = solution.energy_balance_max
    if not (largest > least and off > UNBALANCED * largest):
        return
    # Work of the largest force on a position error of the default tolerance.
    force = max((load for (_, unit), load in _peaks(system, solution).items() if unit == "N"), default=0.0)
    explained = IntegrationOptions().tolerance_for(system) * force
    if off > explained:
        yield Finding(
            "energy-unbalanced", where.place,
            f"energy and work do not balance: {100.0 * off / largest:.2g} % of the largest "
            "energy or work is missing or too much, and motion and stresses may be as far off",
            "give a smaller tolerance or shorter steps; damping of the material helps where stiff links vibrate",
        )  # fmt: skip


def _turned_over(system: System, solution: Solution) -> float:
    """Return the work that prescribed motions do and absorb, both counted positive [J]."""
    torques = np.nan_to_num(drive_torques(system, solution.multipliers))
    rates = [joint_coordinate(system, one.joint, solution.q, solution.v).rate for one in system.mechanism.prescribed]
    power = sum(np.abs(torque * rate) for torque, rate in zip(torques.T, rates, strict=True))
    return float(np.trapezoid(power, solution.t)) if rates else 0.0


def _begun_singular(solution: Solution, place: str) -> Iterator[Finding]:
    """Yield findings about runs by solvers of other packages that begin at a singular configuration."""
    begun = solution.t.size and solution.t[0] in solution.singular_positions
    if begun and not isinstance(METHODS[solution.method], NativeMethod):
        text = f"{solution.method} begins at a singular position: forces near it may be off by several times their size"
        yield Finding(
            "forces-unresolved", place, text, "choose one of paraflex's own methods, or start beside this pose"
        )


def unresolved_loads(system: System, solution: Solution, place: str = "") -> Iterator[Finding]:
    """Yield findings about forces uncertain by integration errors, for example by vibrations faster than the steps."""
    yield from _begun_singular(solution, place)
    if solution.multiplier_errors is None:
        return
    error = _loads(system, solution.multiplier_errors)
    peak = _peaks(system, solution)
    weight = system.total_mass * STANDARD_GRAVITY
    least = {
        unit: _NO_FORCE * max([weight * arm, *(peak[one] for one in peak if one[1] == unit)])
        for unit, arm in (("N", 1.0), ("N m", system.size))
    }
    off = [one for one in peak if error[one] > RESOLVED * peak[one] and peak[one] > least[one[1]]]
    if not off:
        return
    worst = sorted(off, key=lambda one: -error[one] / peak[one])[:_NAMED]
    listed = "; ".join(
        f"the {name} by {error[name, unit]:.1g} of {peak[name, unit]:.3g} {unit}" for name, unit in worst
    )
    text = f"forces may be off by errors of integration: {listed}"
    text += f" and {len(off) - len(worst)} more" if len(off) > len(worst) else ""
    yield Finding("forces-unresolved", place, text, 'give a smaller tolerance, or control = "forces"')


def _peaks(system: System, solution: Solution) -> dict[tuple[str, str], float]:
    """Return bounds of the largest loads of a run, by the names of `_loads`."""
    return _loads(system, np.nanmax(np.abs(solution.multipliers), axis=0, initial=0.0))


def _loads(system: System, multipliers: Array) -> dict[tuple[str, str], float]:
    """Return bounds of the loads of joints and prescribed motions, by name and unit, from those of multipliers (m,)."""
    names, prescribed = [joint.name for joint in system.mechanism.joints], system.mechanism.prescribed
    found, drives = load_errors(system, names, multipliers), {}
    for one, load in zip(prescribed, found.drive.tolist(), strict=True):
        what, unit = ("force", "N") if system.mechanism.slides(one.joint) else ("torque", "N m")
        drives[f"{what} of {one.place}", unit] = load
    forces = {(f"force in {name}", "N"): load for name, load in zip(names, found.force.tolist(), strict=True)}
    moments = {(f"moment in {name}", "N m"): load for name, load in zip(names, found.moment.tolist(), strict=True)}
    return forces | moments | drives


def _excessive_speeds(where: _Context, system: System, solution: Solution) -> Iterator[Finding]:
    speeds = np.stack([np.linalg.norm(solution.v[:, body.position], axis=1) for body in system.bodies], axis=1)
    k, b = np.unravel_index(np.argmax(np.where(np.isfinite(speeds), speeds, -1.0)), speeds.shape)
    if speeds[k, b] > FAST:
        name = system.carrier(system.bodies[b].name)[0]
        yield Finding(
            "speed-large", where.place,
            f"{name} moves at {speeds[k, b]:.3g} m/s at {solution.instant(int(k), 4)}",
            where.likely_cause() or "look at loads and torques (N, N m), prescribed motions (rad, s) and stiffnesses",
        )  # fmt: skip


def _lost_control(where: _Context, driven: Driven) -> Iterator[Finding]:
    extent = float(np.linalg.norm(np.ptp(driven.desired, axis=0)))
    error = driven.deviation
    if error > LOST * extent > 0.0:
        soft = (
            "torques are planned for rigid links and not corrected: are links much too soft for the path's "
            "acceleration, in their sections and moduli?"
        )
        others = _resisting(where.mechanism)
        yield Finding(
            "error-large", where.place,
            f"the tracking error is {error:.3g} m on a path that is {extent:.3g} m large: it is not followed",
            where.likely_cause() or (f"{others}; {soft}" if others else soft),
        )  # fmt: skip


def implausible_torques(
    system: System, driven: Driven, t: Array, mechanism: Mechanism | None = None
) -> Iterator[Finding]:
    """Yield large torques and forces of a plan, or of a run, at times t (k,).

    The mechanism is the one that the user described, by default that of the system.
    """
    mechanism = mechanism or system.mechanism
    where = _Context(f"mode {driven.mode}", mechanism)
    size = mechanism_size(mechanism) or system.size
    # Laws over the motion are not known here, NaN, and there is no finding.
    force, turning = _expected(system, mechanism, driven.acceleration, [one.largest(t) for one in mechanism.loads])
    for motor, peak in driven.peaks.items():
        unit = driven.units[motor]
        expected = force * size + turning if unit == "N m" else force + turning / size
        if peak > TORQUE * expected > 0.0:
            yield Finding(
                "torque-large", where.place,
                f"motor {motor} gives up to {peak:.3g} {unit}, where mass, size, acceleration and loads come to "
                f"{expected:.2g} {unit}",
                _resisting(mechanism) or where.likely_cause() or _singular(driven),
            )  # fmt: skip


def _expected(system: System, mechanism: Mechanism, acceleration: float, sizes: Sequence[float]) -> tuple[float, float]:
    """Return the force that accelerates and holds the total mass, with all loads [N]; and the applied torques [N m].

    `sizes` are the largest magnitudes of the loads.
    """
    loads = sum(size for one, size in zip(mechanism.loads, sizes, strict=False) if isinstance(one, PointForce))
    turning = sum(size for one, size in zip(mechanism.loads, sizes, strict=False) if not isinstance(one, PointForce))
    felt = max(acceleration + math.hypot(*mechanism.gravity), STANDARD_GRAVITY)
    return system.total_mass * felt + loads, turning


def _large_forces(where: _Context, system: System, solution: Solution) -> Iterator[Finding]:
    """Yield large forces of joints and of prescribed motions; drives of a path have motors."""
    if not solution.multipliers.size:
        return
    # A mechanism of one point has no size of its own.
    size = mechanism_size(where.mechanism) or system.size
    accelerations = np.stack([np.linalg.norm(solution.a[:, body.position], axis=1) for body in system.bodies])
    acceleration = float(np.median(np.max(accelerations, axis=0)))
    sizes = largest_loads(system, solution.t, solution.q, solution.v)
    expected, turning = _expected(system, where.mechanism, acceleration, sizes)
    # Entries are NaN at singular configurations, and for rows without multipliers in a method.
    sustained = np.quantile(np.nan_to_num(np.abs(solution.multipliers)), 1.0 - _PEAK_SHARE, axis=0)
    sustained[~system.constrained] = 0.0
    arms = np.array([size if row.endswith(" angle") else 1.0 for row in system.rows])
    forces = sustained / arms
    k = int(np.argmax(forces))
    if forces[k] > FORCE * (expected + turning / size) > 0.0:
        joint = joint_of_row(system.rows[k])
        yield Finding(
            "force-large", where.place,
            f"{joint} takes {forces[k]:.3g} N for a tenth of the time or more, where mass, acceleration and loads come "
            f"to {expected + turning / size:.2g} N",
            where.likely_cause()
            or _resisting(where.mechanism)
            or "look at masses (kg), stiffnesses and prescribed motions",
        )  # fmt: skip


def _resisting(mechanism: Mechanism) -> str:
    """List springs, dampers and friction, one of which may be in another unit."""
    resisting = ((group.table, members) for group, members in grouped(mechanism) if group.resists)
    named = [f"{table}.{one.name}" for table, members in resisting for one in members]
    return f"look at {', '.join(named)}, and their units" if named else ""


def _moving(mechanism: Mechanism, system: System, solution: Solution) -> str:
    """List prescribed motions with their largest rates, and loads with their sizes."""
    named: list[str] = []
    for one in mechanism.prescribed:
        rate = float(np.max(np.abs(one.profile.evaluate(solution.t)[1])))
        unit = "m/s" if mechanism.slides(one.joint) else "rad/s"
        named.append(f"{one.place} (up to {speed_text(rate, unit, 3)})")
    sizes = largest_loads(system, solution.t, solution.q, solution.v)
    named += [f"load.{load.name} ({size:.3g} {load.unit})" for load, size in zip(mechanism.loads, sizes, strict=False)]
    return f": {', '.join(named)}" if named else ""


def _singular(driven: Driven) -> str:
    if driven.condition > _NEAR_SINGULAR:
        return f"the path passes near a singular position of the motors (condition number {driven.condition:.3g})"
    return "look at masses (kg) and the path's acceleration (m/s^2)"


def large_rotations(system: System, assembly: Assembly, q: Array) -> Iterator[Finding]:
    """Yield bodies that rotated far while an assembly was closed or drives moved to their start; q (n,)."""
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
    """Format an angle within half a turn, in radians and degrees."""
    turned = math.remainder(angle, 2.0 * math.pi)
    return f"{turned:.3g} rad ({math.degrees(turned):.3g} degrees)"
