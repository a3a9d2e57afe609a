"""All integration methods: `METHODS` lists them, and `find_method` finds them by name.

A method is an object with its own parameters: `GeneralisedAlpha(spectral_radius=0.8)`. Functions that take a method
also take its name, which stands for the method with its default parameters.
"""

from collections.abc import Mapping
from types import MappingProxyType

from paraflex.errors import InputError, suggestion, within
from .external_methods import BDF as BDF, IDA as IDA, NDF as NDF, RK45 as RK45, Adams as Adams, Radau as Radau
from .method import Family as Family, Method as Method, Treatment as Treatment
from .newmark import HHT as HHT, GeneralisedAlpha as GeneralisedAlpha, Newmark as Newmark, Wilson as Wilson
from .tableaux import (
    ESDIRK3 as ESDIRK3,
    ESDIRK4 as ESDIRK4,
    ESDIRK5 as ESDIRK5,
    TRBDF2 as TRBDF2,
    Trapezoidal as Trapezoidal,
)

_ALL: tuple[type[Method], ...] = (
    TRBDF2,
    Trapezoidal,
    ESDIRK3,
    ESDIRK4,
    ESDIRK5,
    Newmark,
    Wilson,
    HHT,
    GeneralisedAlpha,
    RK45,
    Radau,
    NDF,
    Adams,
    BDF,
    IDA,
)
# All methods with their default parameters.
METHODS: Mapping[str, Method] = MappingProxyType({kind.name: kind() for kind in _ALL})
DEFAULT_METHOD = ESDIRK5.name


def find_method(given: str | Method, parameters: Mapping[str, float] | None = None) -> Method:
    """Return a method by its name, or the given method itself.

    With parameters, as files and commands give them, the result is a new method of that kind.

    Raises
    ------
    InputError
        There is no method of that name (the known ones are listed), or it does not take these parameters.
    """
    if isinstance(given, Method):
        found = given
    elif isinstance(given, str) and given in METHODS:
        found = METHODS[given]
    else:
        near = suggestion(given, METHODS)
        known = f"choose from {', '.join(METHODS)}"
        remedy = known if near == known else f"{near} Otherwise {known}"
        raise InputError("unknown method", field="method", value=given, remedy=remedy)
    for name in parameters or {}:
        if name not in found.parameters:
            others = ", ".join(other.name for other in METHODS.values() if name in other.parameters)
            raise InputError(
                f"no parameter of {found}", field="parameters", value=name,
                remedy=suggestion(name, found.parameters) + (f"; it is one of {others}" if others else ""),
            )  # fmt: skip
    with within("parameters"):
        return type(found)(**{name: _whole(x) for name, x in parameters.items()}) if parameters else found


def title_of(name: str) -> str:
    """Return the title of a method in figures and tables; its name if it is not listed here."""
    return METHODS[name].title if name in METHODS else name


def _whole(value: float) -> float:
    """Convert a whole number, which a command or a file may write as 2.0, to int."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


class MethodField:
    """Descriptor of a dataclass field that takes a method or its name, and holds the method."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._place = f"_{name}"

    def __get__(self, instance: object, owner: type) -> Method:
        return METHODS[DEFAULT_METHOD] if instance is None else instance.__dict__[self._place]

    def __set__(self, instance: object, value: str | Method) -> None:
        # Dataclasses with this field are frozen: it is set only once.
        instance.__dict__[self._place] = find_method(value)
