"""The lines that say why a run takes long: kernels are being compiled, and why again.

They go through Python's logging, under the name "paraflex": to standard error where nobody has set logging up, and
nowhere after `logging.getLogger("paraflex").setLevel("ERROR")`. Each is said once a process.
"""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Callable
from pathlib import Path

NOTICE = "paraflex: compiling kernels, once after an installation, for each kind of model; this may take half a minute"
LOG = logging.getLogger("paraflex")

_announced: set[str] = set()


def announce_compiling(say: Callable[[str], None] | None = None) -> None:
    """Say that kernels are compiled.

    Parameters
    ----------
    say : callable, optional
        Called with the line; it is logged by default, as a warning: what is less urgent Python shows nobody.
    """
    _announce("compiling", NOTICE, say or LOG.warning)


def announce_damage(file: Path) -> None:
    """Say that a file of compiled kernels is not as it was written; worker processes may find one, too."""
    if not {"compiling", "damage"} & _announced:
        _announced.update(("compiling", "damage"))
        LOG.warning("paraflex: a compiled kernel is damaged and compiled anew (%s)", file)


def announce_no_room(place: Path, error: OSError) -> None:
    """Say that what was compiled could not be kept."""
    reason = (error.strerror or str(error)).lower()
    line = f"paraflex: compiled kernels cannot be kept in {place} ({reason}): the next process compiles anew"
    _announce("room", line, LOG.warning)


def _announce(what: str, line: str, say: Callable[[str], None]) -> None:
    """Worker processes leave it to the one that started them."""
    if what in _announced or multiprocessing.parent_process() is not None:
        return
    _announced.add(what)
    say(line)
