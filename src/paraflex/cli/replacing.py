"""What lies in a folder of results before a command writes there: said before it computes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from paraflex.cli.tables import plain_console
from paraflex.errors import InputError
from paraflex.writing import read_json

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
    # Of several kinds that lie there a sweep, else that which is written.
    order = dict.fromkeys(["sweep", kind, *_FILES])
    there = next((one for one in order if any((folder / name).is_file() for name in _FILES[one])), None)
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


def _described(folder: Path, kind: str) -> str:
    file = next(folder / name for name in _FILES[kind] if (folder / name).is_file())
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(file.stat().st_mtime))
    try:
        text = _what(folder, kind, read_json(folder / _FILES[kind][0]))
    except (InputError, KeyError, TypeError, AttributeError):
        # Not there, damaged, or of another version: it is replaced all the same.
        text = f"a {kind}"
    return f"{text}, {when}"


def _what(folder: Path, kind: str, found: dict[str, Any]) -> str:
    """What the first file of some results tells of them."""
    if kind == "sensitivity":
        return f'sensitivities "{found["name"]}"'
    if kind == "sweep":
        search = folder / "result.json"
        searched = read_json(search).get("kind", "sweep") if search.is_file() else "sweep"
        kind = "study of indices" if (folder / "indices.json").is_file() else searched
        article = "an" if kind[0] in "aeiou" else "a"
        number = found.get("runs")
        runs = f" of {number} run{'' if number == 1 else 's'}" if number else ""
        return f'{article} {kind} "{found["name"]}"{runs}'
    from paraflex.report.provenance import mechanism_argument

    run = found["parameters"]["run"]
    text = f"a {kind} of {mechanism_argument(run['mechanism'])}"
    if "path" not in run or kind == "comparison of methods":
        return text
    modes = run["modes"]
    return f'{text} along "{run["path"]}", {"mode " + modes[0] if len(modes) == 1 else f"{len(modes)} modes"}'
