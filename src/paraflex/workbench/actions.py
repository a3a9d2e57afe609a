"""Actions of a person on the workbench, each an edit of the text of the model file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from paraflex.errors import InputError
from paraflex.mechanism.quantities import known
from .adding import ADDING
from .changing import CHANGING
from .copying import COPYING
from .dependents import falling, spelt, thing_of
from .moving_points import move_point
from .sheet import Sheet, refusals

_ACTIONS = {**ADDING, **CHANGING, **COPYING, "move-point": move_point}
# Tables whose entries about deleted members go without a word.
_BOOKKEEPING = ("assembly", "start")


@dataclass(frozen=True)
class Edited:
    """Result of an action.

    Attributes
    ----------
    text : str
        Text of the file after the action.
    selected : str
        Member that the action is about, "body.link1"; empty if it is gone.
    note : str
        Remark for the person, such as what was deleted as well; empty by default.
    """

    text: str
    selected: str = ""
    note: str = ""


def apply(text: str, action: Mapping[str, Any], folder: Path | None = None) -> Edited:
    """Apply an action to the text of a model file, and change nothing else in it.

    Parameters
    ----------
    text : str
        Text of the file; it may have no bodies yet.
    action : mapping
        `kind` of the action, and what it needs; an `assembly` names the one in which coordinates count.
    folder : Path, optional
        Folder of the file, in which files named in it are found.

    Raises
    ------
    InputError
        Text that is not TOML, unknown or incomplete action, or action after which the model could not be read.
    """
    if not isinstance(action, Mapping):
        raise InputError("not an action", field="action", value=action, remedy='give {"kind": "add-ground", ...}')
    known(action.get("kind", ""), list(_ACTIONS), "kind", "action")
    before = Sheet(text, folder or Path())
    with refusals(before, str(action["kind"])):
        if action.get("assembly") and action["kind"] != "pose":
            known(action["assembly"], before.names("assembly"), "assembly", "assembly")
        after, selected = _ACTIONS[action["kind"]](before, action)
        _check(before, after, action)
    return Edited(after.text, selected, _note(before, after, action))


def what_goes(text: str, names: Sequence[Any]) -> list[dict[str, Any]]:
    """Return what is deleted together with members, without these: `kind`, `name` and `place` of each.

    Raises
    ------
    InputError
        Unknown name, or member that something else needs.
    """
    sheet = Sheet(text)
    with refusals(sheet, "names"):
        things = [thing_of(sheet.data, name) for name in names]
        found = falling(sheet.data, things)
    members = [place for place in found if place not in things and place[0] not in _BOOKKEEPING]
    return [{"kind": str(place[0]), "name": spelt(place), "place": list(place)} for place in members]


def _check(before: Sheet, after: Sheet, action: Mapping[str, Any]) -> None:
    """Check that the text can still be read as a model if it could before, or is not worse at the field set."""
    _ = after.data
    if after.problem is None or after.text == before.text:
        return
    if before.problem is None:
        raise after.problem
    place = ".".join(map(str, action.get("place", ())))
    if place and after.problem.field.startswith(place) and str(after.problem) != str(before.problem):
        raise after.problem


def _note(before: Sheet, after: Sheet, action: Mapping[str, Any]) -> str:
    gone = []
    if action["kind"] == "delete":
        gone = [one["name"] for one in what_goes(before.text, action.get("names", ()))]
    if action["kind"] == "retype":
        tables = [table for table in before.data if table not in ("assembly", "study")]
        gone = [f"{table}.{name}" for table in tables for name in before.names(table) if name not in after.names(table)]
    return f"also deleted: {', '.join(gone)}" if gone else ""
