"""The mechanisms that come with the package."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable


def _folder() -> Traversable:
    return files("paraflex.mechanism") / "library"


def library_names() -> list[str]:
    """Names of the mechanisms that `load` knows without a file."""
    return sorted(entry.name.removesuffix(".toml") for entry in _folder().iterdir() if entry.name.endswith(".toml"))


def library_file(name: str) -> Traversable:
    """The file of a library mechanism, to read or copy."""
    return _folder() / f"{name}.toml"
