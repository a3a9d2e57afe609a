"""How kernels are compiled: cached on disk, without the GIL, free to reorder sums."""

from __future__ import annotations

from numba import njit

# Sums may be reordered and fused for vector units; NaN and infinities keep their meaning, failures rest on them.
FAST_MATH = {"reassoc", "contract", "arcp", "nsz"}

kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST_MATH)
