"""Folders of results: a manifest lists the files that belong together, and they are replaced whole or not at all.

A change is prepared in a folder within, `.new`. With a manifest of all that is to be there it is renamed to `.ready`:
from this moment on the new results hold. Who opens the folder next moves what is left to move, should the writer be
killed.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path, PureWindowsPath

from paraflex.errors import InputError, OutputError
from paraflex.interrupts import uninterrupted
from paraflex.seals import damaged
from paraflex.writing import ELSEWHERE, read_json, unwritable, write_json

MANIFEST = "manifest.json"
LOCK = ".lock"
_NEW, _READY, _REMOVED = ".new", ".ready", "removed.json"
# How long a reader waits for a writer that moves files [s], and how often it looks.
_PATIENCE, _LOOK = 10.0, 0.05
# So much of a file is held at once [bytes].
_PIECE = 1 << 20

# Kinds of results, and by which files a folder without a manifest, of an earlier release, is known to hold them.
RUN = "run"
VERIFICATION = "verification"
COMPARISON = "comparison of methods"
SENSITIVITY = "sensitivity"
STUDY_OF_RUNS = "study of many runs"
KINDS: Mapping[str, tuple[str, ...]] = {
    STUDY_OF_RUNS: ("study.json", "journal.sqlite", "results.parquet"),
    VERIFICATION: ("verify.json", "verify.nc"),
    COMPARISON: ("compare-methods.json",),
    SENSITIVITY: ("sensitivity.json", "sensitivity.csv", "sensitivity.parquet"),
    RUN: ("summary.json", "results.nc"),
}
# What else a study of many runs keeps, listed or not: they come and go while it runs.
_OF_STUDY = (
    "journal.sqlite*", "parts/*", "trajectories/*", "unfinished.parquet", "results.csv", "result.json", "summary.json",
    "best.toml", "indices.*", "report.html",
)  # fmt: skip
_REPORT = "report.html"


@dataclass(frozen=True)
class Manifest:
    """What belongs together in a folder.

    Attributes
    ----------
    kind : str
        Of KINDS.
    identity : str
        A digest of the results without figures, report and exports: the same wherever they are copied to.
    files : mapping of str to str
        Digests of the bytes of all files, by their names within the folder ("figures/fig11_desired_path.png").
    """

    kind: str
    identity: str
    files: Mapping[str, str]

    @classmethod
    def of(cls, kind: str, files: Mapping[str, str]) -> Manifest:
        """The manifest of some files."""
        numbers = [f"{name} {files[name]}" for name in sorted(files) if not _is_derived(name)]
        return cls(kind, _digest("\n".join(numbers).encode()), dict(sorted(files.items())))


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder; None where there is none.

    Raises
    ------
    InputError
        It is damaged.
    """
    file = folder / MANIFEST
    if not file.is_file():
        return None
    remedy = "run the same command again; or delete this file, and others are read without it"
    found = read_json(file, remedy)
    try:
        manifest = Manifest.of(found["kind"], found["files"])
        whole = manifest.identity == found["identity"] and manifest.kind in KINDS
        if whole and all(map(_is_inside, manifest.files)):
            return manifest
    except (KeyError, TypeError, AttributeError):
        pass
    raise damaged(file, "not a list of the folder's files", remedy)


def kind_of_folder(folder: Path) -> str:
    """Which kind of results a folder holds; empty where none of ours."""
    finish_change(folder)
    try:
        manifest = read_manifest(folder)
    except InputError:
        manifest = None
    if manifest is not None:
        return manifest.kind
    return next((kind for kind, names in KINDS.items() if any((folder / name).is_file() for name in names)), "")


def check_listed(file: Path, remedy: str) -> None:
    """Check that a file is the one that the manifest of its folder lists; nothing is checked without a manifest.

    Parameters
    ----------
    file : Path
    remedy : str
        Of the error.

    Raises
    ------
    InputError
        It is damaged, or belongs to other results than the files beside it.
    """
    if _is_listed(file) or _is_listed(file):  # once more: another process may have replaced the results meanwhile
        return
    why = "damaged, or of other results: not the file that the folder's manifest lists"
    raise InputError(why, field=str(file), remedy=remedy)


def _is_listed(file: Path) -> bool:
    for folder in file.absolute().parents[:2]:
        finish_change(folder)
        manifest = read_manifest(folder)
        if manifest is not None:
            wanted = manifest.files.get(file.absolute().relative_to(folder).as_posix())
            return wanted is None or wanted == _digest_of(file)
    return True


class FolderInUseError(InputError):
    """Another process writes to a folder."""


class ResultsFolder:
    """A folder of results that this process alone writes to; `hold_folder` gives it.

    Parameters
    ----------
    path : Path
    kind : str
        Of the results to be written.
    locks : bool
        Whether its file system has locks.
    remedy : str
        Of the error where it cannot be written.
    """

    def __init__(self, path: Path, kind: str, *, locks: bool = True, remedy: str = ELSEWHERE) -> None:
        self.path: Path = path
        self.kind: str = kind
        self.locks: bool = locks
        self.remedy: str = remedy

    @contextmanager
    def replaced(self, *, but: Sequence[str] = ()) -> Iterator[Path]:
        """A folder to write results to that take the place of all that paraflex wrote; other files stay.

        Where every file is as before, all stays: figures that were drawn later too.

        Parameters
        ----------
        but : sequence of str
            Patterns of files that stay.

        Raises
        ------
        OutputError
            It cannot be written; the results before are all there.
        """
        with self._changed(lambda name: not _matches(name, but)) as new:
            yield new

    @contextmanager
    def amended(self) -> Iterator[Path]:
        """A folder to write files to that become part of the results."""
        with self._changed(lambda name: False) as new:
            yield new

    @contextmanager
    def _changed(self, is_replaced: Callable[[str], bool]) -> Iterator[Path]:
        new, ready = self.path / _NEW, self.path / _READY
        try:
            shutil.rmtree(new, ignore_errors=True)
            new.mkdir(parents=True)
            yield new
            files = {file.relative_to(new).as_posix(): _digest_of(file, sync=True) for file in _files(new)}
            before = files_of(self.path)
            if all(before.get(name) == files[name] == _digest_of(self.path / name) for name in files):
                return
            for name in files:
                _check_place(self.path, Path(name))
            removed = [name for name in before if is_replaced(name) and name not in files]
            kept = {name: digest for name, digest in before.items() if digest and name not in removed}
            manifest = Manifest.of(self.kind, kept | files)
            write_json(new / MANIFEST, {"paraflex_version": version("paraflex")} | vars(manifest))
            write_json(new / _REMOVED, removed)
            new.replace(ready)
        except KeyboardInterrupt as interrupt:
            interrupt.args = interrupt.args or (f"nothing was written; {self.path} is as it was",)
            raise
        except OutputError as error:
            raise error.at(error.field.replace(str(new), str(self.path))) from None
        except OSError as error:
            raise unwritable(error, str(self.path), self.remedy) from error
        finally:
            shutil.rmtree(new, ignore_errors=True)
        _move(self.path)


@contextmanager
def hold_folder(
    path: Path, kind: str, *, force: bool | None = None, field: str = "folder", remedy: str = ELSEWHERE
) -> Iterator[ResultsFolder]:
    """Keep others from writing to a folder while results are made for it.

    Parameters
    ----------
    path : Path
        Made if it is not there, and removed again where nothing comes of it.
    kind : str
        Of KINDS.
    force : bool, optional
        Whether results of another kind may be replaced; not to be asked for where None.
    field, remedy : str
        What errors name, and the remedy where it cannot be written.

    Raises
    ------
    InputError
        Another process writes to it, or it holds results of another kind.
    OutputError
        It cannot be made or written.
    """
    made: list[Path] = []
    try:
        with suppress(OSError):  # a name that is too long, which the lock tells
            made += [each for each in (path, *path.parents) if not each.exists()]
        with lock_folder(path, field=field) as locks:
            there = kind_of_folder(path)
            if there not in ("", kind) and not force:
                raise InputError(
                    f"the folder holds other results, a {there}", field=field, value=str(path),
                    remedy=f"name another folder{'' if force is None else ', or say --force to replace them'}",
                )  # fmt: skip
            try:
                shutil.rmtree(path / _NEW, ignore_errors=True)
                (path / _NEW).mkdir()
                (path / _NEW).rmdir()
            except OSError as error:
                raise no_folder(path, error, field) from error
            yield ResultsFolder(path, kind, locks=locks, remedy=remedy)
    finally:
        _remove_empty(path, made)


@contextmanager
def added_to(folder: Path) -> Iterator[Path]:
    """A folder to write figures or a report to: where it lies in a folder of results, they become part of these.

    What is drawn of a study while its runs go on is not: it is of results that will not stay.

    Raises
    ------
    FolderInUseError
        Another process is to replace the results.
    """
    with ExitStack() as stack:
        for results in (folder, *folder.parents[:1]):
            if (results / MANIFEST).is_file() and _NEW not in folder.parts:
                kind = kind_of_folder(results)
                try:
                    held = stack.enter_context(hold_folder(results, kind))
                except FolderInUseError:
                    if kind != STUDY_OF_RUNS:
                        raise
                    break
                yield stack.enter_context(held.amended()) / folder.relative_to(results)
                return
        yield folder


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
        lock = sqlite3.connect(folder / LOCK, timeout=0.0)
    except (OSError, sqlite3.OperationalError) as error:
        raise no_folder(folder, error, field) from error
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
                raise no_folder(folder, error, field) from error
            locks = False
        _move(folder)
        yield locks


def no_folder(folder: Path, error: Exception, field: str = "--output") -> OutputError:
    """The error of a folder that cannot be made or written."""
    reason = (getattr(error, "strerror", None) or str(error)).lower()
    return OutputError(f"cannot be written ({reason})", field=field, value=str(folder), remedy=ELSEWHERE)


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
    while (folder / _READY).is_dir():
        try:
            with lock_folder(folder, field=str(folder)):
                return
        except FolderInUseError:
            if time.monotonic() > until:
                raise
            time.sleep(_LOOK)


def files_of(folder: Path) -> dict[str, str]:
    """The files of a folder that paraflex wrote, with the digests of its manifest; empty where it lists none."""
    try:
        manifest = read_manifest(folder)
    except InputError:
        manifest = None
    kind = kind_of_folder(folder)
    found = {} if manifest is not None else dict.fromkeys((*KINDS.get(kind, ()), *([_REPORT] if kind else ())), "")
    if kind == STUDY_OF_RUNS:
        each = (file.relative_to(folder).as_posix() for pattern in _OF_STUDY for file in folder.glob(pattern))
        found |= dict.fromkeys(each, "")
    found |= {} if manifest is None else manifest.files
    return {name: digest for name, digest in found.items() if (folder / name).is_file()}


def foreign_files(folder: Path) -> list[str]:
    """Files of a folder that paraflex did not write; what lies in folders of other results is theirs."""
    ours = files_of(folder)
    inner = {name.partition("/")[0] for name in ours if "/" in name}
    entries = [entry for entry in sorted(folder.iterdir()) if entry.name not in (MANIFEST, LOCK, _NEW, _READY)]
    found = [file for entry in entries if entry.name in inner for file in _files(entry)]
    found += [entry for entry in entries if entry.name not in inner and not (entry.is_dir() and kind_of_folder(entry))]
    return [name for name in (each.relative_to(folder).as_posix() for each in found) if name not in ours]


def _move(folder: Path) -> None:
    """Put a change that is ready in its place; where it was broken off, the rest of it. Ctrl-C waits for its end."""
    ready = folder / _READY
    if not ready.is_dir():
        return
    try:
        with uninterrupted():
            _put(ready, folder)
    except OSError as error:
        raise unwritable(error, str(folder), ELSEWHERE) from error


def _check_place(folder: Path, name: Path) -> None:
    """Check that a file can be moved to its place in a folder, before any is."""
    inner = [folder / each for each in list(name.parents)[:-1]]
    if (folder / name).is_dir() or any(each.exists() and not each.is_dir() for each in inner):
        what = "a folder" if (folder / name).is_dir() else "a file"
        where = str(folder / name) if what == "a folder" else str(inner[-1])
        raise OutputError(f"cannot be written ({what} of that name is there)", field=where, remedy="move it elsewhere")


def _put(ready: Path, folder: Path) -> None:
    if (ready / MANIFEST).is_file():
        removed = json.loads((ready / _REMOVED).read_text(encoding="utf-8"))
        for file in _files(ready):
            name = file.relative_to(ready)
            if name.as_posix() not in (MANIFEST, _REMOVED):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                file.replace(folder / name)
        for name in filter(_is_inside, removed):
            (folder / name).unlink(missing_ok=True)
            with suppress(OSError):  # it holds other files, or is gone
                (folder / name).parent.rmdir()
        # The last of all: until now it is known what is left to do.
        (ready / MANIFEST).replace(folder / MANIFEST)
    shutil.rmtree(ready, ignore_errors=True)


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.rglob("*") if file.is_file())


def _is_inside(name: str) -> bool:
    """Whether a name in a list is of a file within the folder: others are never touched, whoever wrote the list."""
    path = PureWindowsPath(name)  # which takes both slashes for what they are
    return not path.anchor and ".." not in path.parts


def _matches(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatch(name, pattern) for pattern in patterns)


def _is_derived(name: str) -> bool:
    """Whether a file is made of the files of numbers, and can be made again."""
    return name == _REPORT or name.startswith(("figures/", "export/"))


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _digest_of(file: Path, *, sync: bool = False) -> str:
    """The digest of a file's bytes, which are on the disk afterwards where that is asked for."""
    with file.open("rb+" if sync else "rb") as opened:
        if sync:
            os.fsync(opened.fileno())
        digest = hashlib.blake2b(digest_size=16)
        while piece := opened.read(_PIECE):
            digest.update(piece)
        return digest.hexdigest()


def _remove_empty(folder: Path, made: Sequence[Path]) -> None:
    """Remove folders that were made for results of which nothing came."""
    with suppress(OSError):
        if folder in made and {file.name for file in folder.iterdir()} == {LOCK}:
            (folder / LOCK).unlink()
        for each in made:
            each.rmdir()
