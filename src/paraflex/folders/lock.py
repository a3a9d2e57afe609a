"""Lock of a folder of results: one process at a time writes to it, and a killed process leaves no lock."""

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from paraflex.errors import InputError
from paraflex.writing import ELSEWHERE, unwritable
from .changes import READY, finish_moves

LOCK = ".lock"
# Time that a reader waits for a writer that moves files, and interval between its checks [s].
_PATIENCE, _LOOK = 10.0, 0.05


class FolderInUseError(InputError):
    """Error raised if another process writes to a folder."""


@contextmanager
def lock_folder(folder: Path, *, field: str = "--output") -> Iterator[bool]:
    """Lock a folder for writing; the operating system releases the lock when this process ends for any reason.

    A change left unfinished by a killed process is completed. Yields False on a file system without locks.

    Raises
    ------
    InputError
        Folder to which another process writes.
    OutputError
        Folder that cannot be created.
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
            # With this setting nothing is written, neither to this file nor to a journal beside it.
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
    """Complete a change left unfinished by a killed process, or wait for a process that is completing one.

    Raises
    ------
    InputError
        Process that writes for too long.
    OutputError
        Folder that cannot be written.
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
