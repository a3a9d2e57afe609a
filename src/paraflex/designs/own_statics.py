"""Designs for which static equilibria are computed instead of a run."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from paraflex.equilibria import Statics, statics
from paraflex.errors import InputError
from paraflex.files import Model

# Fields of a study that apply to runs only.
_OF_RUNS = ("paths", "modes", "duration", "samples", "balanced", "integration")


@dataclass(frozen=True)
class OwnStatics:
    """Static analysis of a model, as by `paraflex statics`.

    Attributes
    ----------
    model : Model
        Model as read.
    assembly : str, optional
        Name of the assembly; by default the model's own start, else the assembly of its study.
    buckling : bool
        Whether buckling factors are computed, which takes half of the time.
    """

    model: Model
    assembly: str | None
    buckling: bool

    def found(self) -> Statics:
        """Compute the equilibria; see `equilibria.statics` for the errors."""
        own = None if self.model.start is not None else self.model.study.assembly
        return statics(self.model, assembly=self.assembly or own, buckling=None if self.buckling else 0, warning=False)


def check_of_statics(given: Collection[str]) -> None:
    """Check that a study of equilibria has no fields for runs, from the names of the fields given.

    Raises
    ------
    InputError
        A field applies to runs only; the error names it.
    """
    for name in _OF_RUNS:
        if name in given:
            raise InputError(
                "equilibria have none: the study is of statics",
                field=name,
                remedy="leave it out, or the [statics] table",
            )
