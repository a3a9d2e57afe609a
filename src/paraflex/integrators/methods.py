"""The methods of integration by name: what each is, what it takes, what it can do. Data only; `integrate` runs them.

A new scheme of a family is a tableau or a set of parameters and one entry here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

from paraflex.errors import InputError, suggestion


class Family(Enum):
    """Who runs a method."""

    ESDIRK = "esdirk"
    NEWMARK = "newmark"
    SCIPY = "scipy"
    SUNDIALS = "sundials"


class Treatment(Enum):
    """What keeps the constraints."""

    BAUMGARTE = "baumgarte"
    PROJECTION = "projection"
    GGL = "ggl"
    POSITION = "position"


@dataclass(frozen=True)
class Parameter:
    """A number that a method takes: its default, the range in which the method is stable, what it does."""

    default: float
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Method:
    """A method of integration.

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
    parameters : mapping of str to Parameter
    fixed_step, error_control : bool
        Whether it takes a step from the user; whether it chooses steps by its errors.
    explicit : bool
        Whether stiffness limits its steps.
    newton_fraction : float
        The part of the error allowed in a step that Newton's iteration may leave by default. An estimate of high order
        takes for error what Newton leaves in its stages: there a smaller part means far fewer steps.
    source : str
    """

    name: str
    title: str
    family: Family
    form: str
    order: int
    treatments: tuple[Treatment, ...]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    fixed_step: bool = False
    error_control: bool = True
    explicit: bool = False
    newton_fraction: float = 0.03
    source: str = ""


_NATIVE = (Treatment.BAUMGARTE, Treatment.PROJECTION, Treatment.GGL)
_ODE = (Treatment.BAUMGARTE,)
_INDEX_1, _ODE_FORM, _INDEX_3 = "index 1 (Eqs. 56-57)", "ODE (Eqs. 59-60)", "index 3 (Eq. 54)"


def _esdirk(name: str, title: str, order: int, source: str) -> Method:
    newton = 0.03 if order == 2 else 1e-3
    return Method(
        name, title, Family.ESDIRK, _INDEX_1, order, _NATIVE, fixed_step=True, newton_fraction=newton, source=source
    )


def _newmark(name: str, title: str, order: int, source: str, treatment: Treatment, **parameters: Parameter) -> Method:
    return Method(
        name, title, Family.NEWMARK, _INDEX_3, order, (treatment,), parameters, fixed_step=True, source=source
    )


def _scipy(name: str, title: str, order: int, source: str, *, explicit: bool = False) -> Method:
    return Method(name, title, Family.SCIPY, _ODE_FORM, order, _ODE, explicit=explicit, source=source)


# Of the backward difference formulas only those of orders 1 and 2 are stable for undamped vibrations of any frequency.
_A_STABLE = Parameter(2.0, 1.0, 5.0, "highest order; above 2 vibrations that hardly decay dictate the step")

_ALL = (
    _esdirk("tr-bdf2", "TR-BDF2", 2, "Hosea and Shampine (1996), Appl. Numer. Math. 20, 21-37"),
    _esdirk("trapezoidal", "Trapezoidal rule", 2, "Hairer and Wanner (1996), Solving ODEs II, IV.3"),
    _esdirk("esdirk3", "ESDIRK 3(2)", 3, "Kennedy and Carpenter (2003), Appl. Numer. Math. 44, 139-181"),
    _esdirk("esdirk4", "ESDIRK 4(3)", 4, "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"),
    _esdirk("esdirk5", "ESDIRK 5(4)", 5, "Kennedy and Carpenter (2019), Appl. Numer. Math. 146, 221-244"),
    _newmark(
        "newmark", "Newmark", 1, "Newmark (1959), J. Eng. Mech. 85, 67-94", Treatment.POSITION,
        gamma=Parameter(0.6, 0.5, 1.0, "velocity weight: 1/2 does not damp, above that the order is 1"),
        beta=Parameter(0.3025, 0.25, 1.0, "position weight, at least (gamma + 1/2)^2 / 4"),
    ),
    _newmark(
        "wilson-theta", "Wilson theta", 2, "Wilson, Farhoomand and Bathe (1973), Earthq. Eng. Struct. Dyn. 1, 241-252",
        Treatment.PROJECTION, theta=Parameter(1.42, 1.366025403784439, 2.0, "where equilibrium is asked for"),
    ),
    _newmark(
        "hht-alpha", "HHT alpha", 2, "Hilber, Hughes and Taylor (1977), Earthq. Eng. Struct. Dyn. 5, 283-292",
        Treatment.POSITION, alpha=Parameter(-0.1, -1.0 / 3.0, 0.0, "damping of high frequencies, most at -1/3"),
    ),
    _newmark(
        "generalised-alpha", "Generalised alpha", 2, "Chung and Hulbert (1993), J. Appl. Mech. 60, 371-375",
        Treatment.POSITION, spectral_radius=Parameter(0.7, 0.0, 1.0, "at infinite frequency: 0 annihilates, 1 keeps"),
    ),
    _scipy("rk45", "Runge-Kutta 4(5)", 5, "Dormand and Prince (1980), through SciPy", explicit=True),
    _scipy("radau", "Radau IIA", 5, "Hairer and Wanner (1996), IV.8, through SciPy"),
    _scipy("ndf", "NDF", 5, "Shampine and Reichelt (1997), SIAM J. Sci. Comput. 18, 1-22, through SciPy"),
    Method(
        "adams", "Adams", Family.SUNDIALS, _ODE_FORM, 12, _ODE, explicit=True,
        parameters={"max_order": Parameter(12.0, 1.0, 12.0, "highest order; up to 2 stiffness limits no step")},
        source="CVODE, Hindmarsh et al. (2005), ACM TOMS 31, 363-396",
    ),
    Method(
        "bdf", "BDF (Gear)", Family.SUNDIALS, _ODE_FORM, 2, _ODE, parameters={"max_order": _A_STABLE},
        source="CVODE, Hindmarsh et al. (2005), ACM TOMS 31, 363-396",
    ),
    Method(
        "ida", "IDA", Family.SUNDIALS, _INDEX_1, 2, (Treatment.BAUMGARTE, Treatment.GGL),
        parameters={"max_order": _A_STABLE},
        source="IDA, Hindmarsh et al. (2005), ACM TOMS 31, 363-396",
    ),
)  # fmt: skip
METHODS: Mapping[str, Method] = MappingProxyType({method.name: method for method in _ALL})
DEFAULT_METHOD = "esdirk5"


def find_method(name: str | Method) -> Method:
    """A method by its name, or itself.

    Raises
    ------
    InputError
        There is none of that name; the known ones are listed.
    """
    if isinstance(name, Method):
        return name
    if isinstance(name, str) and name in METHODS:
        return METHODS[name]
    near = suggestion(name, METHODS)
    known = f"choose from {', '.join(METHODS)}"
    remedy = known if near == known else f"{near} Otherwise {known}"
    raise InputError("unknown method", field="method", value=name, remedy=remedy)


def check_parameters(method: Method, given: Mapping[str, float]) -> dict[str, float]:
    """All parameters of a method, those not given at their defaults.

    Raises
    ------
    InputError
        One that the method does not take, or outside the range in which it is stable.
    """
    for name in given:
        if name not in method.parameters:
            others = ", ".join(other.name for other in METHODS.values() if name in other.parameters)
            raise InputError(
                f"no parameter of {method.name}", field="parameters", value=name,
                remedy=suggestion(name, method.parameters) + (f"; it is one of {others}" if others else ""),
            )  # fmt: skip
    values = {name: float(given.get(name, parameter.default)) for name, parameter in method.parameters.items()}
    for name, parameter in method.parameters.items():
        if not parameter.low <= values[name] <= parameter.high:
            raise InputError(
                f"outside the range in which {method.name} is stable", field=f"parameters.{name}", value=values[name],
                remedy=f"choose it from {parameter.low:.6g} to {parameter.high:.6g} ({parameter.meaning})",
            )  # fmt: skip
    if method.name == "newmark":
        least = 0.25 * (values["gamma"] + 0.5) ** 2
        if "beta" not in given:
            values["beta"] = least
        elif values["beta"] < least * (1.0 - 1e-12):
            raise InputError(
                "too small for unconditional stability", field="parameters.beta", value=values["beta"],
                remedy=f"at least (gamma + 1/2)^2 / 4 = {least:.6g}",
            )  # fmt: skip
    return values
