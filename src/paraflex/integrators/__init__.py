"""Time integration: methods as objects, our own schemes as tableaux and numbers, SciPy's and SUNDIALS' as guests."""

from paraflex.integrators.events import DeflectionLimit, Event, JointLimit, SingularDistance, check_events
from paraflex.integrators.integrate import integrate
from paraflex.integrators.methods import DEFAULT_METHOD, METHODS, Method, Treatment, find_method
from paraflex.integrators.options import IntegrationOptions, check_times, choose
from paraflex.integrators.run import make_problem
from paraflex.integrators.solution import Solution

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "DeflectionLimit",
    "Event",
    "IntegrationOptions",
    "JointLimit",
    "Method",
    "SingularDistance",
    "Solution",
    "Treatment",
    "check_events",
    "check_times",
    "choose",
    "find_method",
    "integrate",
    "make_problem",
]
