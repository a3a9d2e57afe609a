"""Cache of kernels on disk: machine code of one state of the sources, made by one compiler.

Numba checks the file of a cached kernel, not those of the kernels it calls. Therefore each state of all kernels, Numba,
llvmlite and NumPy has a folder of its own, and code compiled from another state cannot be loaded. Files are pickles of
machine code, which must not be loaded if damaged: each begins with a digest of the rest.

A wheel may contain compiled kernels, which are used if the cache has none. They are of use for the releases of Numba,
llvmlite, NumPy and Python that it was built with.
"""

import hashlib
import os
import pickle
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from ..interrupts import uninterrupted
from .notice import announce_damage, announce_disk_full
from .plain import STATE, SUPPLIED
from .processor import processor

# Number of states kept: a checkout may be used by several environments, a cache in a home folder by several machines.
STATES_KEPT = 3

_PREFIX = "paraflex-kernels-"

FOLDER = _PREFIX + STATE


class _Sealed(IndexDataCacheFile):
    """Cache with one file per signature of a kernel and without Numba's index, as two processes may compile at once.

    With an index both could give different code the same name. Kernels whose files are damaged are compiled again.
    """

    def save(self, key: Any, data: Any) -> None:
        self._seal(self._file(key), (self._source_stamp, key, data))

    def load(self, key: Any) -> Any:
        file = self._file(key)
        for each in (file, str(SUPPLIED / Path(file).name)):
            # The function may have been edited: functions outside paraflex are not part of the state.
            found = self._unsealed(each)
            if found is not None and found[:2] == (self._source_stamp, key):
                return found[2]
        return None

    def _file(self, key: Any) -> str:
        return str(Path(self._index_path).with_suffix(f".{_digest(repr(key).encode()).hex()}.nbc"))

    def _seal(self, file: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(file) as opened:
            opened.write(_digest(content) + content)

    def _unsealed(self, file: str) -> Any:
        """Return the content of a file, or None if it cannot be read; a damaged file is removed."""
        try:
            content = Path(file).read_bytes()
        except OSError:
            return None
        size = len(_digest(b""))
        if content[:size] == _digest(content[size:]):
            return pickle.loads(content[size:])
        announce_damage(Path(file))
        with suppress(OSError):
            os.unlink(file)
        return None


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=16).digest()


class KernelCache(FunctionCache):
    """Numba's cache of a function, in a folder for this state of all kernels."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._place = Path(self._cache_path)
        self._cache_path = str(self._place / FOLDER)
        # The function may be defined in a file outside paraflex.
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Sealed(self._cache_path, self._impl.filename_base, stamp)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        signature, _, function = super()._index_key(sig, codegen)
        return signature, processor(), function

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        # Between two of llvmlite's steps code has two owners: an interrupt there would let both delete it.
        with uninterrupted():
            return super()._load_overload(sig, target_context)

    def _save_overload(self, sig: Any, data: Any) -> None:
        try:
            make_folder(self._place)
            super()._save_overload(sig, data)
        except OSError as error:
            announce_disk_full(self._place, error)


def make_folder(place: Path) -> Path:
    """Make the folder of this state in a cache folder; if it is new, delete the oldest of the others."""
    folder = place / FOLDER
    if folder.exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    # Another process may delete folders at the same time.
    with suppress(OSError):
        others = [each for each in place.glob(_PREFIX + "*") if each != folder]
        for outdated in sorted(others, key=lambda each: -each.stat().st_mtime)[STATES_KEPT - 1 :]:
            shutil.rmtree(outdated, ignore_errors=True)
    return folder
