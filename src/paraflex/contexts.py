"""Values that hold inside a context, in the thread or task that enters it."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def holding(variable: ContextVar[T], value: T) -> Iterator[None]:
    """Provide a context in which a variable has a value; after it the variable has the one before."""
    before = variable.set(value)
    try:
        yield
    finally:
        variable.reset(before)
