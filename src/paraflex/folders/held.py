"""Folder of results: its manifest and the files that paraflex wrote, locked while they are replaced or extended."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path
from typing import Any

from paraflex.errors import InputError, OutputError
from paraflex.interrupts import uninterrupted
from paraflex.seals import damaged
from paraflex.writing import ELSEWHERE, read_json, unwritable, write_json
from .changes import DRAWN, MANIFEST, NEW, READY, REMOVED, check_place, files_in, finish_moves, is_inside
from .kinds import FOLDER_FILES, STUDY_OF_RUNS
from .lock import LOCK, FolderInUseError, finish_change, lock_folder

# Further files of a study of many runs, in the manifest or not, because they come and go while it runs.
_OF_STUDY = (
    "journal.sqlite*", "parts/*", "trajectories/*", "unfinished.parquet", "results.csv", "result.json", "summary.json",
    "best.toml", "indices.*", "report.html",
)  # fmt: skip
_REPORT = "report.html"
# Values of JSON and variables of netCDF that differ between equal runs.
_CLOCK = {"wall_time", "full_wall_time"}


@dataclass(frozen=True)
class Manifest:
    """List of the files that belong together in a folder, with their digests.

    Attributes
    ----------
    kind : str
        Kind of the results, from KINDS.
    identity : str
        Digest of the results without figures, report and exports, and without wall times. It is the same for equal
        runs, and independent of the folder.
    files : mapping of str to str
        Digests of the bytes of all files, by their names within the folder ("figures/desired_path.png").
    contents : mapping of str to str
        Digests of the contents without wall times, for files that may contain them.
    """

    kind: str
    identity: str
    files: Mapping[str, str]
    contents: Mapping[str, str]

    @classmethod
    def of(cls, kind: str, files: Mapping[str, str], contents: Mapping[str, str]) -> "Manifest":
        """Build the manifest of files from their digests; further files in `contents` are ignored."""
        contents = {name: contents[name] for name in sorted(files) if name in contents}
        # Other files are derived from the numerical results and can be generated again.
        own = [name for name in sorted(files) if name != _REPORT and not name.startswith(("figures/", "export/"))]
        numbers = [f"{name} {contents.get(name, files[name])}" for name in own]
        return cls(kind, _hash("\n".join(numbers).encode()).hexdigest(), dict(sorted(files.items())), contents)


def read_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; return None if there is none.

    Raises
    ------
    InputError
        Damaged manifest.
    """
    file = folder / MANIFEST
    if not file.is_file():
        return None
    remedy = "run the same command again; or delete this file, and others are read without it"
    found = read_json(file, remedy)
    try:
        manifest = Manifest.of(found["kind"], found["files"], found.get("contents", {}))
        whole = manifest.identity == found["identity"] and manifest.kind in FOLDER_FILES
        if whole and all(map(is_inside, manifest.files)):
            return manifest
    except (KeyError, TypeError, ValueError, AttributeError):
        pass
    raise damaged(file, "not a list of the folder's files", remedy)


def kind_of_folder(folder: Path) -> str:
    """Return the kind of results in a folder; empty if it holds no results of paraflex."""
    finish_change(folder)
    return _kind(folder, whole_manifest(folder))


def whole_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; return None if there is none or if it is damaged."""
    try:
        return read_manifest(folder)
    except InputError:
        return None


def _kind(folder: Path, manifest: Manifest | None) -> str:
    if manifest is not None:
        return manifest.kind
    return next((kind for kind, names in FOLDER_FILES.items() if any((folder / name).is_file() for name in names)), "")


def check_listed(file: Path, remedy: str) -> None:
    """Check that a file is the one listed in the manifest of its folder; without a manifest nothing is checked.

    Parameters
    ----------
    file : Path
        File to check.
    remedy : str
        Remedy given in the error.

    Raises
    ------
    InputError
        Damaged file, or file of other results than the files beside it.
    """
    if _is_listed(file) or _is_listed(file):  # checked twice, as another process may just have replaced the results
        return
    why = "damaged, or of other results: not the file that the folder's manifest lists"
    raise InputError(why, field=str(file), remedy=remedy)


def files_of(folder: Path) -> dict[str, str]:
    """Return the files of a folder written by paraflex, with their digests from the manifest, or "" without one."""
    finish_change(folder)
    manifest = whole_manifest(folder)
    kind = _kind(folder, manifest)
    usual = (*FOLDER_FILES[kind], _REPORT) if kind and manifest is None else ()
    found = dict.fromkeys(usual, "")
    if kind == STUDY_OF_RUNS:
        each = (file.relative_to(folder).as_posix() for pattern in _OF_STUDY for file in folder.glob(pattern))
        found |= dict.fromkeys(each, "")
    found |= {} if manifest is None else manifest.files
    return {name: digest for name, digest in found.items() if (folder / name).is_file()}


def foreign_files(folder: Path) -> list[str]:
    """Return the files of a folder not written by paraflex, except those in subfolders that hold other results."""
    ours = files_of(folder)
    inner = {name.partition("/")[0] for name in ours if "/" in name}
    entries = [entry for entry in sorted(folder.iterdir()) if entry.name not in (MANIFEST, LOCK, NEW, READY, DRAWN)]
    found = [file for entry in entries if entry.name in inner for file in files_in(entry)]
    found += [entry for entry in entries if entry.name not in inner and not (entry.is_dir() and kind_of_folder(entry))]
    return [name for name in (each.relative_to(folder).as_posix() for each in found) if name not in ours]


def digest_of(file: Path, *, sync: bool = False) -> str:
    """Compute the digest of a file's bytes; if `sync` is True, the file is flushed to the disk first."""
    with file.open("rb+") if sync else file.open("rb") as opened:
        if sync:
            os.fsync(opened.fileno())
        return hashlib.file_digest(opened, _hash).hexdigest()


def contents_of(files: Mapping[str, Path]) -> dict[str, str]:
    """Compute the digests of the contents of files without wall times, by name, for JSON and netCDF files only."""
    found = {}
    for name, file in files.items():
        if file.suffix in (".json", ".nc"):
            with suppress(OSError, ValueError):  # not of that format
                found[name] = _content(file)
    return found


def _content(file: Path) -> str:
    if file.suffix == ".json":
        return _hash(json.dumps(_without_times(json.loads(file.read_text(encoding="utf-8")))).encode()).hexdigest()
    import xarray as xr

    found = _hash()
    with uninterrupted(), xr.open_dataset(file, engine="netcdf4", decode_cf=False, cache=False) as data:
        for name in sorted(set(map(str, data.variables)) - _CLOCK):
            values = data.variables[name]
            plain = values.values if values.dtype != object else values.values.astype(str)
            found.update(repr((name, values.dims, plain.dtype.str, plain.shape, values.attrs)).encode())
            found.update(plain.tobytes())
        found.update(repr(data.attrs).encode())
    return found.hexdigest()


def _is_listed(file: Path) -> bool:
    for folder in file.absolute().parents[:2]:
        finish_change(folder)
        manifest = read_manifest(folder)
        if manifest is not None:
            expected = manifest.files.get(file.absolute().relative_to(folder).as_posix())
            return expected is None or expected == digest_of(file)
    return True


def _without_times(found: Any) -> Any:
    """Return values of JSON without wall times and without digests."""
    if isinstance(found, dict):
        return {name: _without_times(each) for name, each in sorted(found.items()) if name not in {*_CLOCK, "digest"}}
    return [_without_times(each) for each in found] if isinstance(found, list) else found


def _hash(data: bytes = b"") -> hashlib.blake2b:
    return hashlib.blake2b(data, digest_size=16)


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
    def drawn_files(self) -> Iterator[Path]:
        """Yield a temporary folder for files drawn while results are written, from which they are moved afterwards."""
        drawn = self.path / DRAWN
        try:
            drawn.mkdir()
        except OSError as error:
            raise unwritable(error, str(self.path), self.remedy) from error
        try:
            yield drawn
        finally:
            with uninterrupted():
                shutil.rmtree(drawn, ignore_errors=True)

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
                    for name in (NEW, DRAWN):
                        shutil.rmtree(path / name, ignore_errors=True)
                        (path / name).mkdir()
                        (path / name).rmdir()
            except FileExistsError as error:
                raise OutputError(
                    "cannot be written (it is there, and cannot be removed)", field=str(error.filename),
                    remedy="move it elsewhere",
                ) from error  # fmt: skip
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
