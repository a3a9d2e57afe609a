"""Solution of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Any, overload

from paraflex.arrays import Array, Brief, Indices
from paraflex.findings import Finding

if TYPE_CHECKING:
    from .options import IntegrationOptions


class LateFindings(Sequence[Finding]):
    """Findings that are computed when they are asked for first, by a function; a tuple where they are copied."""

    def __init__(self, find: Callable[[], Iterable[Finding]]) -> None:
        self._find: Callable[[], Iterable[Finding]] | None = find
        self._found: tuple[Finding, ...] = ()
        self._lock = Lock()

    def _all(self) -> tuple[Finding, ...]:
        with self._lock:
            if self._find is not None:
                self._found, self._find = tuple(self._find()), None
        return self._found

    @overload
    def __getitem__(self, index: int) -> Finding: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Finding, ...]: ...

    def __getitem__(self, index: int | slice) -> Finding | tuple[Finding, ...]:
        return self._all()[index]

    def __len__(self) -> int:
        return len(self._all())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and self._all() == tuple(other)

    def __repr__(self) -> str:
        return repr(self._all())

    def __reduce__(self) -> tuple[type[tuple[Any, ...]], tuple[tuple[Finding, ...]]]:
        return tuple, (self._all(),)


@dataclass(frozen=True)
class Solution(Brief):
    """Solution of a run at the requested times that were reached.

    Attributes
    ----------
    t : (k,) array
        Sample times [s].
    q, v, a : (k, n) arrays
        Coordinates and their derivatives; flexible ones are modal.
    multipliers : (k, m) array
        Constraint forces [N, N m], one per constraint row of the system; if rows depend on one another, those with the
        least sum of squares among all that give the same motion.
    kinetic_energy, strain_energy, work : (k,) arrays
        Energies and work [J]; work of motors, prescribed motion, weight and loads, less the energy dissipated in
        dampers.
    status : str
        "complete", "stopped" (by an event), "interrupted" or "failed".
    message : str
        Reason why the run is not complete.
    steps, rejected, newton_iterations, factorisations : int
        Numbers of accepted steps, rejected steps, Newton iterations and matrix factorisations.
    wall_time : float
        Wall time [s].
    constraint_position_max, constraint_velocity_max : float
        Largest |Phi| [m, rad] and |Phi'| at accepted steps.
    energy_balance_max : float
        Largest |kinetic + strain energy - start - work| at accepted steps [J].
    singular_positions : tuple of float
        Times of singular positions [s], at which constraints that are independent elsewhere depend on one another.
        Constraint forces have a pole there: multipliers of samples that are too close are NaN.
    method : str
        Name of the method; empty for another model.
    evaluations : int
        Number of evaluations of the equations of motion.
    event : str
        Event that stopped the run, whose time and state are then the last sample; empty for none. It is also set for a
        run that failed as a point reached the end of its beam.
    multiplier_errors : (m,) array, optional
        Estimated errors of multipliers by integration [N, N m]: the sum of the effects of the errors of single steps
        within three cycles, or the whole run if vibrations are undamped, times two. None if the step size is not
        controlled by such errors.
    coordinate_errors : (n,) array, optional
        The same of the coordinates [m, rad], always over the whole run, from which bounds of the errors of stresses
        follow.
    brake_energy : float
        Kinetic energy absorbed by brakes as they engaged [J]: `work` is reduced by it from then on.
    findings : sequence of Finding
        Reasons for doubt about the solution, such as points that left their beams.
    resting : bool
        Whether the samples are equilibria, numbered in place of times.
    acting : (c,) array, optional
        Indices of the constraint rows that act; all by default.
    options : IntegrationOptions, optional
        Options of the run; None for another model.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    multipliers: Array
    kinetic_energy: Array
    strain_energy: Array
    work: Array
    status: str
    message: str
    steps: int
    rejected: int = 0
    newton_iterations: int = 0
    factorisations: int = 0
    wall_time: float = 0.0
    constraint_position_max: float = 0.0
    constraint_velocity_max: float = 0.0
    energy_balance_max: float = 0.0
    singular_positions: tuple[float, ...] = ()
    method: str = ""
    evaluations: int = 0
    event: str = ""
    multiplier_errors: Array | None = None
    coordinate_errors: Array | None = None
    brake_energy: float = 0.0
    findings: Sequence[Finding] = ()
    resting: bool = False
    acting: Indices | None = None
    options: IntegrationOptions | None = None

    def instant(self, sample: int, digits: int = 3) -> str:
        """Return a description of a sample for texts: "t = 0.125 s", or "step 3"."""
        return f"step {self.t[sample]:.0f}" if self.resting else f"t = {self.t[sample]:.{digits}g} s"

    @property
    def samples(self) -> int:
        """Number of the requested sample times that the run reached; the state at an event is one more."""
        return self.t.size - bool(self.event)

    @property
    def event_time(self) -> float:
        """Time of the event that stopped the run [s]; NaN if there was none."""
        return float(self.t[-1]) if self.event else math.nan
