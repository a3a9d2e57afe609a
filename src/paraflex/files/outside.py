"""Permission for models to read files outside their folders, withheld by default because a model may be untrusted."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from paraflex.contexts import holding
from paraflex.errors import InputError

_allowed: ContextVar[bool] = ContextVar("allowed", default=False)


@contextmanager
def allowing_outside() -> Iterator[None]:
    """Allow models that are read inside the context to name tables outside their folders, as --allow-outside does."""
    with holding(_allowed, True):
        yield


def may_be_outside() -> bool:
    """Check whether models that are read now may name tables outside their folders."""
    return _allowed.get()


def check_outside(folder: Path, name: str, field: str) -> None:
    """Check that a file named by a model lies in the model's folder, with links resolved, or may lie elsewhere.

    Raises
    ------
    InputError
        File outside the folder without permission.
    """
    if not may_be_outside() and is_outside(folder, name):
        raise InputError(
            "lies outside the folder of the model", field=field, value=name,
            remedy="copy it there, or use --allow-outside (in Python: `with pf.allowing_outside()`)",
        )  # fmt: skip


def is_outside(folder: Path, name: str) -> bool:
    """Check whether a file lies outside a folder, with links resolved."""
    return not (folder / name).resolve().is_relative_to(folder.resolve())
