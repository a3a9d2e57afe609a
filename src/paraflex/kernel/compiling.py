"""How kernels are compiled: cached on disk, free to reorder sums, and without counting references.

Numba counts the references to every array that a local name stands for, one field of a workspace and all of its others
with it, by atomic operations that cost more than the arithmetic. Kernels make no arrays: their caller owns them all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from types import FunctionType
from typing import Any

from numba import njit, types
from numba.extending import typeof_impl

from paraflex.kernel.disk_cache import KernelCache
from paraflex.kernel.machine_code import QuickCode, SeparateCode

# Sums may be reordered and fused for vector units; NaN and infinities keep their meaning, failures rest on them.
FAST_MATH = {"reassoc", "contract", "arcp", "nsz"}

_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": FAST_MATH,
    "no_cfunc_wrapper": True,
    "pipeline_class": SeparateCode,
    "_nrt": False,
}

# Without the entry from Python.
_INNER: dict[str, Any] = {"no_cpython_wrapper": True}


class _Cache:
    """Where a kernel is kept on disk, looked for when it is first asked for.

    What is found there is loaded without all that Numba declares for compiling, which takes longer than loading.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def _on_disk(self) -> Any:
        return KernelCache(self._function)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What has been compiled for a signature, or None."""
        with self._on_disk._guard_against_spurious_io_errors():
            return self._on_disk._load_overload(signature, context)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._on_disk, name)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    found: Any = njit(**{**_OPTIONS, **options})(function)
    found._cache = _Cache(function)
    return found


def routine(function: Callable[..., Any]) -> Any:
    """Make what is called from kernels only: called from Python it would crash the process."""
    return _compiled(function, **_INNER)


def inlined(function: Callable[..., Any]) -> Any:
    """Make what is called once a body in a hot loop, from kernels only."""
    return _compiled(function, **_INNER, forceinline=True)


class Kernel:
    """A function that Python calls, and other kernels may: compiled for each when it first does.

    Attributes
    ----------
    from_python, inner : numba dispatchers
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        assert isinstance(function, FunctionType)
        update_wrapper(self, function)
        entry = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__)
        # The cache goes by this name.
        entry.__qualname__, entry.__module__ = f"{function.__qualname__}_from_python", function.__module__
        self.from_python = _compiled(entry, **options)
        self.inner = routine(function)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self.from_python(*arguments)

    @property
    def py_func(self) -> Any:
        """The Python function."""
        return self.inner.py_func

    @property
    def signatures(self) -> list[Any]:
        """What it has been compiled for."""
        return [*self.from_python.signatures, *self.inner.signatures]

    @property
    def cache_path(self) -> str:
        """Where it is cached."""
        return str(self.from_python.stats.cache_path)


@typeof_impl.register(Kernel)
def _inner(value: Kernel, _: object) -> types.Dispatcher:
    return types.Dispatcher(value.inner)


def kernel(function: Callable[..., Any]) -> Kernel:
    """Make a kernel of a function."""
    return Kernel(function)


def lasting(function: Callable[..., Any]) -> Kernel:
    """Make a kernel that lets other threads run meanwhile: of a function that takes long.

    One that soon returns would have to wait for them.
    """
    return Kernel(function, nogil=True)


def seldom(function: Callable[..., Any]) -> Kernel:
    """Make a kernel of what Python calls a few times a run: compiled in half the time, and not fast."""
    return Kernel(function, pipeline_class=QuickCode)
