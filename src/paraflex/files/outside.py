"""Files outside the folder of a model, which it may name only by permission: a model may come from anyone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from paraflex.errors import InputError

_allowed: ContextVar[bool] = ContextVar("allowed", default=False)


@contextmanager
def allowing_outside() -> Iterator[None]:
    """Let models that are read meanwhile name tables outside their folders, as --allow-outside does."""
    before = _allowed.set(True)
    try:
        yield
    finally:
        _allowed.reset(before)


def may_be_outside() -> bool:
    """Whether models that are read now may name tables outside their folders."""
    return _allowed.get()


def check_outside(folder: Path, name: str, field: str) -> None:
    """Check that a file that a model names lies in the model's folder, wherever links lead, or may lie elsewhere.

    Raises
    ------
    InputError
        It lies elsewhere, and nobody said that it may.
    """
    if not may_be_outside() and is_outside(folder, name):
        raise InputError(
            "lies outside the folder of the model", field=field, value=name,
            remedy="copy it there, or say --allow-outside (in Python: `with pf.allowing_outside()`)",
        )  # fmt: skip


def is_outside(folder: Path, name: str) -> bool:
    """Whether a file lies outside a folder."""
    return not (folder / name).resolve().is_relative_to(folder.resolve())
