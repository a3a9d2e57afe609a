"""What lies in a folder of results before a command writes there: said before it computes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from paraflex.cli.tables import plain_console

# Beside the files of numbers all commands write these.
_DRAWN = ("figures", "report.html")
# Files of each kind of results, that which tells of it first. A sweep has a summary.json besides.
_FILES = {
    "sweep": ("study.json", "results.parquet"),
    "verification": ("verify.json", "verify.nc"),
    "comparison of methods": ("compare-methods.json",),
    "sensitivity": ("sensitivity.json", "sensitivity.csv", "sensitivity.parquet"),
    "run": ("summary.json", "results.nc"),
}


def say_replaced(folder: Path, kind: str) -> None:
    """Say on stderr which results of a folder a command is about to replace; nothing where it replaces none.

    Parameters
    ----------
    folder : Path
    kind : str
        Of the results that the command writes: "run", "verification", "comparison of methods" or "sensitivity".
    """
    there = _kind_of(folder, kind)
    if there is None:
        return
    if there == kind:
        what, how = "it will be replaced", "keeps both"
    else:
        files = [name for name in (*_FILES[kind], *_DRAWN) if (folder / name).exists()]
        lost = f"its {', '.join(files)} will be replaced" if files else "its files stay"
        what, how = f"{lost}, and a {kind} comes beside it", "keeps them apart"
    plain_console(stderr=True).print(
        f"{folder} holds {_described(folder, there)}; {what} (--out another folder {how})", soft_wrap=True
    )


def _kind_of(folder: Path, written: str) -> str | None:
    """The kind of results that lie in a folder: of several a sweep, else that which is written."""
    order = dict.fromkeys(["sweep", written, *_FILES])
    return next((kind for kind in order if any((folder / name).is_file() for name in _FILES[kind])), None)


def _described(folder: Path, kind: str) -> str:
    file = next(folder / name for name in _FILES[kind] if (folder / name).is_file())
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(file.stat().st_mtime))
    try:
        text = _TEXTS[kind](folder, _read(folder / _FILES[kind][0]))
    except (KeyError, TypeError, AttributeError):
        # Damaged, or of another version: it is replaced all the same.
        text = f"a {kind}"
    return f"{text}, {when}"


def _read(file: Path) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _run(_: Path, found: dict[str, Any], what: str = "a run") -> str:
    run = found["parameters"]["run"]
    text = f"{what} of {_mechanism(run['mechanism'])}"
    if "path" not in run:
        return text
    modes = run["modes"]
    return f'{text} along "{run["path"]}", {"mode " + modes[0] if len(modes) == 1 else f"{len(modes)} modes"}'


def _verification(folder: Path, found: dict[str, Any]) -> str:
    return _run(folder, found, "a verification")


def _comparison(_: Path, found: dict[str, Any]) -> str:
    return f"a comparison of methods of {_mechanism(found['parameters']['run']['mechanism'])}"


def _sensitivity(_: Path, found: dict[str, Any]) -> str:
    return f'sensitivities "{found["name"]}"'


def _study(folder: Path, found: dict[str, Any]) -> str:
    searched = _read(folder / "result.json").get("kind", "sweep")
    kind = "study of indices" if (folder / "indices.json").is_file() else searched
    article = "an" if kind[0] in "aeiou" else "a"
    number = found.get("runs")
    runs = f" of {number} run{'' if number == 1 else 's'}" if number else ""
    return f'{article} {kind} "{found["name"]}"{runs}'


def _mechanism(source: str) -> str:
    from paraflex.report.provenance import mechanism_argument

    return mechanism_argument(source)


_TEXTS: dict[str, Callable[[Path, Any], str]] = {
    "sweep": _study,
    "verification": _verification,
    "comparison of methods": _comparison,
    "sensitivity": _sensitivity,
    "run": _run,
}
