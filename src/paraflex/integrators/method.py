"""Integration methods: frozen objects that check their parameters and have all properties that runs need."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, ClassVar

from paraflex.arguments import CheckedFields, named_in_errors
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


EQUATIONS_INDEX_1, EQUATIONS_ODE, EQUATIONS_INDEX_3 = (
    "index 1 (Eqs. 56-57)",
    "ODE (Eqs. 59-60)",
    "index 3 (Eq. 54)",
)


@dataclass(frozen=True)
class Parameter:
    """Parameter of a method: its default, the range in which the method is stable, its meaning."""

    default: float
    low: float
    high: float
    meaning: str


def parameter(default: float, low: float, high: float, meaning: str, *, follows: bool = False) -> Any:
    """Return a dataclass field for a parameter; its value None means that it follows from other parameters.

    A parameter whose default is an `int` is a whole number.
    """
    return field(default=None if follows else default, metadata={"is": Parameter(default, low, high, meaning)})


@dataclass(frozen=True)
class Method(CheckedFields, ABC):
    """Integration method; the fields of its dataclass are its parameters.

    Attributes
    ----------
    name : str
        Name by which users select the method.
    title : str
        Title in figures and tables.
    family : Family
        Family of the method.
    form : str
        Form of the equations that it integrates.
    order : int
        Order of positions, velocities and multipliers with the default parameters.
    treatments : tuple of Treatment
        Treatments of the constraints, the default first.
    source : str
        Reference to the literature.
    fixed_step, error_control : bool
        Whether the user can fix the step size; whether the step size is controlled by the error.
    multistep : bool
        Whether the order changes during a run.
    stability_limit : float or None
        Largest |omega h| on the imaginary axis for which an explicit method is stable; None for implicit methods.
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
        """Highest order of a multistep method."""
        return int(self.values.get("max_order", self.order))


named_in_errors("a method of integration", 'its name, such as "tr-bdf2", or an object of paraflex.methods')(
    Method | str
)


class NativeMethod(Method):
    """Method of the compiled kernels.

    Attributes
    ----------
    newton_fraction, fixed_newton_fraction : float
        Default part of the error allowed in a step that Newton's iteration may leave, if the error is controlled and in
        fixed steps. An error estimate of high order contains the residual of Newton's iteration in the stages: too
        large a part costs steps.
    """

    fixed_step = True
    newton_fraction: ClassVar[float] = 0.03
    fixed_newton_fraction: ClassVar[float] = 0.03

    @property
    @abstractmethod
    def scheme(self) -> Tableau:
        """Scheme as the kernel's tableau."""
