"""Dataset of results as they come: runs, linear models, equilibria, results of studies, folders."""

from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.arguments import refused
from paraflex.equilibria import Statics
from paraflex.linear import LinearModel
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun
from .dataset import tracking_dataset
from .linear_data import linear_dataset
from .motion_data import motion_dataset
from .statics_data import statics_dataset
from .storage import open_results

_OF_ONE = {MotionRun: motion_dataset, Statics: statics_dataset}
_OF_SEVERAL = {TrackingRun: tracking_dataset, LinearModel: linear_dataset}
_GIVE = "give a run, the result of a study, a dataset, or the folder of results"


def dataset_of(results: Any, field: str) -> xr.Dataset:
    """Return the dataset of a run, of runs or linear models in several modes, of equilibria, a study, or a folder.

    Raises
    ------
    InputError
        No results, or a study of which nothing ran; the error names the field.
    """
    if isinstance(results, str | Path):
        return open_results(results)
    data = results if isinstance(results, xr.Dataset | list | tuple) else getattr(results, "data", results)
    if isinstance(data, xr.Dataset):
        return data
    several = data if isinstance(data, list | tuple) else [data]
    for kind, make in _OF_ONE.items():
        if isinstance(data, kind):
            return make(data)
    for kind, make in _OF_SEVERAL.items():
        if several and all(isinstance(each, kind) for each in several):
            return make(several)
    raise refused(results, field, "results of runs", _GIVE)
