"""Methods of SciPy and SUNDIALS: their properties and parameters."""

from dataclasses import dataclass
from typing import ClassVar

from .method import EQUATIONS_INDEX_1, EQUATIONS_ODE, Family, Method, Treatment, parameter


class ExternalMethod(Method):
    """Method run by an external solver.

    Attributes
    ----------
    error_factor : float
        Error allowed in a step, as a fraction of the tolerance. Solvers estimate the error of a step, not the
        accumulated error. Measured on RAParM-I, a soft arm and a falling platform, whose final errors are 0.01 to 2
        tolerances.
    solver : str
        Name of the solver in its package.
    """

    form = EQUATIONS_ODE
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.BAUMGARTE,)
    error_factor: ClassVar[float] = 0.1
    solver: ClassVar[str]


class SciPyMethod(ExternalMethod):
    """Method of `scipy.integrate`.

    Attributes
    ----------
    places : int
        Number of times within a step at which it evaluates, for implicit methods once per iteration.
    """

    family = Family.SCIPY
    order = 5
    places: ClassVar[int]


class RK45(SciPyMethod):
    """Explicit pair of Dormand and Prince."""

    name = "rk45"
    title = "Runge-Kutta 4(5)"
    source = "Dormand and Prince (1980), through SciPy"
    solver = "RK45"
    places = 5
    # Root y of |R(iy)| = 1 for its stability polynomial.
    stability_limit: ClassVar[float | None] = 0.997


class Radau(SciPyMethod):
    """Radau IIA of order 5."""

    name = "radau"
    title = "Radau IIA"
    source = "Hairer and Wanner (1996), IV.8, through SciPy"
    error_factor: ClassVar[float] = 5.0
    solver = "Radau"
    places = 3


class NDF(SciPyMethod):
    """Numerical differentiation formulas of orders 1 to 5; the order cannot be limited."""

    name = "ndf"
    title = "NDF"
    source = "Shampine and Reichelt (1997), SIAM J. Sci. Comput. 18, 1-22, through SciPy"
    solver = "BDF"
    places = 1
    multistep = True


class SundialsMethod(ExternalMethod):
    """Method of SUNDIALS, with variable order."""

    family = Family.SUNDIALS
    multistep = True


@dataclass(frozen=True)
class Adams(SundialsMethod):
    """Adams-Moulton formulas of CVODE."""

    name = "adams"
    title = "Adams"
    order = 12
    source = "CVODE, Hindmarsh et al. (2005), ACM TOMS 31, 363-396"
    error_factor: ClassVar[float] = 0.5
    solver = "Adams"
    # Measured with steps of orders up to 12 on RAParM-I; the order depends on the frequencies.
    stability_limit: ClassVar[float | None] = 0.75

    max_order: int = parameter(12, 1, 12, "highest order; up to 2 stiffness limits no step")

    @property
    def explicit(self) -> bool:
        """Whether orders above 2 are allowed; up to 2 Newton's iteration is used and any step is stable."""
        return self.max_order > 2


@dataclass(frozen=True)
class BDF(SundialsMethod):
    """Gear's backward difference formulas, by CVODE."""

    name = "bdf"
    title = "BDF (Gear)"
    order = 2
    source = "CVODE, Hindmarsh et al. (2005), ACM TOMS 31, 363-396"
    solver = "BDF"

    # Only the formulas of orders 1 and 2 are stable for undamped vibrations of any frequency.
    max_order: int = parameter(2, 1, 5, "highest order; above 2 vibrations that hardly decay dictate the step")


@dataclass(frozen=True)
class IDA(BDF):
    """Backward difference formulas on the implicit equations, with multipliers among the unknowns."""

    name = "ida"
    title = "IDA"
    form = EQUATIONS_INDEX_1
    treatments: ClassVar[tuple[Treatment, ...]] = (Treatment.BAUMGARTE, Treatment.GGL)
    source = "IDA, Hindmarsh et al. (2005), ACM TOMS 31, 363-396"
