"""Messages that explain why a run takes long: kernels are being compiled, or compiled again.

They go through Python's logging, under the name "paraflex": to standard error where logging is not configured, and
nowhere after `logging.getLogger("paraflex").setLevel("ERROR")`. Each is issued once per process.
"""

import logging
import multiprocessing
from collections.abc import Callable
from pathlib import Path

NOTICE = "paraflex: compiling kernels, once after an installation, for each kind of model; this may take half a minute"
LOG = logging.getLogger("paraflex")

_announced: set[str] = set()


def announce_compiling(say: Callable[[str], None] | None = None) -> None:
    """Report that kernels are being compiled.

    Parameters
    ----------
    say : callable, optional
        Function called with the message. By default it is logged as a warning, as Python does not show lower levels.
    """
    _announce("compiling", NOTICE, say or LOG.warning)


def announce_damage(file: Path) -> None:
    """Report that a file of compiled kernels is damaged; worker processes may report it as well."""
    if not {"compiling", "damage"} & _announced:
        _announced.update(("compiling", "damage"))
        LOG.warning("paraflex: a compiled kernel is damaged and compiled anew (%s)", file)


def announce_disk_full(place: Path, error: OSError) -> None:
    """Report that compiled kernels could not be saved."""
    reason = (error.strerror or str(error)).lower()
    line = f"paraflex: compiled kernels cannot be kept in {place} ({reason}): the next process compiles anew"
    _announce("room", line, LOG.warning)


def _announce(what: str, line: str, say: Callable[[str], None]) -> None:
    """Issue a message once per process, and only in the parent process."""
    if what in _announced or multiprocessing.parent_process() is not None:
        return
    _announced.add(what)
    say(line)
