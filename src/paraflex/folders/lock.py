"""The lock of a folder of results: one process at a time writes to it, and a killed one leaves none."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from paraflex.errors import InputError
from paraflex.folders.changes import READY, finish_moves
from paraflex.writing import ELSEWHERE, unwritable

LOCK = ".lock"
# How long a reader waits for a writer that moves files [s], and how often it looks.
_PATIENCE, _LOOK = 10.0, 0.05


class FolderInUseError(InputError):
    """Another process writes to a folder."""


@contextmanager
def lock_folder(folder: Path, *, field: str = "--output") -> Iterator[bool]:
    """Keep others from writing to a folder; the system lets go of it when this process ends, however it does.

    What a writer that was killed left to be moved is moved. Yields False on a file system without locks.

    Raises
    ------
    InputError
        Another process writes to it.
    OutputError
        It cannot be made.
    """
    locks = True
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / LOCK).is_symlink() or ((folder / LOCK).is_file() and (folder / LOCK).stat().st_size):
            raise OSError(f"{LOCK} is not the empty file that keeps others away")
        lock = sqlite3.connect(folder / LOCK, timeout=0.0)
    except (OSError, sqlite3.OperationalError) as error:
        raise unwritable(error, field, ELSEWHERE, str(folder)) from error
    with closing(lock):
        try:
            # Nothing is written to this file, nor to a journal of it.
            lock.executescript("PRAGMA journal_mode = MEMORY; BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            code = error.sqlite_errorcode & 0xFF
            if code == sqlite3.SQLITE_BUSY:
                remedy = "wait for it, or stop it"
                raise FolderInUseError(
                    "another process writes to it", field=field, value=str(folder), remedy=remedy
                ) from None
            if code != sqlite3.SQLITE_IOERR:
                raise unwritable(error, field, ELSEWHERE, str(folder)) from error
            locks = False
        finish_moves(folder)
        yield locks


def finish_change(folder: Path) -> None:
    """Move what a writer that was killed left to be moved; wait for one that is about to.

    Raises
    ------
    InputError
        It writes for too long.
    OutputError
        The folder cannot be written.
    """
    until = time.monotonic() + _PATIENCE
    while (folder / READY).is_dir():
        try:
            with lock_folder(folder, field=str(folder)):
                return
        except FolderInUseError:
            if time.monotonic() > until:
                raise
            time.sleep(_LOOK)
