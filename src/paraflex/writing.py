"""Files and folders that are written whole or not at all.

What is being written has another name until it is complete. An error or Ctrl-C on the way leaves what was there before,
and nothing half written beside it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from paraflex.errors import InputError, OutputError
from paraflex.seals import check_regular, damaged, seal, unreadable, unsealed

ELSEWHERE = "choose another folder"
# Under which key a file of JSON has the digest of the others.
_DIGEST = "digest"
# What Windows takes in no name, and the names that it keeps for devices.
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]')
_DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}
# Of what is gone on with where it was left.
GO_ON = "what is written stays; free some space and run the same command again: it goes on from there"


@contextmanager
def whole_file(path: Path, *, remedy: str = ELSEWHERE, field: str = "", parents: bool = True) -> Iterator[Path]:
    """The name to write a file under, which takes the place of `path` when it is complete and on the disk.

    Parameters
    ----------
    path : Path
    remedy, field : str
        Of the error; its field is the file by default.
    parents : bool
        Whether folders are made that the file is to be in.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    if not path.name:
        raise InputError("names no file", field=field or "path", value=str(path), remedy="give a file's name")
    unfinished = path.with_name(path.name + ".part")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        # A link, perhaps, through which another file would be written.
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
    """The name to write a netCDF or Parquet file under, which gets a digest of its bytes; see `whole_file`."""
    with whole_file(path, **options) as unfinished:
        yield unfinished
        seal(unfinished)


@contextmanager
def whole_folder(path: Path, *, replaced: str, remedy: str = ELSEWHERE) -> Iterator[Path]:
    """A folder to write files to, which move to `path` when all are complete.

    Parameters
    ----------
    path : Path
    replaced : str
        Pattern of the files of `path` that they replace; others stay.
    remedy : str
        Of the error.

    Raises
    ------
    OutputError
        It cannot be written.
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
    """Write a file of text; see `whole_file` for the options and errors."""
    with whole_file(path, **options) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def write_json(path: Path, data: Any, **options: Any) -> None:
    """Write plain values as JSON, others as their text; see `whole_file` for the options and errors.

    A table gets a digest of what it says, which `read_json` checks.
    """
    if isinstance(data, dict):
        # Of what is read again: keys and values are those of JSON.
        plain = json.loads(json.dumps(data, default=str))
        data = plain | {_DIGEST: _digest(plain)}
    write_text(path, json.dumps(data, indent=2, default=str) + "\n", **options)


def read_json(file: Path, remedy: str = "run the same command again") -> dict[str, Any]:
    """The table that a file of JSON holds, without its digest; see `read_values`.

    Raises
    ------
    InputError
        It holds something else.
    """
    found = read_values(file, remedy)
    if not isinstance(found, dict):
        raise InputError("not a file that paraflex wrote", field=str(file), remedy=remedy)
    return found


def read_values(file: Path, remedy: str) -> Any:
    """What a file of JSON holds; of a table with a digest all else.

    Parameters
    ----------
    file : Path
    remedy : str
        Of the errors.

    Raises
    ------
    InputError
        It is damaged, or cannot be read.
    """
    try:
        check_regular(file)
        found = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreadable(error, file, remedy) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise damaged(file, "not JSON to its end", remedy) from error
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
    """A file's name on every system, of what users call modes, paths and models; the same where it is one already."""
    name = _FORBIDDEN.sub("_", text).rstrip(". ")
    return f"_{name}" if name.partition(".")[0].upper() in _DEVICES else name or "_"


def unwritable(error: Exception, field: str, remedy: str, value: str | None = None) -> OutputError:
    """The error of a place that cannot be written, with the system's reason."""
    reason = (getattr(error, "strerror", None) or str(error)).lower()
    return OutputError(f"cannot be written ({reason})", field=field, value=value, remedy=remedy)
