"""A sweep, read from its file and checked against the mechanism it varies."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments, given_as
from paraflex.designs.samples import Varied, check_varied, designs
from paraflex.designs.schema import SweepTable, study_table
from paraflex.designs.setting import Setting, make_setting
from paraflex.files import Model, model_from


@given_as("a sweep", "a SweepStudy")
@dataclass(frozen=True)
class SweepStudy:
    """A sweep: a mechanism, what varies in it, what is run and what is kept.

    Attributes
    ----------
    name : str
    setting : Setting
    parameters : tuple of Varied
    kind : str
        Of sampling.
    designs : (k, parameters) array
    motors : tuple of str
        Of the mechanism.
    """

    name: str
    setting: Setting
    parameters: tuple[Varied, ...]
    kind: str
    designs: NDArray[np.float64]
    motors: tuple[str, ...]

    @property
    def runs(self) -> int:
        """Number of runs: designs times paths times modes."""
        return len(self.designs) * len(self.setting.paths) * len(self.setting.modes)

    def model(self) -> Model:
        """The mechanism as its file has it."""
        return model_from(dict(self.setting.data), self.setting.source)

    def content(self) -> dict[str, Any]:
        """What the results depend on, in plain values: the same content gives the same table."""
        setting = self.setting
        return {
            "mechanism": dict(setting.data),
            "paths": list(setting.paths),
            "modes": list(setting.modes),
            "duration": setting.duration,
            "samples": setting.samples,
            "assembly": setting.assembly,
            "integration": dict(setting.integration),
            "metrics": list(setting.metrics),
            "trajectories": setting.trajectories,
            "parameters": [
                {"name": p.name, "places": [list(place) for place in places], "whole": p.whole}
                for p, places in zip(self.parameters, setting.places, strict=True)
            ],
            "designs": hashlib.sha256(np.ascontiguousarray(self.designs, dtype="<f8").tobytes()).hexdigest(),
        }


@checked_arguments()
def load_sweep(file: str | FilePath) -> SweepStudy:
    """Read a study file.

    Parameters
    ----------
    file : str or Path
        TOML; see docs/sweeps.md.

    Raises
    ------
    InputError
        Anything in it that does not fit the file or the mechanism: it names file, field, value and remedy.
    """
    with study_table(SweepTable, file) as (table, folder):
        return make_study(table, folder)


def make_study(table: SweepTable, folder: FilePath) -> SweepStudy:
    """A study as a file in a folder says it; see `load_sweep`."""
    setting, parameters, model = make_setting(table, folder)
    for parameter in parameters:
        check_varied(parameter, table.sampling.kind)
    sampling = table.sampling
    return SweepStudy(
        name=table.name,
        setting=setting,
        parameters=parameters,
        kind=sampling.kind,
        designs=designs(parameters, sampling.kind, sampling.number, sampling.seed),
        motors=tuple(motor.name for motor in model.mechanism.motors),
    )
