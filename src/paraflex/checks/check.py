"""All checks of a model together, with those of its start without a path and of unused entries of its file."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

from paraflex.arguments import checked_arguments
from paraflex.dynamics import start_state
from paraflex.errors import InputError, NumericalError
from paraflex.files import Model, load
from paraflex.files.schema import ModelTable
from paraflex.findings import Finding, Verdict
from paraflex.integrators import loose_tolerance
from paraflex.mechanism import ActuationMode, Mechanism, Start
from paraflex.tracking import TrackingTask
from paraflex.units import without_quantities
from paraflex.validity.numbers import FAST, implausible_numbers, mechanism_size
from .pose import Examination, examine, pose_findings
from .study import path_findings, study_findings, task_findings

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
    seen = examine(model.mechanism, assembly or model.study.assembly)
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
