"""All checks of a model together: its study, its start without a path, and unused entries of its file."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from paraflex.actuation import actuation_condition
from paraflex.arguments import checked_arguments
from paraflex.control.shaping.shaped import ShapedPath
from paraflex.dynamics import start_state
from paraflex.equilibria.conditions import StaticsDefaults
from paraflex.errors import ActuationError, AssemblyError, InputError, NumericalError, UnreachablePathError
from paraflex.files import Model, load
from paraflex.files.schema import ModelTable
from paraflex.findings import Finding, Verdict
from paraflex.integrators import loose_tolerance
from paraflex.mechanism import ActuationMode, Mechanism, Start, TimeProfile, standing
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.profiles import PiecewiseProfile, SpeedProfile, TabulatedProfile, marks
from paraflex.paths import Circle, Path
from paraflex.tracking import TrackingTask
from paraflex.units import without_quantities
from paraflex.validity.actions import LOADED_AT_REST
from paraflex.validity.numbers import FAST, STANDARD_GRAVITY, implausible_numbers, mechanism_mass, mechanism_size
from paraflex.validity.plausibility import implausible_torques
from .pose import Examination, examine, pose_findings

# Condition number of the actuation matrix above which a nearby singular configuration dominates torques.
ILL_CONDITIONED = 1e3
# Speed [m/s] and acceleration [m/s^2] of an end-effector above any machine: the fastest robots have 150 m/s^2.
FASTEST, SHARPEST = 50.0, 2000.0
# Largest number of turns of a path along a circle.
_TURNS = 8.0
# Duration of a run relative to that of its path above which nearly all of it is rest; and that of the plan here.
DWELL, _REST = 100.0, 2.0
# Samples per turn below which the motion of a drive cannot be seen.
SAMPLES_A_TURN = 6.0
# Number of samples at which a plan is evaluated.
_SAMPLES = 201
_SAME_TIME = 1e-9
# Fraction of a path's extent that counts as zero.
_STILL = 1e-6


def study_findings(
    model: Model, path: str | None = None, assembly: str | None = None, modes: Sequence[str] | None = None
) -> Iterator[Finding]:
    """Yield findings about the study of a model; see `check` for the arguments."""
    if not model.paths and path is None:
        if model.study.duration is None and model.statics == StaticsDefaults():
            yield Finding("duration-missing", "study.duration", "no path and no duration", "give one, in s")
        yield from profiles_cut_short(model.mechanism, model.study.duration)
        yield from _few_samples(model)
        yield from _given_torques(model)
        return
    if model.mechanism.end_effector is None:
        yield Finding(
            "end-effector-missing", "end_effector", "there is a path, but no end-effector to follow it",
            "add an [end_effector] table with its point",
        )  # fmt: skip
        return
    names = model.study.paths if path is None and model.study.paths else (model.path_name(path),)
    found = {name: [*_of_path(model, name, assembly, modes)] for name in names}
    shared = [one for one in found[names[0]] if all(one in of_path for of_path in found.values())]
    yield from shared
    for name, of_path in found.items():
        for one in of_path:
            if one not in shared:
                of_its_place = one.place.startswith("path.")
                yield one if of_its_place else replace(one, text=f"on path {name}, {one.text}")


def _of_path(model: Model, name: str, assembly: str | None, modes: Sequence[str] | None) -> Iterator[Finding]:
    """Yield findings about one path of a study."""
    chosen, duration = model.paths[name], model.duration(name)
    if duration < chosen.duration:
        # Imports xarray, which descriptions of mechanisms do without.
        from paraflex.results.dataset import part_of

        part = part_of(chosen, duration)
        if part is not None:
            yield part.finding()
    yield from path_findings(model, chosen, name, duration)
    try:
        # The mechanism is at rest after the path.
        end = min(duration, _REST * model.driven_for(chosen))
        task = model.plan(chosen, mechanism=model.mechanism.rigid(), duration=end, samples=_SAMPLES, assembly=assembly)
    except UnreachablePathError as error:
        yield Finding(
            "path-unreachable", f"path.{name}", str(error), "move the path or the bases, or choose another assembly"
        )
    except AssemblyError:
        # The pose check reports that the assembly does not close.
        return
    except NumericalError as error:
        yield Finding("path-unreachable", f"path.{name}", str(error), "move the path")
    except InputError as error:
        code = "task-freedoms" if error.field == "end_effector.coordinates" else "study-refused"
        yield Finding(code, error.field, error.problem, error.remedy)
    else:
        yield from _driven(model, task, modes)


def task_findings(task: TrackingTask, modes: Sequence[ActuationMode], *, magnitudes: bool = False) -> Iterator[Finding]:
    """Yield findings about modes along a planned path: singular configurations, and friction beyond the motors.

    `magnitudes` adds torques and forces that are implausible; a run reports those it applied itself.
    """
    for mode in modes:
        try:
            torques = task.torques(mode).evaluate(task.motion.t)
        except (ActuationError, NumericalError) as error:
            yield Finding("path-singular", f"mode.{mode.name}", str(error), "move the path, or add motors to the mode")
            continue
        condition = actuation_condition(task.effort, mode)
        worst = float(np.max(condition))
        if worst > ILL_CONDITIONED:
            yield Finding(
                "path-ill-conditioned", f"mode.{mode.name}",
                f"its actuation matrix has a condition number of {worst:.3g} on the path: near a singular position",
                "move the path, or add motors to the mode",
            )  # fmt: skip
        yield from _friction(task.mechanism, mode, np.max(np.abs(torques), axis=0))
        if magnitudes:
            yield from implausible_torques(task.system, task.driven(mode.name, torques, condition), task.motion.t)


def path_findings(model: Model, path: Path, name: str, duration: float) -> Iterator[Finding]:
    """Yield findings about a path before it is planned."""
    yield from profiles_cut_short(model.mechanism, duration)
    yield from _too_fast(name, path, duration)
    yield from _unfollowed_motion(model.mechanism, name, path)
    if duration > DWELL * path.duration > 0.0:
        yield Finding(
            "duration-long", "study.duration", f"{duration:.4g} s, where the path takes {path.duration:.4g} s",
            "it is in s: is it in ms?",
        )  # fmt: skip
    yield from _turns(f"path.{name}", path, model.study.orientation)


def _too_fast(name: str, path: Path, duration: float) -> Iterator[Finding]:
    motion = path.evaluate(np.linspace(0.0, min(duration, path.duration), _SAMPLES))
    speed, acceleration = (
        float(np.max(np.linalg.norm(part, axis=1))) for part in (motion.velocity, motion.acceleration)
    )
    if speed > FASTEST or acceleration > SHARPEST:
        yield Finding(
            "path-fast", f"path.{name}", f"it asks for {speed:.3g} m/s and {acceleration:.3g} m/s^2",
            "max_acceleration is in m/s^2, times are in s, places in m",
        )  # fmt: skip


def _unfollowed_motion(mechanism: Mechanism, name: str, path: Path) -> Iterator[Finding]:
    """Yield a path that moves, but not along the coordinates that the end-effector follows."""
    if mechanism.end_effector is None:
        return
    task = mechanism.end_effector.coordinates
    ways = np.ptp(path.evaluate(np.linspace(0.0, path.duration, _SAMPLES)).position, axis=0)
    moves = {axis: float(way) for axis, way in zip(("x", "y"), ways, strict=False)}
    still, moving = [axis for axis in moves if axis in task], [axis for axis in moves if axis not in task]
    if still and "angle" not in task and moving and max(moves[axis] for axis in still) < _STILL * moves[moving[0]]:
        yield Finding(
            "path-idle", f"path.{name}",
            f"it goes {moves[moving[0]]:.3g} m along {moving[0]} and none along {still[0]}, which alone the "
            "end-effector follows",
            "are its coordinates [x, y] swapped, or those of [end_effector]?",
        )  # fmt: skip


def _few_samples(model: Model) -> Iterator[Finding]:
    """Yield drives that rotate so far between two samples that their motion cannot be seen."""
    duration, count = model.study.duration, model.study.samples
    for one in model.mechanism.prescribed:
        if duration is None or model.mechanism.slides(one.joint):
            continue
        angle, _, _ = one.profile.evaluate(np.array([0.0, duration]))
        turns = abs(float(angle[1] - angle[0])) / (2.0 * math.pi)
        if turns > 1.0 and (count - 1) < SAMPLES_A_TURN * turns:
            yield Finding(
                "samples-few", "study.samples",
                f"{count} samples of {turns:.3g} turns of prescribed.{one.name} in {duration:.3g} s: "
                f"{(count - 1) / turns:.2g} a turn do not resolve its motion",
                "are speeds in rad/s, and the duration in s? If so, keep more samples",
            )  # fmt: skip


def _turns(place: str, path: Path, orientation: float) -> Iterator[Finding]:
    """Yield angles of a path and of the end-effector that are likely in degrees."""
    angles = {"study.orientation": (orientation, 1.0)}
    if isinstance(path, ShapedPath):
        path = path.path
    if isinstance(path, Circle):
        angles |= {f"{place}.start_angle": (path.start_angle, 1.0), f"{place}.sweep": (path.sweep, _TURNS)}
    for where, (angle, most) in angles.items():
        if abs(angle) > most * 2.0 * math.pi:
            yield Finding(
                "angle", where, f"{angle:g} rad are {abs(angle) / (2.0 * math.pi):.3g} turns",
                f"angles are in radians: {angle:g} degrees are {math.radians(angle):.4g} rad",
            )  # fmt: skip


def _driven(model: Model, task: TrackingTask, names: Sequence[str] | None) -> Iterator[Finding]:
    mechanism = model.mechanism
    requested = model.modes(names or ())
    if not requested:
        what = "no actuation mode" if mechanism.motors else "no motor"
        yield Finding(
            "mode-missing", "mode", f"there is a path, but {what} to drive the mechanism along it",
            "add a [mode] table, or modes to [study]" if mechanism.motors else "add a [motor] table",
        )  # fmt: skip
    yield from task_findings(task, requested, magnitudes=True)


def _friction(mechanism: Mechanism, mode: ActuationMode, peaks: np.ndarray) -> Iterator[Finding]:
    """Yield friction that requires more of a motor's torque than everything else."""
    units = mechanism.motor_units()
    for k, motor in enumerate(mechanism.motors):
        limit = sum(one.limit for one in mechanism.frictions if one.joint == motor.joint)
        if motor.name in mode.motors and 2.0 * limit > peaks[k]:
            name = next(one.name for one in mechanism.frictions if one.joint == motor.joint)
            yield Finding(
                "friction-large", f"friction.{name}.limit",
                f"{limit:.3g} {units[k]}, where motor {motor.name} gives {peaks[k]:.3g} {units[k]} at most in mode "
                f"{mode.name}: most of it overcomes friction",
                f"it is in {units[k]}",
            )  # fmt: skip


def _given_torques(model: Model) -> Iterator[Finding]:
    """Yield given torques above those that move all bodies, and friction that they do not overcome."""
    mechanism = model.mechanism
    size, weight = mechanism_size(mechanism), STANDARD_GRAVITY * mechanism_mass(mechanism)
    for motor, unit in zip(mechanism.motors, mechanism.motor_units(), strict=True):
        torque = _largest_torque(model.study.torques.get(motor.name, 0.0), model.study.duration or 0.0)
        if torque > LOADED_AT_REST * weight * (size if unit == "N m" else 1.0) > 0.0:
            yield Finding(
                "load-large", f"study.torques.{motor.name}",
                f"{torque:.3g} {unit}, where all bodies weigh {weight:.3g} N, in a mechanism of {size:.3g} m",
                f"it is in {unit}",
            )  # fmt: skip
        for one in mechanism.frictions:
            if one.joint == motor.joint and 0.0 < torque <= one.limit:
                yield Finding(
                    "friction-large", f"friction.{one.name}.limit",
                    f"{one.limit:.3g} {unit}, where motor {motor.name} gives {torque:.3g} {unit}: it does not move",
                    f"it is in {unit}",
                )  # fmt: skip


def _largest_torque(torque: InTime, duration: float) -> float:
    """Return the largest magnitude of a torque up to a time, knots and rows of its profile included [N m]."""
    if not isinstance(torque, TimeProfile):
        return abs(torque)
    times = [*np.linspace(0.0, duration, _SAMPLES), *(time for time in marks(torque) if 0.0 <= time <= duration)]
    return float(np.max(np.abs(torque.evaluate(np.array(times))[0])))


def profiles_cut_short(mechanism: Mechanism, duration: float | None) -> Iterator[Finding]:
    """Yield prescribed motions and loads whose pieces or tables extend beyond the end of a run."""
    profiles = [(f"prescribed.{one.name}", one.profile) for one in mechanism.prescribed]
    profiles += [(f"load.{one.name}", profile) for one in mechanism.loads for profile in one.profiles[:1]]
    for place, whole in profiles:
        profile = whole.speed if isinstance(whole, SpeedProfile) else whole
        if isinstance(profile, PiecewiseProfile):
            end = profile.ends[-1] if profile.ends else 0.0
        elif isinstance(profile, TabulatedProfile):
            end = profile.times[-1]
        else:
            continue
        if duration is not None and end > duration * (1.0 + _SAME_TIME):
            yield Finding(
                "law-cut-short", place,
                f"the run ends at {duration:.4g} s, the profile goes on to {end:.4g} s",
                "give the study a duration of at least that, in s",
            )  # fmt: skip


_NAME = re.compile(r"[^\W\d]\w*")


def loaded(model: Model | Mechanism | str | FilePath) -> Model | Mechanism:
    """Return a model or mechanism unchanged, or load the model of a name or file."""
    return load(model) if isinstance(model, str | FilePath) else model


@checked_arguments()
def check(
    model: Model | Mechanism | str | FilePath,
    *,
    path: str | None = None,
    assembly: str | None = None,
    modes: Sequence[str] | None = None,
    seen: Examination | None = None,
) -> Verdict:
    """Check a model before it runs: whether its numbers are plausible, it closes as intended, and its study can run.

    Parameters
    ----------
    model : Model, Mechanism, str or Path
        Model to check, or its name or file. A mechanism alone has no study to check.
    path : str, optional
        Name of one of the model's paths; the study's by default.
    assembly : str, optional
        Name of the assembly; by default the study's, or the first.
    modes : sequence of str, optional
        Actuation modes along the path; by default the study's, or all of the mechanism.
    seen : Examination, optional
        Examination of the mechanism, if it has been made.

    Returns
    -------
    Verdict
        Verdict, sound, doubtful or wrong, with a `Finding` for each reason: code, place, text and remedy.

    Raises
    ------
    InputError
        A file cannot be read, a path, assembly or mode is unknown, or there is nothing to check.
    """
    model = loaded(model)
    mechanism = model if isinstance(model, Mechanism) else model.mechanism
    if isinstance(model, Model):
        assembly = assembly or model.study.assembly
    seen = seen or examine(mechanism, assembly)
    at_rest = not isinstance(model, Model) or model.start is None
    duration = model.study.duration if isinstance(model, Model) else None
    found: list[Finding] = [*implausible_numbers(mechanism, duration), *pose_findings(seen, at_rest=at_rest)]
    if isinstance(model, Model):
        refused = list(start_findings(model, seen, assembly))
        if model.start is not None and seen.chosen is not None and seen.chosen.undecided and not refused:
            decided = "assembly-open", f"assembly.{seen.chosen.assembly}"
            found = [one for one in found if (one.code, one.place) != decided]
        found += [*file_findings(model), *refused]
        loose = loose_tolerance(model.study.integration().tolerance_for(seen.system), seen.system.size)
        found += [] if loose is None else [loose]
    # Without an assembly there is no pose to run from.
    if isinstance(model, Model) and seen.starts:
        short = {one.place for one in found if one.code == "mode-short"}
        found += [one for one in study_findings(model, path, assembly, modes) if one.place not in short]
    return Verdict(found)


def check_planned(
    model: Model, task: TrackingTask, path: str, modes: Sequence[ActuationMode], assembly: str | None
) -> Verdict:
    """Check a study along a path of that name, planned and about to run.

    Modes that cannot drive the mechanism are reported by the run.
    """
    chosen = assembly or model.study.assembly
    as_planned = task.mechanism is standing(model.mechanism, chosen)
    seen = examine(model.mechanism, chosen, task.system if as_planned else None)
    found = [*implausible_numbers(model.mechanism), *pose_findings(seen), *task_findings(task, modes)]
    found += file_findings(model)
    found += path_findings(model, task.path, path, float(task.motion.t[-1]))
    return Verdict(one for one in found if one.code not in ("path-singular", "mode-short"))


def start_findings(model: Model, seen: Examination, assembly: str | None) -> Iterator[Finding]:
    """Yield findings about values of [start] that joints, prescribed motions or other values do not allow."""
    open_ = seen.chosen is None or not (seen.chosen.closes or seen.chosen.undecided)
    if model.start is None or (seen.starts and open_):
        return
    chosen = model.mechanism.assembly(assembly) if seen.starts else None
    try:
        start_state(seen.system, model.start, chosen)
        yield from _fast(model.mechanism, model.start)
    except InputError as error:
        yield Finding("start-refused", error.field, error.problem, error.remedy)
    except NumericalError as error:
        yield Finding("start-refused", "start", str(error), "give a start that the joints allow")


def _fast(mechanism: Mechanism, start: Start) -> Iterator[Finding]:
    """Yield angular velocities above those of any body."""
    size = mechanism_size(mechanism)
    for body, rate in start.angular.items():
        if abs(rate) * size > FAST:
            yield Finding(
                "speed-large", f"start.velocity.angular.{body}",
                f"{rate:.4g} rad/s, in a mechanism of {size:.3g} m",
                "speeds are in rad/s: one turn a minute is 0.105 of them, a degree a second 0.0175",
            )  # fmt: skip


def file_findings(model: Model) -> Iterator[Finding]:
    """Yield findings about entries of a model's file without effect, and about omissions that are likely mistakes."""
    yield from _unused(model.parameters)
    if model.paths and model.study.torques:
        yield Finding(
            "unused", "study.torques", "the study has a path, whose torques are planned: given ones are not applied",
            "leave them out, or the paths",
        )  # fmt: skip
    springs = model.parameters.get("linear_spring", {})
    for spring in model.mechanism.linear_springs:
        if spring.stiffness > 0.0 and spring.name in springs and "length" not in springs[spring.name]:
            yield Finding(
                "spring-rest", f"linear_spring.{spring.name}.length",
                "no free length is given: the spring pulls with all the distance between its points",
                "give its free length in m, or length = 0.0 if it has none",
            )  # fmt: skip


def _unused(data: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield parameters, sections, materials, lumped masses and ground points of a file that nothing refers to.

    Any text of the file that contains the name counts as a use of it.
    """
    texts = list(_texts(data))
    words = {word for text in texts for word in _NAME.findall(without_quantities(text))}
    names = set(texts)
    used = {
        "parameters": lambda name: name in words,
        "ground": lambda name: f"ground.{name}" in names,
        **dict.fromkeys(("section", "material", "lump"), lambda name: name in names),
    }
    for table, is_used in used.items():
        entries = data.get(table)
        for name in entries if isinstance(entries, Mapping) else ():
            if not is_used(name):
                what = "no expression uses it" if table == "parameters" else "nothing in the file names it"
                remedy = "leave it out, or check which name stands where it should be used"
                if table == "ground" and name in ModelTable.model_fields:
                    remedy = f"put it before the first table of the file, if {name} of the mechanism is meant"
                yield Finding("unused", f"{table}.{name}", what, remedy)


def _texts(value: Any, *, key: str = "") -> Iterator[str]:
    """Yield all texts in tables and lists, and the keys of tables that name points."""
    if isinstance(value, str):
        # Names and descriptions of a model refer to nothing.
        if key not in ("name", "description"):
            yield value
    elif isinstance(value, Mapping):
        for name, one in value.items():
            if "." in str(name):
                yield str(name)
            yield from _texts(one, key=str(name))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _texts(one)
