"""How kernels are compiled: cached on disk, without the GIL, free to reorder sums."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numba import njit

# Sums may be reordered and fused for vector units; NaN and infinities keep their meaning, failures rest on them.
FAST_MATH = {"reassoc", "contract", "arcp", "nsz"}

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": FAST_MATH}

kernel = njit(**_OPTIONS)
# For what is called once a body in a hot loop: passing the packed system, some seventy machine words, costs as much
# as the arithmetic. Not for more, because every copy is compiled again.
inlined = njit(forceinline=True, **_OPTIONS)


def is_compiled(function: Any) -> bool:
    """Whether a kernel has been compiled before and stands in the cache on disk."""
    return any(Path(function.stats.cache_path).glob(f"*{function.py_func.__name__}-*.nbc"))
