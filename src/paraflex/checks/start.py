"""Check of the start of a run without a path: whether the mechanism can start as the file specifies."""

from __future__ import annotations

from collections.abc import Iterator

from paraflex.checks.pose import Examination
from paraflex.dynamics import start_state
from paraflex.errors import InputError, NumericalError
from paraflex.files import Model
from paraflex.findings import Finding
from paraflex.mechanism import Mechanism, Start
from paraflex.validity.numbers import FAST, mechanism_size


def start_findings(model: Model, seen: Examination, assembly: str | None) -> Iterator[Finding]:
    """Yield findings about values of [start] that joints, prescribed motions or other values do not allow."""
    open_ = seen.chosen is None or not (seen.chosen.closes or seen.chosen.undecided)
    if model.start is None or (seen.starts and open_):
        return
    chosen = model.mechanism.assembly(assembly) if seen.starts else None
    try:
        start_state(seen.system, model.start, chosen)
        yield from _high_speeds(model.mechanism, model.start)
    except InputError as error:
        yield Finding("start-refused", error.field, error.problem, error.remedy)
    except NumericalError as error:
        yield Finding("start-refused", "start", str(error), "give a start that the joints allow")


def _high_speeds(mechanism: Mechanism, start: Start) -> Iterator[Finding]:
    """Yield angular velocities above those of any body."""
    size = mechanism_size(mechanism)
    for body, rate in start.angular.items():
        if abs(rate) * size > FAST:
            yield Finding(
                "speed-large", f"start.velocity.angular.{body}",
                f"{rate:.4g} rad/s, in a mechanism of {size:.3g} m",
                "speeds are in rad/s: one turn a minute is 0.105 of them, a degree a second 0.0175",
            )  # fmt: skip
