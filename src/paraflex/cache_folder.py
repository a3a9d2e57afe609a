"""A folder for compiled kernels if Numba finds none: neither beside the sources nor in the user's cache folder.

Numba tries the folder of the sources and the user's cache folder, or NUMBA_CACHE_DIR alone where that is set, and
refuses to import kernels where it may write to none of them: a read-only installation, run by a user without a home.
"""

from __future__ import annotations

import os
import sys
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def ensure_cache_folder(sources: Path, environment: MutableMapping[str, str] = os.environ) -> None:
    """Name a folder in the environment if Numba would find none; to be called before Numba is imported.

    Parameters
    ----------
    sources : Path
        Folder of the kernels.
    environment : mapping
        Changed where a folder is named.
    """
    if not hasattr(os, "getuid"):
        return
    if named := environment.get(VARIABLE):
        if _can_write(Path(named)):
            return
        # Handed on to processes that this one starts, which say nothing then.
        del environment[VARIABLE]
        _warn(f"{VARIABLE}={named} cannot be written: compiled kernels are kept elsewhere")
    if not any(_can_write(folder) for folder in (sources / "__pycache__", _users(environment))):
        environment[VARIABLE] = str(_own_folder())


def _users(environment: MutableMapping[str, str]) -> Path:
    """Folder of Numba's cache for this user."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "numba"
    return Path(environment.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"


def _can_write(folder: Path) -> bool:
    """Whether files can be created in a folder, or the folder itself."""
    existing = next((place for place in (folder, *folder.parents) if place.exists()), None)
    return existing is not None and existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)


def _warn(text: str) -> None:
    import logging

    logging.getLogger("paraflex").warning("paraflex: %s", text)


def _own_folder() -> Path:
    """A folder for temporary files that only this user can write to, as the content of a cache is executed."""
    import tempfile

    user = os.getuid()
    folder = Path(tempfile.gettempdir()) / f"paraflex-kernels-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if folder.is_dir() and not folder.is_symlink() and found.st_uid == user and not found.st_mode & 0o022:
            return folder
    except OSError:
        pass
    # Somebody else's: kernels are compiled anew in every process.
    return Path(tempfile.mkdtemp(prefix="paraflex-kernels-"))
