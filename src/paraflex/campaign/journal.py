"""A journal of runs: rows in one SQLite file, each with a digest of its own, written by one process at a time."""

from __future__ import annotations

import hashlib
import json
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from paraflex.errors import OutputError, ResultWarning, warn_user
from paraflex.interrupts import uninterrupted
from paraflex.writing import GO_ON

JOURNAL = "journal.sqlite"
# Rows are committed when so many wait, or the first has waited so long [s]: what a crash can cost.
_ROWS, _SECONDS = 2048, 2.0
# How long a commit waits for those who read, and they for a commit [s].
_PATIENCE = 60.0
# Not a write-ahead log: its index is shared memory, which machines on one network file system do not share. A rollback
# journal is there during a commit only, so that the folder may be copied as it stands; FULL: a commit is on the disk.
_START = """
PRAGMA journal_mode = DELETE;
PRAGMA synchronous = FULL;
CREATE TABLE IF NOT EXISTS study (name TEXT PRIMARY KEY, value BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS runs (
    run INTEGER, id TEXT, content TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (run, id)
);
"""
_ALL = "SELECT run, id, content, digest FROM runs ORDER BY run, id"
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)

Row = dict[str, Any]


class Journal:
    """Rows of runs by what they are of: `run`, the place in the table, and `id`, the identity; and notes on the study.

    Parameters
    ----------
    connection : sqlite3.Connection
        To a file with the tables of a journal.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._waiting: list[Row] = []
        self._written = time.monotonic()

    def note(self, name: str, value: bytes) -> None:
        """Keep something about the study."""
        with self._connection:
            self._connection.execute("INSERT OR REPLACE INTO study VALUES (?, ?)", (name, value))

    def noted(self, name: str) -> bytes | None:
        """What was kept under a name."""
        found = self._connection.execute("SELECT value FROM study WHERE name = ?", (name,)).fetchone()
        return None if found is None else found[0]

    def runs(self) -> Iterator[int]:
        """The runs of all rows, in order."""
        self.commit()
        return (run for (run,) in self._connection.execute("SELECT run FROM runs ORDER BY run"))

    def rows(self) -> Iterator[Row]:
        """All rows, in the order of runs.

        Raises
        ------
        sqlite3.DatabaseError
            The file, or a row, is damaged.
        """
        self.commit()
        for run, identity, content, digest in self._connection.execute(_ALL):
            if digest != _digest(run, identity, content):
                raise sqlite3.DatabaseError(f"the row of run {run} is damaged")
            yield json.loads(content)

    def add(self, rows: Sequence[Row]) -> None:
        """Keep rows, in place of those of the same runs; they are written together, within two seconds."""
        self._waiting += rows
        if len(self._waiting) >= _ROWS or time.monotonic() - self._written > _SECONDS:
            self.commit()

    def commit(self) -> None:
        """Write what waits, all of it or nothing."""
        if self._waiting:
            entries = [(int(row["run"]), row["id"], json.dumps(row, default=_plain)) for row in self._waiting]
            with self._connection:
                digested = [(*entry, _digest(*entry)) for entry in entries]
                self._connection.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?)", digested)
            # Not before: what Ctrl-C met half written is written at the end.
            self._waiting = []
        self._written = time.monotonic()

    def forget_damaged(self) -> None:
        """Leave out rows that are not as they were written, and say so: their runs are made again."""
        found = self._connection.execute(_ALL)
        damaged = [entry[:2] for entry in found if entry[3] != _digest(*entry[:3])]
        if damaged:
            with self._connection:
                self._connection.executemany("DELETE FROM runs WHERE run IS ? AND id IS ?", damaged)
            runs = ", ".join(str(run) for run, _ in damaged[:5])
            warn_user(ResultWarning(f"rows of the journal are damaged, and these runs are made again: {runs}"))


@contextmanager
def write_journal(folder: Path, *, locks: bool = True) -> Iterator[Journal]:
    """The journal of a folder that this process holds; what was added is on the disk at the end, whatever ends it.

    Raises
    ------
    OutputError
        It is damaged, or the disk is full or cannot be written for another reason.
    """
    with _open(folder / JOURNAL, f"mode=rwc&nolock={int(not locks)}") as connection:
        journal = Journal(connection)
        journal.forget_damaged()
        try:
            yield journal
        finally:
            with uninterrupted():
                journal.commit()


@contextmanager
def read_journal(file: Path) -> Iterator[Journal]:
    """A journal to read, also while another process writes it.

    Raises
    ------
    OutputError
        It is damaged.
    """
    # Not mode=ro: what a killed process left half written is undone first.
    with _open(file, "mode=rw") as connection:
        yield Journal(connection)


@contextmanager
def _open(file: Path, how: str) -> Iterator[sqlite3.Connection]:
    """A connection, whose errors name the file and say what to do."""
    try:
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?{how}", timeout=_PATIENCE, uri=True)) as connection:
            # A damaged text is a matter of its digest.
            connection.text_factory = lambda text: text.decode(errors="replace")
            connection.executescript(_START)
            yield connection
    except sqlite3.DatabaseError as error:
        if _code(error) in _DAMAGED:
            remedy = "delete this file and run the same command again: its runs are made again"
            raise OutputError(f"cannot be read ({error})", field=str(file), remedy=remedy) from error
        if not file.exists():
            remedy = "run the same command again: its runs are made again"
            raise OutputError("was deleted while it was written", field=str(file), remedy=remedy) from error
        reason = "no space left on device" if _code(error) == sqlite3.SQLITE_FULL else str(error)
        raise OutputError(f"cannot be written ({reason})", field=str(file), remedy=GO_ON) from error


def _code(error: sqlite3.Error) -> int:
    """Of SQLite; that of damage where it is a row's digest."""
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF


def _digest(run: int, identity: str, content: str) -> str:
    return hashlib.blake2b(f"{run} {identity} {content}".encode(), digest_size=16).hexdigest()


def _plain(number: Any) -> int | float:
    """A number of NumPy's as one of Python's."""
    return number.item()
