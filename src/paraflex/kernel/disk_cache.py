"""Cache of kernels on disk: machine code of one state of the sources, made by one compiler.

Numba looks at the file of a cached kernel, not at those of the kernels it calls. So each state of all kernels, of
Numba, llvmlite and NumPy has a folder of its own, and what was compiled from another cannot be loaded.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from paraflex.kernel.plain import STATE

# States kept in one place: a checkout may be used by several environments, a cache in a home by several machines.
STATES_KEPT = 3

_PREFIX = "paraflex-kernels-"

FOLDER = _PREFIX + STATE


class KernelCache(FunctionCache):
    """Numba's cache of a function, in a folder of this state of all kernels."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._place = Path(self._cache_path)
        self._cache_path = str(self._place / FOLDER)
        # The function may stand in a file of somebody else's.
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, stamp)

    def _save_overload(self, sig: Any, data: Any) -> None:
        make_folder(self._place)
        super()._save_overload(sig, data)


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
