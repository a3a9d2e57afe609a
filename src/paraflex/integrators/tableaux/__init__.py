"""Butcher tableaux of ESDIRK schemes, a file each: explicit first stage, one diagonal, stiffly accurate."""

from __future__ import annotations

from collections.abc import Mapping

from paraflex.integrators.tableaux.esdirk3 import ESDIRK3
from paraflex.integrators.tableaux.esdirk4 import ESDIRK4
from paraflex.integrators.tableaux.esdirk5 import ESDIRK5
from paraflex.integrators.tableaux.tr_bdf2 import TR_BDF2
from paraflex.integrators.tableaux.trapezoidal import TRAPEZOIDAL
from paraflex.kernel.run_state import Tableau

TABLEAUX: Mapping[str, Tableau] = {
    "tr-bdf2": TR_BDF2,
    "trapezoidal": TRAPEZOIDAL,
    "esdirk3": ESDIRK3,
    "esdirk4": ESDIRK4,
    "esdirk5": ESDIRK5,
}

__all__ = ["ESDIRK3", "ESDIRK4", "ESDIRK5", "TABLEAUX", "TRAPEZOIDAL", "TR_BDF2"]
