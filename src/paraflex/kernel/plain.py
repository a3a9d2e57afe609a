"""Kernels compiled by plain Numba: slower to compile, with the same results except for rounding.

The changes to Numba (`machine_code`, `passes`, `records`, `disk_cache`) use internal interfaces, which may change. None
of them is loaded if the environment variable `PARAFLEX_PLAIN_NUMBA` is 1, or with an untested release of Numba, unless
the variable is 0.
"""

import multiprocessing
import os
from collections.abc import Callable, MutableMapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

from .notice import LOG

VARIABLE = "PARAFLEX_PLAIN_NUMBA"
# First and last release that the changes are tested with; with earlier releases no kernel compiles.
TESTED = ("0.62", "0.68")


def choose(release: str, environment: MutableMapping[str, str] = os.environ) -> bool:
    """Return whether kernels are compiled by plain Numba; the parent process reports an untested release once."""
    if not environment.get(VARIABLE):
        if _numbers(TESTED[0]) <= _numbers(release) <= _numbers(TESTED[1]):
            return False
        environment[VARIABLE] = "1"
        if multiprocessing.parent_process() is None:
            tested = f"tested with Numba {TESTED[0]} to {TESTED[1]}, not with {release}"
            LOG.warning("paraflex: %s: kernels are compiled without its own changes, which takes longer", tested)
    return environment[VARIABLE] != "0"


def _numbers(release: str) -> tuple[int, ...]:
    return tuple(int(part) for part in release.split(".")[:2])


def state_of_kernels() -> str:
    """Return the digest of everything that machine code depends on, except the processor, which Numba checks."""
    digest = sha256(f"{numba.__version__} {llvmlite.__version__} {np.__version__}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(sha256(source.read_bytes()).digest())
    return digest.hexdigest()[:16]


# Computed at import: this process does not compile sources that are edited later.
STATE = state_of_kernels()
PLAIN = choose(numba.__version__)
# Folder of compiled kernels of this state in a wheel that has them.
SUPPLIED = Path(__file__).parent / "compiled" / STATE


def compiled(function: Callable[..., Any], *, nogil: bool = False, **options: Any) -> Any:
    """Return a function compiled by plain Numba; options of paraflex's own compiler are ignored."""
    # The cache identifies the function by this name, and does not check the sources of other functions.
    function.__qualname__ = f"{function.__qualname__}_{STATE}"
    chosen = {name: options[name] for name in ("error_model", "fastmath")}
    return numba.njit(cache=True, nogil=nogil, **chosen)(function)


def by_reference(record: type) -> type:
    """Return the named tuple unchanged: plain Numba passes it as its fields."""
    return record
