"""Contents of a results folder that a command will replace or leave: reported before the command computes."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from paraflex.errors import InputError, listed
from paraflex.folders import (
    COMPARISON,
    FOLDER_FILES,
    MANIFEST,
    SENSITIVITY,
    STUDY_OF_RUNS,
    ResultsFolder,
    foreign_files,
    hold_folder,
    kind_of_folder,
)
from paraflex.writing import read_json
from .tables import PlainConsole

# Largest number of foreign files that are named.
_NAMED = 3


@contextmanager
def hold_results(out: str | Path, kind: str, *, force: bool, field: str = "--out") -> Iterator[ResultsFolder]:
    """Hold a folder for the results of a command, and report on stderr what will be replaced there.

    Parameters
    ----------
    out : str or Path
        Results folder.
    kind : str
        Kind of the results: see `paraflex.folders.FOLDER_FILES`.
    force : bool
        Whether results of another kind may be replaced.
    field : str
        Option that names the folder.

    Raises
    ------
    InputError, OutputError
        The folder cannot be held: see `hold_folder`.
    """
    with hold_folder(Path(out), kind, force=force, field=field) as folder:
        print_replaced(folder.path)
        yield folder


def refuse_existing(output: Path, force: bool) -> None:
    """Check that no such file or non-empty folder exists, or that `force` allows overwriting it."""
    if force or not output.exists() or (output.is_dir() and not any(output.iterdir())):
        return
    raise InputError(
        "already exists" if output.is_file() else "the folder already holds files",
        field=str(output),
        remedy="name another, or overwrite it with --force",
    )


def print_replaced(folder: Path) -> None:
    """Report on stderr which results in a folder a command will replace, and which files it leaves."""
    kind, foreign = kind_of_folder(folder), foreign_files(folder)
    lines = []
    if kind:
        lines.append(
            f"{folder} holds {_described(folder, kind)}; it will be replaced (--out another folder keeps both)"
        )
    if foreign:
        lines.append(f"{folder} holds files not written by paraflex, which stay: {listed(foreign, _NAMED)}")
    PlainConsole(stderr=True).print_lines(*lines)


def _described(folder: Path, kind: str) -> str:
    file = next(folder / name for name in (*FOLDER_FILES[kind], MANIFEST) if (folder / name).is_file())
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(file.stat().st_mtime))
    try:
        text = _what(folder, kind, read_json(folder / FOLDER_FILES[kind][0]))
    except (InputError, KeyError, TypeError, AttributeError):
        # A file that is missing, damaged or of another version is replaced all the same.
        text = f"a {kind}"
    return f"{text}, {when}"


def _what(folder: Path, kind: str, found: dict[str, Any]) -> str:
    """Describe results by the contents of their first file."""
    if kind == SENSITIVITY:
        return f'sensitivities "{found["name"]}"'
    if kind == STUDY_OF_RUNS:
        search = folder / "result.json"
        searched = read_json(search).get("kind", "sweep") if search.is_file() else "sweep"
        kind = "study of indices" if (folder / "indices.json").is_file() else searched
        article = "an" if kind[0] in "aeiou" else "a"
        number = found.get("runs")
        runs = f" of {number} run{'' if number == 1 else 's'}" if number else ""
        return f'{article} {kind} "{found["name"]}"{runs}'
    from paraflex.reports.provenance import mechanism_argument

    run = found["parameters"]["run"]
    text = f"a {kind} of {mechanism_argument(run['mechanism'])}"
    if "path" not in run or kind == COMPARISON:
        return text
    modes = run["modes"]
    return f'{text} along "{run["path"]}", {"mode " + modes[0] if len(modes) == 1 else f"{len(modes)} modes"}'
