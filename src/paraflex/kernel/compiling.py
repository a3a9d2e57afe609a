"""How kernels are compiled: cached on disk, without the GIL, free to reorder sums, and without counting references.

Numba counts the references to every array that a local name stands for, one field of a workspace and all of its others
with it, by atomic operations that cost more than the arithmetic. Kernels make no arrays: their caller owns them all.
"""

from __future__ import annotations

from typing import Any

from numba import njit

# Sums may be reordered and fused for vector units; NaN and infinities keep their meaning, failures rest on them.
FAST_MATH = {"reassoc", "contract", "arcp", "nsz"}

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": FAST_MATH,
    "no_cfunc_wrapper": True,
    "_nrt": False,
}

# Without the entry from Python, which takes as long to compile as the function itself.
_INNER_OPTIONS: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True}

_COUNTING_OPTIONS: dict[str, Any] = {**_OPTIONS, "_nrt": True}

# Called from Python.
kernel = njit(**_OPTIONS)
# And makes arrays of its own: not for the time loop.
allocating = njit(**_COUNTING_OPTIONS)
# Called from kernels only: called from Python it would crash the process.
routine = njit(**_INNER_OPTIONS)
# For what is called once a body in a hot loop: passing the packed system, some seventy machine words, costs as much
# as the arithmetic. Not for more, because every copy is compiled again.
inlined = njit(forceinline=True, **_INNER_OPTIONS)
