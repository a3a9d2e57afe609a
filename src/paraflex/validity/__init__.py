"""Validity of a model for a run: size of the effects that its geometry neglects, from the stored samples.

Linear geometry neglects the shortening of beams by bending, and the effect of axial forces on bending. Second-order
geometry includes both, and neglects terms of fourth order in the slopes.
"""

from dataclasses import dataclass, replace

from paraflex.arrays import Brief
from paraflex.dynamics import System
from paraflex.errors import ValidityWarning
from paraflex.findings import Finding, warn_of
from paraflex.integrators import Solution
from .bending import bending_of
from .causes import likely_cause as likely_cause, with_likely_cause as with_likely_cause
from .indicators import (
    FOURTH_ORDER_LIMIT as FOURTH_ORDER_LIMIT,
    Following as Following,
    Indicator as Indicator,
    fourth_order as fourth_order,
    of_linear,
    of_second_order,
)
from .numbers import implausible_numbers as implausible_numbers, mechanism_size as mechanism_size
from .plausibility import (
    Driven as Driven,
    implausible_results as implausible_results,
    implausible_stresses as implausible_stresses,
    large_rotations as large_rotations,
    shared_loads as shared_loads,
    stiff_modes as stiff_modes,
    unresolved_loads as unresolved_loads,
)


@dataclass(frozen=True)
class Validity(Brief):
    """Validity of a model for a run.

    Attributes
    ----------
    indicators : tuple of Indicator
        Indicators, one or more.
    """

    indicators: tuple[Indicator, ...]

    @property
    def worst(self) -> Indicator:
        """Indicator nearest to its limit, or furthest beyond it."""
        return max(self.indicators, key=lambda one: one.ratio)

    @property
    def ratio(self) -> float:
        """Value over limit of the worst indicator: the model holds up to 1."""
        return self.worst.ratio

    @property
    def holds(self) -> bool:
        """Whether all indicators are within their limits."""
        return self.ratio <= 1.0

    @property
    def verdict(self) -> str:
        """One sentence: whether the model holds, by which indicator, and the remedy if it does not."""
        if self.holds:
            return f"{self.worst.geometry} geometry holds: {self.worst.text}"
        found = self.finding()
        return f"{found.text}; {found.remedy}"

    def finding(self, whose: str = "") -> Finding:
        """Return the finding for a run beyond the range of its model."""
        worst = self.worst
        return Finding("validity", whose, f"{worst.geometry} geometry does not hold: {worst.text}", worst.remedy)


def assess(system: System, solution: Solution, following: Following | None = None) -> Validity | None:
    """Assess the validity of a model for a run; None if no body is flexible, or if a failed run is within its range.

    Parameters
    ----------
    system : System
        System of the run.
    solution : Solution
        Samples of the run.
    following : Following, optional
        Deviation from the path, for a run along a path driven by torques.
    """
    if not solution.t.size:
        return None
    bodies = [bending_of(system, body.name, solution) for body in system.bodies if body.nf]
    linear, second = [one for one in bodies if one.linear], [one for one in bodies if not one.linear]
    indicators = [*of_linear(linear, solution, following), *of_second_order(second, solution)]
    if not (solution.method or solution.resting):
        # Kineto-elastodynamics is linear in the displacements for any geometry.
        indicators = [replace(one, remedy="run it without --ked, in second-order geometry") for one in indicators]
    found = Validity(tuple(indicators)) if indicators else None
    # Validity up to a failure is no verdict on the whole run.
    return None if found is not None and found.holds and solution.status == "failed" else found


def beyond_range(validity: Validity | None, whose: str = "") -> list[Finding]:
    """Return the finding for a run beyond the range of its model, if it is; `whose` names it, for example "mode ++"."""
    return [] if validity is None or validity.holds else [validity.finding(whose)]


def warn(validity: Validity | None, whose: str = "") -> None:
    """Issue a `ValidityWarning` if a model does not hold; see `beyond_range`."""
    warn_of(beyond_range(validity, whose), ValidityWarning)
