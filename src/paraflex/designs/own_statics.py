"""A design whose equilibria are found in place of a run."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from paraflex.equilibria import Statics, statics
from paraflex.errors import InputError
from paraflex.files import Model

# Fields of a study that are of runs.
_OF_RUNS = ("paths", "modes", "duration", "samples", "balanced", "integration")


@dataclass(frozen=True)
class OwnStatics:
    """What `paraflex statics` finds of a model.

    Attributes
    ----------
    model : Model
    assembly : str, optional
        By default its own start, else the assembly of its study.
    buckling : bool
        Whether factors of buckling are asked for: they take half of the time.
    """

    model: Model
    assembly: str | None
    buckling: bool

    def found(self) -> Statics:
        """The equilibria; see `equilibria.statics` for the errors."""
        own = None if self.model.start is not None else self.model.study.assembly
        return statics(self.model, assembly=self.assembly or own, buckling=None if self.buckling else 0, warning=False)


def check_of_statics(given: Collection[str]) -> None:
    """None if a study of equilibria, of which these fields are given, says nothing about runs.

    Raises
    ------
    InputError
        It does, by field.
    """
    for name in _OF_RUNS:
        if name in given:
            raise InputError(
                "equilibria have none: the study is of statics",
                field=name,
                remedy="leave it out, or the [statics] table",
            )
