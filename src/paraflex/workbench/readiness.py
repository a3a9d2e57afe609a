"""One sentence on what stands in the way of a run, and where to correct it."""

from typing import Any

from paraflex.checks import check
from paraflex.equilibria import StaticsDefaults
from paraflex.errors import ParaflexError
from paraflex.files import Model
from paraflex.findings import Level
from paraflex.mechanism import RigidBody
from paraflex.results.findings import finding_lines
from .messages import Message


def readiness(
    model: Model | None, problem: ParaflexError | None, seen: Message | None, gaps: dict[str, str]
) -> Message:
    """Return what a model lacks for a run.

    Parameters
    ----------
    model : Model or None
        Model of the text; None for an empty sheet.
    problem : ParaflexError or None
        Reason why the text cannot be read, or the pose not be found.
    seen : dict or None
        Numbers of the pose, see `Seeing.full`.
    gaps : dict
        Open joints and how far they are apart.

    Returns
    -------
    dict
        `ok`, whether it can run; `sentence`; and where to go: `place` in the file, and `action`, the tool to take, or
        "run", or "pull" for a mechanism that a force bends.
    """
    if gaps:
        name, gap = next(iter(gaps.items()))
        return _not(f"The loops do not close: joint {name} is open by {gap}", ["joint", name], "shape")
    apart = model is not None and not (model.mechanism.joints or model.mechanism.linear_springs)
    where = _parts(str(getattr(problem, "field", "")))
    if problem is not None and where != ["body"] and not (apart and where[:1] == ["assembly"]):
        return _not(str(problem), where)
    if model is None:
        return _not("Draw a link: press where it begins, and again where it ends", [], "link")
    if apart:
        return _not("Join the links: draw one that begins on another or on the ground", [], "link")
    if seen is None:
        return _not("The mechanism has no pose", ["assembly"])
    return _of_motion(model, int(seen["freedoms"])) or _of_study(model, seen)


def checked(model: Model) -> Message:
    """Return whether all checks of `paraflex info` let a model run; they take longer than an edit may.

    The message is that of `readiness`, for a run that would be wrong, with `findings`, a line each.
    """
    verdict = check(model)
    wrong = [_not(f"{one.place}: {one.text}; {one.remedy}", _parts(one.place)) for one in verdict
             if one.level is Level.WRONG]  # fmt: skip
    return {"ok": True, **(wrong[0] if wrong else {}), "findings": finding_lines(verdict)}


def _of_motion(model: Model, freedoms: int) -> Message | None:
    """Return what keeps a mechanism from moving, or that a force bends it; None if it moves."""
    mechanism = model.mechanism
    driven = bool(mechanism.motors or mechanism.prescribed)
    flexible = any(not isinstance(body, RigidBody) and body.flexible for body in mechanism.bodies)
    massless = next((one.name for one in mechanism.bodies if isinstance(one, RigidBody) and not one.mass), None)
    if not freedoms and not flexible:
        return _not("It cannot move: it has no degree of freedom, so remove a link or a joint", ["joint"])
    pulled = not driven and (not freedoms or model.statics != StaticsDefaults())
    if not pulled and not driven and not _moves_itself(model):
        drives = f"{freedoms} motors" if freedoms > 1 else "a motor, or the crank that turns"
        return _not(f"Choose what moves it: {drives}", [], "motor" if freedoms > 1 else "drive")
    if massless is not None:
        how = "moved by its drive" if mechanism.prescribed else "moved by hand" if freedoms else "bent by a force"
        return _not(f"It can be {how}; for a run, {massless} needs a mass", ["body", massless, "mass"])
    return _pull(model) if pulled else None


def _moves_itself(model: Model) -> bool:
    mechanism = model.mechanism
    forced = mechanism.loads or mechanism.springs or mechanism.linear_springs or any(mechanism.gravity)
    return bool(forced) or model.start is not None


def _pull(model: Model) -> Message:
    effector, duration = model.mechanism.end_effector, model.study.duration
    where = "a link" if effector is None else str(effector.point)
    run = "" if duration is None else f", or run {duration:g} s"
    return _ready(f"pull at {where} to bend it{run}", "pull")


def _of_study(model: Model, seen: Message) -> Message:
    if model.paths:
        return _of_path(model, seen, model.path_name())
    if model.study.duration is not None:
        return _ready(f"run {model.study.duration:g} s")
    if not model.mechanism.motors:
        return _not("No duration: give the time of the run", ["study", "duration"])
    if model.mechanism.end_effector is None:
        return _not("No end-effector: choose the point that is to follow a path", [], "effector")
    return _not("No path: draw the one that the end-effector is to follow", [], "path")


def _of_path(model: Model, seen: Message, name: str) -> Message:
    if model.mechanism.end_effector is None:
        return _not("No end-effector: choose the point that is to follow the path", [], "effector")
    if not all(reach for _, _, reach in seen.get("path") or []):
        return _not(f"Path {name} leaves the reach of the mechanism", ["path", name], "path")
    runs = [mode.name for mode in model.modes()]
    if not runs:
        return _not("No actuation mode: add motors", ["mode"], "motor")
    lacks = {one["name"]: one["lacks"] for one in seen.get("chips") or []}
    short = [one for one in runs if lacks.get(one)]
    if len(short) == len(runs):
        return _not(f"Mode {short[0]} {lacks[short[0]]}: add a motor", ["mode", short[0]], "motor")
    return _ready(f"run {f'{len(runs)} modes' if len(runs) > 1 else f'mode {runs[0]}'} on path {name}")


def _ready(sentence: str, action: str = "run") -> Message:
    return {"ok": True, "sentence": f"Ready: {sentence}", "place": [], "action": action}


def _not(sentence: str, place: list[Any], action: str = "") -> Message:
    return {"ok": False, "sentence": sentence, "place": place, "action": action}


def _parts(place: str) -> list[Any]:
    """Return a place in the file as keys."""
    return [int(part) if part.isdigit() else part for part in place.split(".") if part]
