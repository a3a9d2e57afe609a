"""Atomic changes of a folder of results, prepared in `.new`, renamed to `.ready`, then moved to their places.

A change takes effect when `.new`, complete with its manifest, is renamed to `.ready`.
"""

import os
import re
import shutil
from contextlib import suppress
from pathlib import Path, PureWindowsPath

from paraflex.errors import OutputError
from paraflex.interrupts import uninterrupted
from paraflex.seals import damaged
from paraflex.writing import ELSEWHERE, read_values, unwritable

MANIFEST = "manifest.json"
NEW, READY, DRAWN, REMOVED = ".new", ".ready", ".drawn", "removed.json"
_NO_NAME = re.compile("[\0\ud800-\udfff]")  # file names contain no null character and no surrogate


def finish_moves(folder: Path) -> None:
    """Apply a prepared change, or the rest of an interrupted one; Ctrl-C takes effect afterwards.

    Raises
    ------
    OutputError
        Folder that cannot be written, change prepared by another user, or files that would lie outside the folder.
    """
    ready = folder / READY
    if not ready.is_dir():
        return
    remedy = "check its contents and its owner; without it, the previous results are read"
    if ready.is_symlink():
        raise OutputError("is a link, not results that paraflex prepared", field=str(ready), remedy=remedy)
    if hasattr(os, "getuid") and ready.stat().st_uid != os.getuid():
        raise OutputError("results that another user prepared and did not move", field=str(ready), remedy=remedy)
    try:
        with uninterrupted():
            _put(ready, folder)
    except OSError as error:
        raise unwritable(error, str(folder), ELSEWHERE) from error


def check_inside(folder: Path, name: Path | str) -> None:
    """Check that a file of a folder lies inside it after links are resolved, so that no other file is changed.

    Raises
    ------
    OutputError
        Link that leads out of the folder.
    """
    place = (folder / name).parent
    if not Path(os.path.realpath(place)).is_relative_to(os.path.realpath(folder)):
        remedy = "put a folder in place of the link"
        raise OutputError(f"a link leads out of {folder}", field=str(place), remedy=remedy)


def check_place(folder: Path, name: Path) -> None:
    """Check that a file can be moved to its place in a folder, before any file is moved.

    Raises
    ------
    OutputError
        Link that leads out of the folder, or a folder or file in the way.
    """
    check_inside(folder, name)
    inner = [folder / each for each in list(name.parents)[:-1]]
    if (folder / name).is_dir() or any(each.exists() and not each.is_dir() for each in inner):
        what = "a folder" if (folder / name).is_dir() else "a file"
        where = str(folder / name) if what == "a folder" else str(inner[-1])
        raise OutputError(f"cannot be written ({what} of that name is there)", field=where, remedy="move it elsewhere")


def _put(ready: Path, folder: Path) -> None:
    if (ready / MANIFEST).is_file():
        remedy = f"delete the folder {READY}, and run the same command again"
        listed = read_values(ready / REMOVED, remedy)
        if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
            raise damaged(ready / REMOVED, "not a list of names", remedy)
        removed = list(filter(is_inside, listed))
        moved = [file for file in files_in(ready) if file not in (ready / MANIFEST, ready / REMOVED)]
        for name in [*removed, *(file.relative_to(ready) for file in moved)]:
            check_inside(folder, name)
        for file in moved:
            place = folder / file.relative_to(ready)
            place.parent.mkdir(parents=True, exist_ok=True)
            file.replace(place)
        for name in removed:
            (folder / name).unlink(missing_ok=True)
            with suppress(OSError):  # the folder holds other files, or does not exist
                (folder / name).parent.rmdir()
        # The manifest is moved last, because until then `.ready` shows what is left to do.
        (ready / MANIFEST).replace(folder / MANIFEST)
    shutil.rmtree(ready, ignore_errors=True)


def is_inside(name: str) -> bool:
    """Check whether a listed name is that of a file inside the folder; other files are never changed."""
    path = PureWindowsPath(name)  # it treats both kinds of slashes as separators
    return not path.anchor and ".." not in path.parts and not _NO_NAME.search(name)


def files_in(folder: Path) -> list[Path]:
    """Return all files in a folder and its subfolders, sorted by name."""
    return sorted(file for file in folder.rglob("*") if file.is_file())
