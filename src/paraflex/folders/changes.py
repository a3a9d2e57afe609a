"""Changes of a folder of results, made in one step: prepared in `.new`, then `.ready`, then moved to their places.

With a manifest of all that is to be there `.new` is renamed to `.ready`: from this moment on the new results hold.
"""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path, PureWindowsPath

from paraflex.errors import OutputError
from paraflex.interrupts import uninterrupted
from paraflex.writing import ELSEWHERE, read_values, unwritable

MANIFEST = "manifest.json"
NEW, READY, REMOVED = ".new", ".ready", "removed.json"


def finish_moves(folder: Path) -> None:
    """Put a change that is ready in its place; where it was broken off, the rest of it. Ctrl-C waits for its end."""
    ready = folder / READY
    if not ready.is_dir():
        return
    try:
        with uninterrupted():
            _put(ready, folder)
    except OSError as error:
        raise unwritable(error, str(folder), ELSEWHERE) from error


def check_place(folder: Path, name: Path) -> None:
    """Check that a file can be moved to its place in a folder, before any is."""
    inner = [folder / each for each in list(name.parents)[:-1]]
    if (folder / name).is_dir() or any(each.exists() and not each.is_dir() for each in inner):
        what = "a folder" if (folder / name).is_dir() else "a file"
        where = str(folder / name) if what == "a folder" else str(inner[-1])
        raise OutputError(f"cannot be written ({what} of that name is there)", field=where, remedy="move it elsewhere")


def _put(ready: Path, folder: Path) -> None:
    if (ready / MANIFEST).is_file():
        removed = read_values(ready / REMOVED, f"delete the folder {READY}, and run the same command again")
        for file in files_in(ready):
            name = file.relative_to(ready)
            if name.as_posix() not in (MANIFEST, REMOVED):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                file.replace(folder / name)
        for name in filter(is_inside, removed):
            (folder / name).unlink(missing_ok=True)
            with suppress(OSError):  # it holds other files, or is gone
                (folder / name).parent.rmdir()
        # The last of all: until now it is known what is left to do.
        (ready / MANIFEST).replace(folder / MANIFEST)
    shutil.rmtree(ready, ignore_errors=True)


def is_inside(name: str) -> bool:
    """Whether a name in a list is of a file within the folder: others are never touched, whoever wrote the list."""
    path = PureWindowsPath(name)  # which takes both slashes for what they are
    return not path.anchor and ".." not in path.parts


def files_in(folder: Path) -> list[Path]:
    """All files in a folder and those below, in the order of their names."""
    return sorted(file for file in folder.rglob("*") if file.is_file())
