"""Seals of binary files: a digest of all bytes, written last and checked when a file is read.

A seal stands where other programs do not look: in netCDF files, which are HDF5, after the end that the file itself
names; in Parquet files between the last page and the footer, which finds pages by their offsets. Programs that write
such a file anew, or change it by the libraries of these formats, leave no seal, and it is read unchecked, as files of
earlier releases are.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import BinaryIO

from paraflex.errors import InputError

NETCDF, PARQUET = b"\x89HDF", b"PAR1"
# The last file without a seal that this process has read, if any: it may hold anything.
unsealed: list[Path] = []
_MARK = b"paraflex"
_DIGEST = 24
_SEAL = len(_MARK) + _DIGEST
# So much is read at once [bytes].
_PIECE = 1 << 20
# Behind a Parquet file's footer stand its length and the mark.
_TAIL = 8


def seal(file: Path) -> None:
    """Put the digest of a netCDF or Parquet file into it."""
    with file.open("rb+") as stream:
        start, end = _place(stream)
        digest = _digest(stream, start, start)
        stream.seek(start)
        footer = stream.read(end - start)
        stream.seek(start)
        stream.write(_MARK + digest + footer)


def check_seal(file: Path, remedy: str) -> None:
    """See that a file is as it was written, as far as it has a seal.

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
        with file.open("rb") as stream:
            sealed, whole = _state(stream)
    except OSError as error:
        raise unreadable(error, file) from error
    if not sealed:
        unsealed[:] = [file]
    if not whole:
        raise damaged(file, "not as it was written", remedy)


def unreadable(error: OSError, file: Path, remedy: str = "check its permissions") -> InputError:
    """The error of a file that cannot be read, with the system's reason."""
    return InputError(f"cannot be read ({error.strerror or error})", field=str(file), remedy=remedy)


def check_regular(file: Path) -> None:
    """Raise an OSError for what may never end, or begin, to be read, as foreign folders may hold."""
    if file.is_fifo() or file.is_char_device():
        raise OSError("a pipe or a device, not a file")


def damaged(file: Path, why: str, remedy: str) -> InputError:
    """The error of a file that is not what was written."""
    return InputError(f"damaged: {why}", field=str(file), remedy=remedy)


def _state(stream: BinaryIO) -> tuple[bool, bool]:
    """Whether a file has a seal, and whether it is as it was written, as far as that can be seen."""
    start, end = _place(stream)
    start = max(start - _SEAL, 0)
    stream.seek(start)
    found = stream.read(_SEAL)
    if not found.startswith(_MARK):
        return False, end <= _named_end(stream, end)
    return True, found[len(_MARK) :] == _digest(stream, start, start + _SEAL)


def _place(stream: BinaryIO) -> tuple[int, int]:
    """Where a seal is to stand, or ends, and where the file ends."""
    end = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(PARQUET)) != PARQUET or end < _TAIL:
        return end, end
    stream.seek(end - _TAIL)
    footer = int.from_bytes(stream.read(4), "little")
    return max(end - _TAIL - footer, 0), end


def _named_end(stream: BinaryIO, end: int) -> int:
    """Where an HDF5 file says that it ends: what lies behind it was a seal. Of other files where they do end."""
    stream.seek(0)
    head = stream.read(36)
    # Superblocks of these versions, with offsets of 8 bytes.
    if head[:4] == NETCDF and len(head) == 36 and head[8] in (2, 3) and head[9] == 8:
        return int.from_bytes(head[28:36], "little")
    return end


def _digest(stream: BinaryIO, stop: int, go_on: int) -> bytes:
    """Of all bytes before one place and from another on."""
    found = hashlib.blake2b(digest_size=_DIGEST)
    stream.seek(0)
    left = stop
    while left and (piece := stream.read(min(_PIECE, left))):
        found.update(piece)
        left -= len(piece)
    stream.seek(go_on)
    while piece := stream.read(_PIECE):
        found.update(piece)
    return found.digest()
