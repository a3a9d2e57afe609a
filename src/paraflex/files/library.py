"""Library of mechanisms that come with the package."""

import tomllib
from importlib.resources import files
from importlib.resources.abc import Traversable

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, suggestion
from .generators import generated_text, generator_names, is_generated


def _folder() -> Traversable:
    return files("paraflex.mechanism") / "library"


def library_names() -> list[str]:
    """Return the names of the library mechanisms, which `load` reads without a file."""
    return sorted(entry.name.removesuffix(".toml") for entry in _folder().iterdir() if entry.name.endswith(".toml"))


@checked_arguments()
def library_file(name: str) -> Traversable:
    """Return the file of a library mechanism, to read or copy."""
    return _folder() / f"{name}.toml"


@checked_arguments()
def library_text(name: str) -> str:
    """Return the text of the file of a library mechanism, including generated ones ("four_bars:3").

    Raises
    ------
    InputError
        Unknown name, or invalid number of a generated mechanism.
    """
    if is_generated(name):
        return generated_text(name)
    if name not in library_names():
        known = [*library_names(), *generator_names()]
        raise InputError("not a library mechanism", field="mechanism", value=name, remedy=suggestion(name, known))
    return library_file(name).read_text(encoding="utf-8")


def errors_elsewhere(text: str) -> dict[str, dict[str, dict[str, float]]]:
    """Return tracking errors by others for the unchanged file of a library mechanism.

    Parameters
    ----------
    text : str
        Text of a model file.

    Returns
    -------
    dict
        Errors by mode [m], by the name of their source and the geometry with which they compare; empty for any other
        file.
    """
    for entry in (_folder() / "elsewhere").iterdir():
        if (_folder() / entry.name).read_text(encoding="utf-8") == text:
            return tomllib.loads(entry.read_text(encoding="utf-8"))
    return {}
