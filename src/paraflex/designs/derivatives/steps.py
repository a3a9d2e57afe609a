"""Complex steps: the model and settings of a design with i h times its derivative added to every number.

Numbers of a mechanism are products and quotients of a few numbers and expressions in its file. Differences of eighth
order over about a hundredth of their size are exact to rounding. Functions evaluated with these complex numbers have i
h times their own derivatives as imaginary parts, without cancellation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from paraflex.arguments import with_fields
from paraflex.arrays import Array, Numbers
from paraflex.errors import InputError
from .stencil import Stencil

T = TypeVar("T")

# Step h: its square is negligible against one, and no power that occurs underflows.
COMPLEX_STEP = 1e-40


@dataclass(frozen=True)
class Stepped(Generic[T]):
    """Description with a complex step, and the largest relative error of the derivatives by differences."""

    value: T
    error: float


def part(values: Any) -> Array:
    """Return the derivative of numbers with a complex step, zero for real ones."""
    return np.imag(values) / COMPLEX_STEP


def stepped(values: Array, derivative: Array) -> Numbers:
    """Return numbers with a complex step along a derivative."""
    return values + 1j * COMPLEX_STEP * derivative


def another_layout(field: str = "vary") -> InputError:
    """Return the error for a parameter that changes more than the numbers of a description."""
    problem = "the number of pieces or elements changes with it: no derivative"
    return InputError(problem, field=field, remedy="choose a slightly different value with --at")


def complex_step(here: T, near: Sequence[T], stencil: Stencil) -> Stepped[T]:
    """Return a description with a complex step.

    Parameters
    ----------
    here : Any
        Description of dataclasses, mappings, sequences, arrays and numbers; other objects are unchanged.
    near : sequence
        Descriptions of the designs at the points of the stencil.
    stencil : Stencil
        Difference formula.

    Raises
    ------
    InputError
        The descriptions differ in more than numbers.
    """
    walk = _Walk(stencil)
    value = walk.step(here, list(near))
    return Stepped(value, walk.error)


class _Walk:
    """Simultaneous traversal of a description and of those at the points of the stencil."""

    def __init__(self, stencil: Stencil) -> None:
        self.stencil, self.error = stencil, 0.0

    def step(self, here: Any, near: list[Any]) -> Any:
        if isinstance(here, bool | np.bool_ | str | type) or here is None:
            return here
        if isinstance(here, int | float | np.integer | np.floating):
            return self.number(here, near)
        if any(type(each) is not type(here) for each in near):
            raise another_layout()
        if isinstance(here, np.ndarray):
            return self.array(here, near)
        if isinstance(here, Mapping):
            return self.mapping(here, near)
        if isinstance(here, tuple | list):
            return self.sequence(here, near)
        return self.record(here, near) if is_dataclass(here) else here

    def number(self, here: Any, near: list[Any]) -> Any:
        if all(each == here for each in near):
            return here
        found = self.stencil.derivative([np.array(each, dtype=float) for each in near])
        self.error = max(self.error, float(found.error / max(abs(found.value), abs(here))))
        return np.complex128(complex(here, COMPLEX_STEP * float(found.value)))

    def array(self, here: Numbers, near: list[Numbers]) -> Numbers:
        if here.dtype.kind != "f" or all(np.array_equal(each, here) for each in near):
            return here
        return stepped(here, self.stencil.derivative(near).value)

    def mapping(self, here: Mapping, near: list[Mapping]) -> Mapping:
        new = {key: self.step(value, [each[key] for each in near]) for key, value in here.items()}
        return here if all(new[key] is here[key] for key in here) else new

    def sequence(self, here: Any, near: list[Any]) -> Any:
        if any(len(each) != len(here) for each in near):
            raise another_layout()
        new = [self.step(value, list(others)) for value, *others in zip(here, *near, strict=True)]
        if all(a is b for a, b in zip(new, here, strict=True)):
            return here
        return type(here)(*new) if hasattr(here, "_fields") else type(here)(new)

    def record(self, here: Any, near: list[Any]) -> Any:
        changes = {
            each.name: self.step(getattr(here, each.name), [getattr(other, each.name) for other in near])
            for each in fields(here)
        }
        if all(value is getattr(here, name) for name, value in changes.items()):
            return here
        return with_fields(here, **changes)
