"""One sentence on what stands in the way of a run, and where to mend it."""

from typing import Any

from paraflex.errors import ParaflexError
from paraflex.files import Model
from paraflex.mechanism import RigidBody
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
        `ok`, whether it can run; `sentence`; and where to go: `place` in the file, and `action`, the tool to take.
    """
    if gaps:
        name, gap = next(iter(gaps.items()))
        return _not(f"The loops do not close: joint {name} is open by {gap}", ["joint", name], "shape")
    if problem is not None and getattr(problem, "field", "") != "body":
        return _not(str(problem), _place(problem))
    if model is None:
        return _not("Draw a link: press where it begins, and again where it ends", [], "link")
    mechanism = model.mechanism
    if not mechanism.joints:
        return _not("Join the links: draw one that begins on another or on the ground", [], "link")
    massless = next((one.name for one in mechanism.bodies if isinstance(one, RigidBody) and not one.mass), None)
    if seen is None:
        return _not("The mechanism has no pose", ["assembly"])
    if not mechanism.motors and not mechanism.prescribed and not mechanism.loads:
        return _not("Choose what moves it: a motor, or the crank that turns", [], "drive")
    if massless is not None:
        kind = "the crank can be turned" if mechanism.prescribed else "it can be moved by hand"
        return _not(f"No masses yet, so {kind}; give {massless} a mass for a run", ["body", massless, "mass"])
    if mechanism.motors and not mechanism.prescribed and not mechanism.loads and model.start is None:
        if mechanism.end_effector is None:
            return _not("No end-effector: choose the point that is to follow a path", [], "effector")
        if not model.paths:
            return _not("No path: draw the one that the end-effector is to follow", [], "path")
    return _of_study(model, seen)


def _of_study(model: Model, seen: Message) -> Message:
    if model.paths:
        name = model.path_name()
        beyond = [one for one in seen.get("path") or [] if not one[2]]
        if beyond:
            return _not(f"Path {name} leaves the reach of the mechanism", ["path", name], "path")
        lacking = [one for one in seen.get("chips") or [] if one["lacks"]]
        runs = [mode.name for mode in model.modes()]
        short = next((one for one in lacking if one["name"] in runs), None)
        if short is not None and len(lacking) >= len(runs):
            return _not(f"Mode {short['name']} {short['lacks']}: add a motor", ["mode", short["name"]], "motor")
        if not runs:
            return _not("No actuation mode: add motors to a mode", ["mode"], "motor")
        count = f"{len(runs)} modes" if len(runs) > 1 else f"mode {runs[0]}"
        return {"ok": True, "sentence": f"Ready: run {count} on path {name}", "place": [], "action": "run"}
    if model.study.duration is None:
        return _not("No duration: give the time of the run", ["study"])
    return {"ok": True, "sentence": f"Ready: run {model.study.duration:g} s", "place": [], "action": "run"}


def _not(sentence: str, place: list[Any], action: str = "") -> Message:
    return {"ok": False, "sentence": sentence, "place": place, "action": action}


def _place(problem: ParaflexError) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in str(getattr(problem, "field", "")).split(".") if part]
