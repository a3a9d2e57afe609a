from . import methods as methods
from .events import (
    DeflectionLimit as DeflectionLimit,
    Event as Event,
    JointLimit as JointLimit,
    SingularDistance as SingularDistance,
    check_events as check_events,
)
from .integration import integrate as integrate
from .methods import (
    DEFAULT_METHOD as DEFAULT_METHOD,
    METHODS as METHODS,
    Method as Method,
    Treatment as Treatment,
    find_method as find_method,
)
from .options import (
    Control as Control,
    IntegrationOptions as IntegrationOptions,
    TolerancePer as TolerancePer,
    check_times as check_times,
    choose as choose,
    loose_tolerance as loose_tolerance,
)
from .run import make_problem as make_problem
from .solution import Solution as Solution
