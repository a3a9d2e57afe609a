"""A folder of results held for writing: its files are replaced whole or not at all, or some are added."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path

from paraflex.errors import InputError, OutputError
from paraflex.folders.changes import MANIFEST, NEW, READY, REMOVED, check_place, files_in, finish_moves
from paraflex.folders.lock import LOCK, FolderInUseError, lock_folder
from paraflex.folders.manifest import (
    STUDY_OF_RUNS,
    Manifest,
    contents_of,
    digest_of,
    files_of,
    kind_of_folder,
    whole_manifest,
)
from paraflex.interrupts import uninterrupted
from paraflex.writing import ELSEWHERE, unwritable, write_json


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

        If the new results differ in wall times alone, nothing is removed: figures that were drawn later stay too.

        Parameters
        ----------
        but : sequence of str
            Patterns of files that stay.

        Raises
        ------
        OutputError
            It cannot be written; the results before are all there.
        """
        with self._changed(lambda name: not any(fnmatch(name, pattern) for pattern in but)) as new:
            yield new

    @contextmanager
    def amended(self) -> Iterator[Path]:
        """A folder to write files to that become part of the results."""
        with self._changed(lambda name: False) as new:
            yield new

    @contextmanager
    def _changed(self, is_replaced: Callable[[str], bool]) -> Iterator[Path]:
        new, ready = self.path / NEW, self.path / READY
        try:
            shutil.rmtree(new, ignore_errors=True)
            new.mkdir(parents=True)
            yield new
            files = {file.relative_to(new).as_posix(): digest_of(file, sync=True) for file in files_in(new)}
            before = files_of(self.path)
            if all(before.get(name) == files[name] == digest_of(self.path / name) for name in files):
                return
            for name in files:
                check_place(self.path, Path(name))
            removed = {name for name in before if is_replaced(name) and name not in files}
            old = whole_manifest(self.path)
            contents = dict(old.contents if old else {}) | contents_of({name: new / name for name in files})

            def listed(removed: Container[str]) -> Manifest:
                kept = {name: digest for name, digest in before.items() if digest and name not in removed}
                return Manifest.of(self.kind, kept | files, contents)

            if old is not None and listed(removed).identity == old.identity:
                removed = set()  # figures are of these numbers
            manifest = listed(removed)
            write_json(new / MANIFEST, {"paraflex_version": version("paraflex")} | vars(manifest))
            write_json(new / REMOVED, sorted(removed))
            new.replace(ready)
        except KeyboardInterrupt as interrupt:
            interrupt.args = interrupt.args or (f"nothing was written; {self.path} is as it was",)
            raise
        except OutputError as error:
            raise error.at(error.field.replace(str(new), str(self.path))) from None
        except OSError as error:
            raise unwritable(error, str(self.path), self.remedy) from error
        finally:
            with uninterrupted():
                shutil.rmtree(new, ignore_errors=True)
        finish_moves(self.path)


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
                with uninterrupted():  # or one is left
                    shutil.rmtree(path / NEW, ignore_errors=True)
                    (path / NEW).mkdir()
                    (path / NEW).rmdir()
            except OSError as error:
                raise unwritable(error, field, ELSEWHERE, str(path)) from error
            yield ResultsFolder(path, kind, locks=locks, remedy=remedy)
    finally:
        # Folders that were made for results of which nothing came.
        with suppress(OSError):
            if path in made and {file.name for file in path.iterdir()} == {LOCK}:
                (path / LOCK).unlink()
            for each in made:
                each.rmdir()


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
            if (results / MANIFEST).is_file() and NEW not in folder.parts:
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
