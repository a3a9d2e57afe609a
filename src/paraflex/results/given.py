"""Dataset of results that are given as they come: runs, results of studies, linear models, equilibria, folders."""

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

_GIVE = "give a run, the result of a study, a dataset, or the folder of results"


def dataset_of(results: Any, field: str = "results") -> xr.Dataset:
    """Return the dataset of results.

    Parameters
    ----------
    results : Any
        Run, or several runs of one task in different modes; linear model, or several; equilibria; result of a study; or
        a folder or file of results. A dataset is returned unchanged.
    field : str
        Name of the argument, for errors.

    Raises
    ------
    InputError
        No results, or a study of which nothing ran.
    """
    if isinstance(results, str | Path):
        return open_results(results)
    data = results if isinstance(results, xr.Dataset | list | tuple) else getattr(results, "data", results)
    if isinstance(data, xr.Dataset):
        return data
    for kind, make in ((MotionRun, motion_dataset), (Statics, statics_dataset)):
        if isinstance(data, kind):
            return make(data)
    several = data if isinstance(data, list | tuple) else [data]
    for kind, make in ((TrackingRun, tracking_dataset), (LinearModel, linear_dataset)):
        if several and all(isinstance(each, kind) for each in several):
            return make(several)
    raise refused(results, field, "results of runs", _GIVE)
