"""Time integration: schemes as tableaux, and the loop that runs them."""

from paraflex.integrators.esdirk import IntegrationOptions, Solution, integrate
from paraflex.integrators.tableaux import TR_BDF2

__all__ = ["TR_BDF2", "IntegrationOptions", "Solution", "integrate"]
