"""Python programs that make the mechanism of a model by the public interface."""

import keyword
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import paraflex
from paraflex.errors import InputError, printable
from paraflex.files import ExpressionProfile, Model
from paraflex.mechanism import Material, PointRef, Polynomial, Rectangle, Round, Section, Shape, Sine, Tube
from .computing import model_of

# Width of a line, and classes that are imported from their module because `paraflex` does not list them.
_WIDTH = 110
_ELSEWHERE = {ExpressionProfile: "paraflex.files", Sine: "paraflex.mechanism", Polynomial: "paraflex.mechanism"}
# Functions of `Section` by the shape that they take.
_SHAPES: Mapping[type[Shape], str] = {Rectangle: "rectangle", Round: "round", Tube: "tube"}
# Names that the program itself uses.
_TAKEN = {"pf", "point", "mechanism", *(kind.__name__ for kind in _ELSEWHERE)}


def program(text: str, folder: Path | None = None, source: str = "model") -> str:
    """Return a Python program that makes the mechanism of a model's text, equal to that of `load`.

    Parameters of the file are in it as numbers in SI units. Sections and materials of several bodies are variables with
    their names in the file.

    Raises
    ------
    InputError
        A text that is not a model, or a member that no program can hold.
    """
    model = model_of(text, folder, source)
    writer, mechanism = _Writer(_shared(model)), model.mechanism
    shared = "".join(f"{name} = {writer.call(one)}\n" for one, name in writer.names.items())
    whole = f"point = pf.PointRef.parse\n{shared}\nmechanism = {writer.value(mechanism)}\n"
    imports = "".join(f"from {module} import {name}\n" for module, name in sorted(writer.imports))
    title = printable(" ".join(f"{mechanism.name}. {mechanism.description}".split()))
    return f"# {title}\nimport paraflex as pf\n{imports}\n{whole}"


def _shared(model: Model) -> dict[Any, str]:
    """Return the names of variables by section or material, named as in the file."""
    bodies: Mapping[str, Any] = model.parameters.get("body", {})
    found: dict[Any, str] = {}
    for body in model.mechanism.bodies:
        for field in ("section", "material"):
            given, name = getattr(body, field, None), bodies.get(body.name, {}).get(field)
            if isinstance(given, Section | Material) and isinstance(name, str) and given not in found:
                found[given] = _variable(name, {*found.values(), *_TAKEN})
    return found


def _variable(name: str, taken: set[str]) -> str:
    """Return a name of Python for a name of the file."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
    word = f"_{word}" if word[0].isdigit() or keyword.iskeyword(word) else word
    while word in taken:
        word += "_"
    return word


class _Writer:
    """Writer of values as expressions of Python, which notes what they import."""

    def __init__(self, names: dict[Any, str]) -> None:
        self.names = names
        self.imports: set[tuple[str, str]] = set()

    def value(self, given: Any, depth: int = 0) -> str:
        """Return the expression of a value, on several lines if it is long."""
        if isinstance(given, Section | Material) and given in self.names:
            return self.names[given]
        if isinstance(given, PointRef):
            return f"point({_quoted(str(given))})"
        if isinstance(given, Enum):
            return _quoted(given.value)
        if isinstance(given, Mapping):
            pairs = [f"{self.value(key)}: {self.value(one, depth + 1)}" for key, one in given.items()]
            return _wrapped("{", pairs, "}", depth)
        if isinstance(given, tuple | list):
            return _wrapped("(", [self.value(one, depth + 1) for one in given], ",)" if len(given) == 1 else ")", depth)
        if is_dataclass(given):
            return self.call(given, depth)
        return _plain(given)

    def call(self, given: Any, depth: int = 0) -> str:
        """Return the call that makes a dataclass."""
        if isinstance(given, Section) and given.shape is not None and given == Section.of(given.shape):
            return _wrapped(
                f"pf.Section.{_SHAPES[type(given.shape)]}(", self._arguments(given.shape, depth), ")", depth
            )
        name, module = type(given).__name__, _ELSEWHERE.get(type(given))
        if module is not None:
            self.imports.add((module, name))
        elif getattr(paraflex, name, None) is not type(given):
            raise InputError("no program can hold it", field="program", value=name, remedy="save the model's file")
        return _wrapped(f"{'' if module else 'pf.'}{name}(", self._arguments(given, depth), ")", depth)

    def _arguments(self, given: Any, depth: int) -> list[str]:
        return [f"{name}={self.value(value, depth + 1)}" for name, value in _given(given)]


def _given(given: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a dataclass that are not at their defaults."""
    for one in fields(given):
        value = getattr(given, one.name)
        default = one.default if one.default_factory is MISSING else one.default_factory()
        # Fields of the file are named in errors only.
        of_file = one.name == "field" and not one.compare
        if one.init and not of_file and (default is MISSING or type(value) is not type(default) or value != default):
            yield one.name, value


def _plain(given: Any) -> str:
    """Return a number, text, truth value or None as Python writes it."""
    if isinstance(given, float) and not math.isfinite(given):
        return f'float("{given}")'
    if isinstance(given, str):
        return _quoted(given)
    if given is None or isinstance(given, bool | int | float):
        return repr(given)
    raise InputError("no program can hold it", field="program", value=given, remedy="save the model's file")


def _quoted(text: str) -> str:
    """Return a text in double quotes where none are in it."""
    written = repr(text)
    return f'"{written[1:-1]}"' if written[0] == "'" and '"' not in written else written


def _wrapped(opening: str, parts: list[str], closing: str, depth: int) -> str:
    """Join parts on one line, or on one line each if they are long."""
    line = f"{opening}{', '.join(parts)}{closing}"
    if len(line) + 4 * depth <= _WIDTH and "\n" not in line:
        return line
    inner = "".join(f"{'    ' * (depth + 1)}{part},\n" for part in parts)
    return f"{opening}\n{inner}{'    ' * depth}{closing[-1]}"
