"""All checks of a model together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath

from paraflex.arguments import checked_arguments
from paraflex.checks.pose import Examination, examine, pose_findings
from paraflex.checks.start import start_findings
from paraflex.checks.study import path_findings, study_findings, task_findings
from paraflex.checks.unused import file_findings
from paraflex.errors import InputError
from paraflex.files import Model, load
from paraflex.findings import Finding, Verdict
from paraflex.integrators import loose_tolerance
from paraflex.mechanism import ActuationMode, Mechanism
from paraflex.tracking import TrackingTask
from paraflex.validity.numbers import implausible_numbers


def loaded(model: Model | Mechanism | str | FilePath) -> Model | Mechanism:
    """Return a model or mechanism unchanged, or load the model of a name or file; other types raise an `InputError`."""
    found = load(model) if isinstance(model, str | FilePath) else model
    if isinstance(found, Model | Mechanism):
        return found
    raise InputError("not a model", field="model", value=model, remedy="give a model, a mechanism, or a file's name")


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
