"""Cache of kernels on disk: machine code of one state of the sources, made by one compiler.

Numba looks at the file of a cached kernel, not at those of the kernels it calls. So each state of all kernels, of
Numba, llvmlite and NumPy has a folder of its own, and what was compiled from another cannot be loaded. Files are
pickles of machine code, which nothing should read that is not as it was written: each begins with a digest of the rest.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from paraflex.kernel.notice import announce_damage, announce_no_room
from paraflex.kernel.plain import STATE

# States kept in one place: a checkout may be used by several environments, a cache in a home by several machines.
STATES_KEPT = 3

_PREFIX = "paraflex-kernels-"

FOLDER = _PREFIX + STATE


class _Sealed(IndexDataCacheFile):
    """One file for each signature of a kernel, without Numba's index: two processes may compile at once.

    With an index both could name different code alike. Damaged files are compiled anew.
    """

    def save(self, key: Any, data: Any) -> None:
        self._seal(self._file(key), (self._source_stamp, key, data))

    def load(self, key: Any) -> Any:
        # The function may have been edited: those of others have no state of their own.
        found = self._unsealed(self._file(key))
        return found[2] if found is not None and found[:2] == (self._source_stamp, key) else None

    def _file(self, key: Any) -> str:
        return str(Path(self._index_path).with_suffix(f".{_digest(repr(key).encode()).hex()}.nbc"))

    def _seal(self, file: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(file) as opened:
            opened.write(_digest(content) + content)

    def _unsealed(self, file: str) -> Any:
        """What a file holds, or None; one that is damaged is removed."""
        try:
            content = Path(file).read_bytes()
        except FileNotFoundError:
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
    """Numba's cache of a function, in a folder of this state of all kernels."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._place = Path(self._cache_path)
        self._cache_path = str(self._place / FOLDER)
        # The function may stand in a file of somebody else's.
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Sealed(self._cache_path, self._impl.filename_base, stamp)

    def _save_overload(self, sig: Any, data: Any) -> None:
        try:
            make_folder(self._place)
            super()._save_overload(sig, data)
        except OSError as error:
            announce_no_room(self._place, error)


def make_folder(place: Path) -> Path:
    """Make the folder of this state in a cache folder; if it is new, delete the oldest of the others."""
    folder = place / FOLDER
    if folder.exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    # Another process may be doing the same.
    with suppress(OSError):
        others = [each for each in place.glob(_PREFIX + "*") if each != folder]
        for outdated in sorted(others, key=lambda each: -each.stat().st_mtime)[STATES_KEPT - 1 :]:
            shutil.rmtree(outdated, ignore_errors=True)
    return folder
