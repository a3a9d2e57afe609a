"""Seals of binary files: a digest of all bytes, written last and checked when the file is read.

The seal is stored at a place that other programs ignore: in netCDF files, which are HDF5, after the end of file that
the superblock gives; in Parquet files between the last page and the footer, which addresses pages by their offsets.
Programs that rewrite such a file, or change it with the libraries of these formats, leave no seal. The file is then
read unchecked, like files of earlier releases.
"""

import hashlib
from pathlib import Path
from typing import BinaryIO

from .errors import InputError

NETCDF, PARQUET = b"\x89HDF", b"PAR1"
# The last file without a seal that this process has read, if any; its contents are unchecked.
unsealed: list[Path] = []
_MARK = b"paraflex"
_DIGEST = 24
_SEAL = len(_MARK) + _DIGEST
# Number of bytes read at once.
_PIECE = 1 << 20
# The footer of a Parquet file is followed by its length and the format's mark, 4 bytes each.
_TAIL = 8


def seal(file: Path) -> None:
    """Write the digest of a netCDF or Parquet file into the file."""
    with file.open("rb+") as stream:
        start, end = _place(stream)
        digest = _digest(stream, start, start)
        stream.seek(start)
        footer = stream.read(end - start)
        stream.seek(start)
        stream.write(_MARK + digest + footer)


def check_seal(file: Path, remedy: str) -> None:
    """Check that a file is unchanged since it was sealed; a file without a seal is recorded in `unsealed`.

    Parameters
    ----------
    file : Path
        netCDF or Parquet file.
    remedy : str
        Remedy of the error for a damaged file.

    Raises
    ------
    InputError
        The file is damaged, or cannot be read.
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
    """Return the error for a file that cannot be read, with the reason that the system gives."""
    return wrong_file(file, f"cannot be read ({error.strerror or error})", remedy)


def check_regular(file: Path) -> None:
    """Raise an OSError for a pipe or a device, as reading it may block or never end."""
    if file.is_fifo() or file.is_char_device():
        raise OSError("a pipe or a device, not a file")


def damaged(file: Path, why: str, remedy: str) -> InputError:
    """Return the error for a file that was changed or cut off after it was written."""
    return wrong_file(file, f"damaged: {why}", remedy)


def wrong_file(file: Path, problem: str, remedy: str) -> InputError:
    """Return the error for a file or folder that cannot be used."""
    return InputError(problem, field=str(file), remedy=remedy)


def _state(stream: BinaryIO) -> tuple[bool, bool]:
    """Return whether a file has a seal, and whether it is unchanged as far as the seal or the given end can show."""
    start, end = _place(stream)
    start = max(start - _SEAL, 0)
    stream.seek(start)
    found = stream.read(_SEAL)
    if not found.startswith(_MARK):
        return False, end <= _named_end(stream, end)
    return True, found[len(_MARK) :] == _digest(stream, start, start + _SEAL)


def _place(stream: BinaryIO) -> tuple[int, int]:
    """Return the offset at which a seal is inserted, or at which an existing one ends, and the size of the file."""
    end = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(PARQUET)) != PARQUET or end < _TAIL:
        return end, end
    stream.seek(end - _TAIL)
    footer = int.from_bytes(stream.read(4), "little")
    return max(end - _TAIL - footer, 0), end


def _named_end(stream: BinaryIO, end: int) -> int:
    """Return the end of an HDF5 file according to its superblock; bytes behind it were a seal. Else return `end`."""
    stream.seek(0)
    head = stream.read(36)
    # The end is read from superblocks of versions 2 and 3 with 8-byte offsets only.
    if head[:4] == NETCDF and len(head) == 36 and head[8] in (2, 3) and head[9] == 8:
        return int.from_bytes(head[28:36], "little")
    return end


def _digest(stream: BinaryIO, stop: int, go_on: int) -> bytes:
    """Return the digest of all bytes before the offset `stop` and from the offset `go_on`."""
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
