"""Journal of runs: an SQLite file of rows, each with its own digest, written by one process at a time."""

import hashlib
import json
import shutil
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from paraflex.errors import OutputError, ResultWarning, warn_user
from paraflex.interrupts import uninterrupted
from paraflex.writing import GO_ON, whole_file

JOURNAL = "journal.sqlite"
# Rows are committed when this number is pending or this time [s] has passed since the last commit. A crash loses
# these rows at most.
_ROWS, _SECONDS = 2048, 2.0
# Time that a commit waits for readers, and readers for a commit [s].
_PATIENCE = 60.0
_PAGE = 4096
# No write-ahead log is used, because its index is shared memory, which machines on a network file system do not share.
# A rollback journal exists during a commit only, so that the folder can be copied at any time. With FULL, a commit
# returns when the data are on the disk.
_SETTINGS = f"""
PRAGMA page_size = {_PAGE};
PRAGMA journal_mode = DELETE;
PRAGMA synchronous = FULL;
"""
_TABLES = """
BEGIN IMMEDIATE;
CREATE TABLE IF NOT EXISTS notes (name TEXT PRIMARY KEY, value BLOB NOT NULL, digest TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS runs (
    run INTEGER, id TEXT, content TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (run, id)
);
COMMIT;
"""
# First bytes of the file of any journal with these settings.
_HEAD = b"SQLite format 3\0\x10\0\x01\x01\0\x40\x20\x20"
# Last bytes of a rollback journal that names another file, as in transactions on several databases.
_NAMES_ANOTHER = bytes.fromhex("d9d505f920a163d7")
_ALL = "SELECT run, id, content, digest FROM runs"
# Name of the note with the number of rows and the sum of their digests.
_TALLY = "rows"
# Error codes of SQLite that do not indicate a damaged file.
_UNWRITABLE = {
    sqlite3.SQLITE_BUSY, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_PERM, sqlite3.SQLITE_PROTOCOL, sqlite3.SQLITE_READONLY,
}  # fmt: skip
_REPAIR_REMEDY = "run the same command again: what is whole is kept, and the other runs are made again"

Row = dict[str, Any]


@dataclass(frozen=True)
class _Tally:
    """Number of rows and sum of their digests, by which rows lost through a damaged index or page are detected."""

    count: int = 0
    total: int = 0

    def plus(self, digest: str, sign: int = 1) -> "_Tally":
        return _Tally(self.count + sign, (self.total + sign * int(digest, 16)) % (1 << 128))


class Journal:
    """Journal of rows of runs, keyed by `run`, the place in the table, and `id`, the identity, with notes on the study.

    Parameters
    ----------
    connection : sqlite3.Connection
        Connection to a file with the tables of a journal.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._waiting: list[Row] = []
        self._written = time.monotonic()

    def note(self, name: str, value: bytes) -> None:
        """Store a note on the study under a name."""
        with uninterrupted(), self._connection:
            self._note(name, value)

    def _note(self, name: str, value: bytes) -> None:
        entry = (name, value, _digest(name, value.hex()))
        self._connection.execute("INSERT OR REPLACE INTO notes VALUES (?, ?, ?)", entry)

    def noted(self, name: str) -> bytes | None:
        """Return the note stored under a name; None if there is none.

        Raises
        ------
        sqlite3.DatabaseError
            Damaged note.
        """
        found = self._connection.execute("SELECT value, digest FROM notes WHERE name = ?", (name,)).fetchone()
        if found is None:
            return None
        if not isinstance(found[0], bytes) or found[1] != _digest(name, found[0].hex()):
            raise sqlite3.DatabaseError(f"the note {name} is not as it was written")
        return found[0]

    def runs(self) -> Iterator[int]:
        """Return an iterator over the run numbers of all rows, in order."""
        self.commit()
        return (run for (run,) in self._connection.execute("SELECT run FROM runs ORDER BY run"))

    def rows(self) -> Iterator[Row]:
        """Return an iterator over all rows, in the order of runs.

        Raises
        ------
        sqlite3.DatabaseError
            Damaged file or row.
        """
        self.commit()
        return (_row(content) for content in self._contents())

    def check(self) -> None:
        """Check that notes and rows are as they were written; see `rows` for the errors."""
        for (name,) in self._connection.execute("SELECT name FROM notes").fetchall():
            self.noted(name)
        for _ in self._contents():
            pass

    def _contents(self) -> Iterator[str]:
        noted, found = self._tally(), _Tally()
        for run, identity, content, digest in self._connection.execute(f"{_ALL} ORDER BY run, id"):
            if digest != _digest(run, identity, content):
                raise sqlite3.DatabaseError(f"the row of run {run} is not as it was written")
            found = found.plus(digest)
            yield content
        if found != noted:
            raise sqlite3.DatabaseError(f"{found.count} of {noted.count} rows are found")

    def _tally(self) -> _Tally:
        noted = self.noted(_TALLY)
        try:
            return _Tally() if noted is None else _Tally(*map(int, noted.split()))
        except (TypeError, ValueError) as error:
            raise sqlite3.DatabaseError("it does not hold the number of rows") from error

    def add(self, rows: Sequence[Row]) -> None:
        """Add rows, replacing those of the same runs; they are committed in groups, about every two seconds."""
        self._waiting += rows
        if len(self._waiting) >= _ROWS or time.monotonic() - self._written > _SECONDS:
            self.commit()

    def commit(self) -> None:
        """Write all pending rows in one transaction."""
        if self._waiting:
            # If a run has two rows, the later one is kept.
            waiting = {(int(row["run"]), row["id"]): row for row in self._waiting}
            # NumPy's numbers become Python's.
            contents = {key: json.dumps(row, default=lambda number: number.item()) for key, row in waiting.items()}
            with uninterrupted(), self._connection:
                self._write([(*key, content, _digest(*key, content)) for key, content in contents.items()])
            # The list is cleared after the transaction, so that rows of an interrupted commit are written at the end.
            self._waiting = []
        self._written = time.monotonic()

    def _write(self, entries: list[tuple[int, str, str, str]]) -> None:
        tally, connection = self._tally(), self._connection
        for run, identity, _, digest in entries:
            old = connection.execute("SELECT digest FROM runs WHERE run = ? AND id = ?", (run, identity)).fetchone()
            tally = (tally if old is None else tally.plus(old[0], -1)).plus(digest)
        connection.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?)", entries)
        self._note(_TALLY, f"{tally.count} {tally.total}".encode())


@contextmanager
def write_journal(folder: Path, *, locks: bool = True) -> Iterator[Journal]:
    """Open the journal of a folder held by this process; rows that were added are on the disk when the context ends.

    If the journal is damaged, its intact rows and notes are kept, and a warning is issued.

    Raises
    ------
    OutputError
        Journal without intact rows, or disk that is full or cannot be written for another reason.
    """
    file, how = folder / JOURNAL, f"mode=rwc&nolock={int(not locks)}"
    # A copy of the folder made by hard links must not change.
    if file.is_file() and not file.is_symlink() and file.stat().st_nlink > 1:
        with whole_file(file, remedy=GO_ON) as own:
            shutil.copyfile(file, own)
    reason = _reason_to_repair(file, how)
    if reason:
        _repair(file, how, reason)
    with _errors(file), _connected(file, how) as connection:
        journal = Journal(connection)
        try:
            yield journal
        finally:
            with uninterrupted():
                journal.commit()


@contextmanager
def read_journal(file: Path) -> Iterator[Journal]:
    """Open a journal for reading, even while another process writes to it.

    Raises
    ------
    OutputError
        Damaged journal.
    """
    # The mode is not ro, because an unfinished transaction of a killed process must be rolled back first.
    with _errors(file), _connected(file, "mode=rw") as connection:
        connection.execute("BEGIN")
        yield Journal(connection)


def _reason_to_repair(file: Path, how: str) -> str:
    """Return the reason why a journal is damaged; empty if it is intact or does not exist."""
    if not file.exists():
        return ""
    with _errors(file):
        try:
            with _connected(file, how) as connection:
                Journal(connection).check()
        except (sqlite3.DatabaseError, MemoryError) as error:
            if _code(error) in _UNWRITABLE:
                raise
            return str(error)
    with file.open("rb") as stream:
        start = stream.read(len(_HEAD))
    return "" if start in (b"", _HEAD) else "its first bytes are not as they were written"


def _repair(file: Path, how: str, reason: str) -> None:
    """Rewrite a damaged journal from its intact rows and notes.

    Raises
    ------
    OutputError
        Journal without intact rows.
    """
    copy = file.with_name(f"{file.name}.copy.part")
    try:
        with whole_file(file, remedy=GO_ON) as unfinished:
            with _connected(unfinished, how) as connection:
                shutil.copyfile(file, copy)
                _restore_first_page(copy, unfinished.read_bytes())
                kept = _keep_intact(copy, Journal(connection))
            if not kept:
                raise _damaged(file, reason)
            # The rollback journal refers to pages of the damaged file.
            file.with_name(f"{file.name}-journal").unlink(missing_ok=True)
    finally:
        copy.unlink(missing_ok=True)
    text = f"{file}: damaged ({reason}); {kept} rows are whole, and runs without one are made again"
    warn_user(ResultWarning(text))


def _restore_first_page(file: Path, empty: bytes) -> None:
    """Replace the first page of a journal by that of an empty one, which has the same tables at the same places."""
    pages = file.stat().st_size // _PAGE
    with file.open("rb+") as stream:
        stream.write(empty[:28] + pages.to_bytes(4, "big") + bytes(8) + empty[40:_PAGE])


def _keep_intact(damaged: Path, journal: Journal) -> int:
    """Copy the intact notes and rows of a damaged file to a journal, and return the number of rows."""
    found: set[tuple[int, str]] = set()
    with suppress(sqlite3.DatabaseError), _connected(damaged, "mode=rw") as connection:
        with suppress(sqlite3.DatabaseError, MemoryError):
            for name, value, digest in connection.execute("SELECT name, value, digest FROM notes").fetchall():
                if name != _TALLY and isinstance(value, bytes) and digest == _digest(name, value.hex()):
                    journal.note(name, value)
        # Read from both ends, without the index, up to the page that cannot be read.
        for order in ("rowid", "rowid DESC"):
            with suppress(sqlite3.DatabaseError, MemoryError):
                for run, identity, content, digest in connection.execute(f"{_ALL} NOT INDEXED ORDER BY {order}"):
                    if (run, identity) not in found and digest == _digest(run, identity, content):
                        found.add((run, identity))
                        journal.add([_row(content)])
                break
    journal.commit()
    return len(found)


@contextmanager
def _connected(file: Path, how: str) -> Iterator[sqlite3.Connection]:
    """Open a connection to a journal, and create its tables if the file is new."""
    _check_files(file)
    with closing(sqlite3.connect(f"{file.absolute().as_uri()}?{how}", timeout=_PATIENCE, uri=True)) as connection:
        # Damaged text must not raise here, because the digest detects it.
        connection.text_factory = lambda text: text.decode(errors="replace")
        # The first query rolls back an unfinished transaction of a killed process.
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        connection.executescript(_SETTINGS)
        if not file.stat().st_size:
            connection.executescript(_TABLES)
        # Triggers and views could alter what is read and written, and a folder from others may contain them.
        found = connection.execute("SELECT type, name FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
        if sorted(found) != [("table", "notes"), ("table", "runs")]:
            raise sqlite3.DatabaseError("it holds other things than the tables of a journal")
        yield connection


def _check_files(file: Path) -> None:
    """Check that SQLite will access no files except a journal and those beside it, even if others created them.

    SQLite rolls back into the target of a link, and deletes the file named in a rollback journal.
    """
    beside = [file.with_name(file.name + end) for end in ("", "-journal", "-wal", "-shm")]
    if any(each.is_symlink() or (each.exists() and not each.is_file()) for each in beside):
        raise sqlite3.DatabaseError("it is a link or not a regular file, or one beside it is")
    with suppress(OSError), beside[1].open("rb") as stream:
        stream.seek(-len(_NAMES_ANOTHER), 2)
        if stream.read(len(_NAMES_ANOTHER)) == _NAMES_ANOTHER:
            raise sqlite3.DatabaseError(f"{beside[1].name} names another file")


@contextmanager
def _errors(file: Path) -> Iterator[None]:
    """Convert errors of SQLite inside the context to errors that name the file and a remedy."""
    try:
        yield
    except sqlite3.DatabaseError as error:
        if not file.exists():
            remedy = "run the same command again: its runs are made again"
            raise OutputError("was deleted while it was written", field=str(file), remedy=remedy) from error
        if _code(error) not in _UNWRITABLE:
            raise _damaged(file, str(error), _REPAIR_REMEDY) from error
        reason = "no space left on device" if _code(error) == sqlite3.SQLITE_FULL else str(error)
        raise OutputError(f"cannot be written ({reason})", field=str(file), remedy=GO_ON) from error


def _damaged(
    file: Path, reason: str, remedy: str = "delete this file and run the same command again: its runs are made again"
) -> OutputError:
    return OutputError(f"damaged: {reason}", field=str(file), remedy=remedy)


def _code(error: Exception) -> int:
    """Return the SQLite code of an error; that of a damaged file if it has none."""
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF


def _digest(*parts: object) -> str:
    return hashlib.blake2b(" ".join(map(str, parts)).encode(), digest_size=16).hexdigest()


def _row(content: str) -> Row:
    """Parse the row of a run from JSON, and check that it is a row, which its digest alone does not show."""
    with suppress(ValueError, RecursionError):
        found = json.loads(content)
        if isinstance(found, dict) and isinstance(found.get("run"), int) and isinstance(found.get("id"), str):
            return found
    raise sqlite3.DatabaseError("a row does not describe a run")
