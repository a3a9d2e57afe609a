"""Decorators that compile kernels: cached on disk, free to reorder sums, with or without own changes to Numba."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from types import FunctionType
from typing import Any

from numba import types
from numba.extending import typeof_impl

from .plain import PLAIN

if PLAIN:
    from .plain import by_reference, compiled
else:
    from .machine_code import compiled
    from .records import by_reference

__all__ = ["FAST_MATH", "Kernel", "by_reference", "inlined", "kernel", "releases_lock", "routine", "unoptimised"]

# Sums may be reordered and fused for vector units. NaN and infinities keep their meaning, as they indicate failures.
FAST_MATH = {"reassoc", "contract", "arcp", "nsz"}

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": FAST_MATH}

# Options that leave out the entry point for Python.
_INNER: dict[str, Any] = {"no_cpython_wrapper": True}


class Routine:
    """Function that only kernels call, compiled with the first kernel that calls it.

    Numba takes longer to prepare a function for compiling than to load a kernel, and most kernels come from the cache.

    Attributes
    ----------
    py_func : function
        Undecorated Python function.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        assert isinstance(function, FunctionType)
        update_wrapper(self, function)  # pyright: ignore[reportArgumentType]
        self.py_func: Any = function
        self._options = options

    @cached_property
    def inner(self) -> Any:
        """Numba's dispatcher of the version that kernels call."""
        return compiled(self.py_func, **_OPTIONS, **_INNER, **self._options)

    @property
    def signatures(self) -> list[Any]:
        """Signatures for which the function has been compiled."""
        return list(self.inner.signatures)


def routine(function: Callable[..., Any]) -> Any:
    """Return a routine made of a function; type checkers see any function."""
    return Routine(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Return a routine made of a function that kernels call once per body in an inner loop, and that is inlined."""
    return Routine(function, forceinline=True)


class Kernel(Routine):
    """Function for Python and for other kernels, compiled for each at its first call."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(function)
        self._own = options

    @cached_property
    def from_python(self) -> Any:
        """Numba's dispatcher of the version that Python calls."""
        function = self.py_func
        entry = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__)
        # The cache identifies the function by this name.
        entry.__qualname__, entry.__module__ = f"{vars(self)['__qualname__']}_from_python", function.__module__
        return compiled(entry, **_OPTIONS, **self._own)

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel from Python."""
        return self.from_python(*arguments)

    @property
    def signatures(self) -> list[Any]:
        """Signatures for which the kernel has been compiled."""
        return [*self.from_python.signatures, *super().signatures]

    @property
    def cache_path(self) -> str:
        """Folder of the cached machine code."""
        return str(self.from_python.stats.cache_path)


@typeof_impl.register(Routine)
def _inner(value: Routine, _: object) -> types.Dispatcher:
    return types.Dispatcher(value.inner)


def kernel(function: Callable[..., Any]) -> Kernel:
    """Return a kernel made of a function."""
    return Kernel(function)


def releases_lock(function: Callable[..., Any]) -> Kernel:
    """Return a kernel made of a long-running function, which releases the interpreter lock while it runs.

    A short function should keep the lock, as it would have to wait for other threads to get it back.
    """
    return Kernel(function, nogil=True)


def unoptimised(function: Callable[..., Any]) -> Kernel:
    """Return a kernel made of a function that Python calls a few times per run: fast to compile, but slower.

    Compiling takes half the time.
    """
    return Kernel(function, quick=True)
