"""Atomic writing of files and folders: each is written completely or not at all.

A file has another name until it is complete. After an error or Ctrl-C, the previous file is still there and no partial
file is left beside it.
"""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import InputError, OutputError
from .seals import check_regular, damaged, seal, unreadable, unsealed, wrong_file

ELSEWHERE = "choose another folder"
# Key of a JSON file under which the digest of all other entries is stored.
_DIGEST = "digest"
# Characters that Windows forbids in file names, and names that it reserves for devices.
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]')
_DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}
# Remedy for computations that resume where they stopped.
GO_ON = "what is written stays; free some space and run the same command again: it goes on from there"


@contextmanager
def whole_file(path: Path, *, remedy: str = ELSEWHERE, field: str = "", parents: bool = True) -> Iterator[Path]:
    """Provide a temporary name for a file, which replaces `path` when it is complete and on the disk.

    Parameters
    ----------
    path : Path
        File to write.
    remedy, field : str
        Remedy and field of the error; the field is the file by default.
    parents : bool
        Whether missing parent folders are created.

    Raises
    ------
    InputError
        `path` does not name a file.
    OutputError
        The file cannot be written.
    """
    if not path.name:
        raise InputError("does not name a file", field=field or "path", value=str(path), remedy="give a file's name")
    unfinished = path.with_name(path.name + ".part")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        # It may be a link, through which another file would be overwritten.
        unfinished.unlink(missing_ok=True)
        yield unfinished
        with unfinished.open("rb+") as opened:
            os.fsync(opened.fileno())
        unfinished.replace(path)
    except OSError as error:
        raise unwritable(error, field or str(path), remedy) from error
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)


@contextmanager
def sealed_file(path: Path, **options: Any) -> Iterator[Path]:
    """Provide a temporary name for a netCDF or Parquet file, which is sealed with a digest; see `whole_file`."""
    with whole_file(path, **options) as unfinished:
        yield unfinished
        seal(unfinished)


@contextmanager
def whole_folder(path: Path, *, replaced: str, remedy: str = ELSEWHERE) -> Iterator[Path]:
    """Provide a temporary folder, whose files move to `path` when all are complete.

    Parameters
    ----------
    path : Path
        Folder to write.
    replaced : str
        Glob pattern of the existing files in `path` that are removed; others stay.
    remedy : str
        Remedy of the error.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    unfinished = path.with_name(path.name + ".part")
    try:
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        yield unfinished
        if not path.is_dir():
            unfinished.replace(path)
            return
        for old in path.glob(replaced):
            old.unlink()
        for new in sorted(unfinished.iterdir()):
            new.replace(path / new.name)
    except OSError as error:
        raise unwritable(error, str(path), remedy) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def write_text(path: Path, text: str, **options: Any) -> None:
    """Write a text file; see `whole_file` for the options and errors."""
    with whole_file(path, **options) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def write_json(path: Path, data: Any, **options: Any) -> None:
    """Write plain values as JSON, other objects as their text; see `whole_file` for the options and errors.

    A dictionary gets a digest of its contents, which `read_json` checks.
    """
    if isinstance(data, dict):
        # The digest is that of the data as read back, whose keys and values have JSON types.
        plain = json.loads(json.dumps(data, default=str))
        data = plain | {_DIGEST: _digest(plain)}
    write_text(path, json.dumps(data, indent=2, default=str) + "\n", **options)


def read_json(file: Path, remedy: str = "run the same command again") -> dict[str, Any]:
    """Read a dictionary from a JSON file, without its digest; see `read_values`.

    Raises
    ------
    InputError
        The file does not hold a dictionary.
    """
    found = read_values(file, remedy)
    if not isinstance(found, dict):
        raise wrong_file(file, "not a file that paraflex wrote", remedy)
    return found


def read_values(file: Path, remedy: str) -> Any:
    """Read the contents of a JSON file; the digest of a dictionary is checked and left out.

    Parameters
    ----------
    file : Path
        JSON file.
    remedy : str
        Remedy of the errors.

    Raises
    ------
    InputError
        The file is damaged, or cannot be read.
    """
    try:
        check_regular(file)
        found = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreadable(error, file, remedy) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise damaged(file, "not complete JSON", remedy) from error
    digested = isinstance(found, dict) and _DIGEST in found
    if digested and found.pop(_DIGEST) != _digest(found):
        raise damaged(file, "not as it was written", remedy)
    if not digested:
        unsealed[:] = [file]
    return found


def _digest(table: dict[str, Any]) -> str:
    text = json.dumps(table, sort_keys=True, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def portable_name(text: str) -> str:
    """Convert the name of a mode, path or model to a file name valid on every system; valid names are unchanged."""
    name = _FORBIDDEN.sub("_", text).rstrip(". ")
    return f"_{name}" if name.partition(".")[0].upper() in _DEVICES else name or "_"


def unwritable(error: Exception, field: str, remedy: str, value: str | None = None) -> OutputError:
    """Return the error for a file or folder that cannot be written, with the reason that the system gives."""
    reason = (getattr(error, "strerror", None) or str(error)).lower()
    return OutputError(f"cannot be written ({reason})", field=field, value=value, remedy=remedy)
