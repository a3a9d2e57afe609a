"""Methods of integration: frozen objects that check their parameters and have all properties that runs need."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, ClassVar

from paraflex.arguments import CheckedFields, given_as
from paraflex.errors import InputError
from paraflex.kernel.run_state import Tableau


class Family(Enum):
    """Family of a method, by the code that runs it."""

    ESDIRK = "esdirk"
    NEWMARK = "newmark"
    SCIPY = "scipy"
    SUNDIALS = "sundials"


class Treatment(Enum):
    """Treatment of the constraints."""

    BAUMGARTE = "baumgarte"
    PROJECTION = "projection"
    GGL = "ggl"
    POSITION = "position"


INDEX_1, ODE, INDEX_3 = "index 1 (Eqs. 56-57)", "ODE (Eqs. 59-60)", "index 3 (Eq. 54)"


@dataclass(frozen=True)
class Parameter:
    """A parameter of a method: its default, the range in which the method is stable, its meaning."""

    default: float
    low: float
    high: float
    meaning: str


def parameter(default: float, low: float, high: float, meaning: str, *, follows: bool = False) -> Any:
    """A field for a parameter; None means that it follows from other parameters.

    A parameter whose default is an `int` is a whole number.
    """
    return field(default=None if follows else default, metadata={"is": Parameter(default, low, high, meaning)})


@dataclass(frozen=True)
class Method(CheckedFields, ABC):
    """A method of integration; the fields of its dataclass are its parameters.

    Attributes
    ----------
    name : str
        What users write.
    title : str
        For figures and tables.
    family : Family
    form : str
        The equations it integrates.
    order : int
        Of positions, velocities and multipliers; with the default parameters.
    treatments : tuple of Treatment
        Of the constraints, the default first.
    source : str
    fixed_step, error_control : bool
        Whether it takes a step from the user; whether it chooses steps by its errors.
    multistep : bool
        Whether it changes its order on the way.
    stability_limit : float or None
        Of an explicit method, how far on the imaginary axis it is stable, |omega h|.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    family: ClassVar[Family]
    form: ClassVar[str]
    order: ClassVar[int]
    treatments: ClassVar[tuple[Treatment, ...]]
    source: ClassVar[str]
    fixed_step: ClassVar[bool] = False
    error_control: ClassVar[bool] = True
    multistep: ClassVar[bool] = False
    stability_limit: ClassVar[float | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, one in self.parameters.items():
            value = getattr(self, name)
            if value is None:
                continue
            if not one.low <= value <= one.high:
                raise InputError(
                    f"outside the range in which {self} is stable", field=name, value=value,
                    remedy=f"choose it from {one.low:.6g} to {one.high:.6g} ({one.meaning})",
                )  # fmt: skip
            object.__setattr__(self, name, type(one.default)(value))

    def __str__(self) -> str:
        return self.name

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Parameters by name."""
        return {each.name: each.metadata["is"] for each in fields(self)}

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters."""
        return {name: getattr(self, name) for name in self.parameters}

    @property
    def explicit(self) -> bool:
        """Whether the method is explicit, so that stiffness limits its steps."""
        return self.stability_limit is not None

    @property
    def highest_order(self) -> int:
        """The highest order of a multistep method."""
        return int(self.values.get("max_order", self.order))


given_as("a method of integration", 'its name, such as "tr-bdf2", or an object of paraflex.methods')(Method | str)


class NativeMethod(Method):
    """A method of the compiled kernels.

    Attributes
    ----------
    newton_fraction : float
        The part of the error allowed in a step that Newton's iteration may leave by default. An estimate of high order
        takes for error what Newton leaves in its stages: there a smaller part means far fewer steps.
    """

    fixed_step = True
    newton_fraction: ClassVar[float] = 0.03

    @property
    @abstractmethod
    def scheme(self) -> Tableau:
        """The scheme as the kernel's tableau."""
