"""Folder of results locked for writing, whose files are replaced or extended atomically."""

import shutil
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path

from paraflex.errors import InputError, OutputError
from paraflex.interrupts import uninterrupted
from paraflex.writing import ELSEWHERE, unwritable, write_json
from .changes import MANIFEST, NEW, READY, REMOVED, check_place, files_in, finish_moves
from .lock import LOCK, FolderInUseError, lock_folder
from .manifest import STUDY_OF_RUNS, Manifest, contents_of, digest_of, files_of, kind_of_folder, whole_manifest


class ResultsFolder:
    """Folder of results to which only this process writes; created by `hold_folder`.

    Parameters
    ----------
    path : Path
        Path of the folder.
    kind : str
        Kind of the results to be written.
    locks : bool
        Whether the file system of the folder has locks.
    remedy : str
        Remedy in the error raised if the folder cannot be written.
    """

    def __init__(self, path: Path, kind: str, *, locks: bool = True, remedy: str = ELSEWHERE) -> None:
        self.path: Path = path
        self.kind: str = kind
        self.locks: bool = locks
        self.remedy: str = remedy

    @contextmanager
    def replaced(self, *, but: Sequence[str] = ()) -> Iterator[Path]:
        """Yield a temporary folder for results that replace all files written by paraflex; other files are kept.

        If the new results differ from the old ones in wall times only, no file is removed, so that figures drawn
        afterwards are kept.

        Parameters
        ----------
        but : sequence of str
            Patterns of files that are kept.

        Raises
        ------
        OutputError
            Folder that cannot be written; the previous results are unchanged.
        """
        with self._changed(lambda name: not any(fnmatch(name, pattern) for pattern in but)) as new:
            yield new

    @contextmanager
    def added_files(self) -> Iterator[Path]:
        """Yield a temporary folder for files that are added to the results."""
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
                removed = set()  # figures in the folder show the same numbers
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
    """Lock a folder for writing while results are computed for it.

    Parameters
    ----------
    path : Path
        Folder; created if necessary, and removed again if nothing is written to it.
    kind : str
        Kind of the results, from FOLDER_FILES.
    force : bool, optional
        Whether results of another kind may be replaced; None if the caller offers no such option.
    field, remedy : str
        Field named in errors, and the remedy for a folder that cannot be written.

    Raises
    ------
    InputError
        Folder to which another process writes, or which holds results of another kind.
    OutputError
        Folder that cannot be created or written.
    """
    created: list[Path] = []
    try:
        with suppress(OSError):  # name that is too long, reported when the folder is locked
            created += [each for each in (path, *path.parents) if not each.exists()]
        with lock_folder(path, field=field) as locks:
            there = kind_of_folder(path)
            if there not in ("", kind) and not force:
                raise InputError(
                    f"the folder holds other results, a {there}", field=field, value=str(path),
                    remedy=f"name another folder{'' if force is None else ', or use --force to replace them'}",
                )  # fmt: skip
            try:
                with uninterrupted():  # otherwise an empty folder could remain
                    shutil.rmtree(path / NEW, ignore_errors=True)
                    (path / NEW).mkdir()
                    (path / NEW).rmdir()
            except OSError as error:
                raise unwritable(error, field, ELSEWHERE, str(path)) from error
            yield ResultsFolder(path, kind, locks=locks, remedy=remedy)
    finally:
        # Remove the folders that were created here if no results were written.
        with suppress(OSError):
            if path in created and {file.name for file in path.iterdir()} == {LOCK}:
                (path / LOCK).unlink()
            for each in created:
                each.rmdir()


@contextmanager
def added_to(folder: Path) -> Iterator[Path]:
    """Yield a folder for figures or a report, which become part of the results if it lies in a folder of results.

    Figures of a study that is still running do not become part of it, because its results will be replaced.

    Raises
    ------
    FolderInUseError
        Folder of results that another process is about to replace.
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
                yield stack.enter_context(held.added_files()) / folder.relative_to(results)
                return
        yield folder
