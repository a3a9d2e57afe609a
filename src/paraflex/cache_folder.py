"""Fallback folder for compiled kernels, used if Numba can write neither beside the sources nor in the user's cache.

Numba tries the folder of the sources and the user's cache folder, or only NUMBA_CACHE_DIR if that is set. If it can
write to none of them, kernels cannot be imported: a read-only installation, run by a user without a home folder.
"""

import os
import sys
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def ensure_cache_folder(sources: Path, environment: MutableMapping[str, str] = os.environ) -> None:
    """Set NUMBA_CACHE_DIR if Numba would find no writable cache folder; call this before Numba is imported.

    Parameters
    ----------
    sources : Path
        Folder of the kernel sources.
    environment : mapping
        Environment variables, changed in place; by default those of the process.
    """
    if not hasattr(os, "getuid"):
        return
    if named := environment.get(VARIABLE):
        if _can_write(Path(named)):
            return
        # Child processes inherit the change and do not repeat the warning.
        del environment[VARIABLE]
        _warn(f"{VARIABLE}={named} cannot be written: compiled kernels are kept elsewhere")
    if not any(_can_write(folder) for folder in (sources / "__pycache__", _users(environment))):
        environment[VARIABLE] = str(_own_folder())


def _users(environment: MutableMapping[str, str]) -> Path:
    """Return the folder of Numba's cache for this user."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "numba"
    return Path(environment.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "numba"


def _can_write(folder: Path) -> bool:
    """Check whether files can be created in a folder, or the folder itself can be created."""
    try:
        existing = next((place for place in (folder, *folder.parents) if place.exists()), None)
        return existing is not None and existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
    except PermissionError:
        return False


def _warn(text: str) -> None:
    import logging

    logging.getLogger("paraflex").warning("paraflex: %s", text)


def _own_folder() -> Path:
    """Return a temporary folder that only this user can write to, because the contents of a cache are executed."""
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
    # The folder belongs to another user: kernels are compiled anew in every process.
    return Path(tempfile.mkdtemp(prefix="paraflex-kernels-"))
