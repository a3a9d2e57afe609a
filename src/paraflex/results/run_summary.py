"""Results of runs as plain numbers: the contents of `summary.json`."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from .beside import beside_of
from .controllers import controller_figures
from .findings import validity_summary, verdict_of
from .following import FOLLOWING, ErrorSpan, part_run
from .kinds import RUN_FIGURES, check_kind
from .loads import load_figures
from .metrics import METRICS, kept_metrics
from .numbers import by_label, finite_or_none, plain
from .reduced_runs import reduced_run_figures
from .sensors import sensor_figures
from .traces import data_traces

_FIGURES = (
    *FOLLOWING,
    "brake_energy",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
)


@checked_arguments()
def summary(data: xr.Dataset, failed: dict[str, str] | None = None) -> dict[str, Any]:
    """Return the results of every mode with parameters and version as plain values for JSON.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset made by `tracking_dataset`.
    failed : dict, optional
        Reason of the failure for each mode that could not be run at all.

    Returns
    -------
    dict
        `modes.<mode>` with tracking errors during the motion, after it and over the whole run, vibration and drift,
        peak_torque and rms_torque per motor, end_effector_final, the solver's figures, validity (None for rigid bodies)
        and `loads` (see `load_figures`); also `metrics` that were asked for, with value and unit, `sensors` of
        mechanisms with sensors (`sensor_figures`), `reduction` of reduced bodies (`reduced_run_figures`), `controllers`
        and internal_torque_max [N m] (`controller_figures`). `beside` has the tracking errors in another geometry, if
        the study ran it as well (`Beside`). `tolerance` [m] of the integration; `error`, the time span of the error
        that ranks the modes; `verdict`, with level and all findings; `after`, the state of the motors after the path;
        `part`, the part of the path covered by runs that ended before it, else None; `parameters`; `version`. Values
        that a run did not reach are None.

    Raises
    ------
    InputError
        The dataset is of another kind.
    """
    check_kind(data, "tracking")
    modes, part = {}, part_run(data)
    for name in data["mode"].values:
        run = data.sel(mode=name)
        numbers: dict[str, Any] = {"status": str(run["status"].item())}
        if numbers["status"] != "complete":
            numbers["message"] = str(run["message"].item())
        if numbers["status"] == "stopped":
            numbers |= {"event": str(run["event"].item()), "event_time": run["event_time"].item()}
        # Results of earlier versions lack some figures.
        numbers |= {key: finite_or_none(run[key].item()) for key in _FIGURES if key in run}
        traces = data_traces(run)
        if "deflection" in run:
            numbers["deflection_max"] = finite_or_none(METRICS["deflection_max"].value(traces))
        numbers |= {key: int(run[key].item()) for key in ("steps", "rejected", "newton_iterations", "factorisations")}
        numbers |= {key: by_label(run[key], "motor") for key in ("peak_torque", "rms_torque")}
        numbers["end_effector_final"] = [finite_or_none(x) for x in run["end_effector"].isel(time=-1).values]
        numbers["actuation_condition_max"] = finite_or_none(METRICS["actuation_condition_max"].value(traces))
        numbers |= {"validity": validity_summary(run), "loads": load_figures(run)}
        numbers |= sensor_figures(run) | reduced_run_figures(run) | controller_figures(run)
        numbers |= kept_metrics(data, str(name))
        modes[str(name)] = numbers
    modes |= {name: {"status": "failed", "message": reason} for name, reason in (failed or {}).items()}
    beside = beside_of(data)
    return {
        "mechanism": data.attrs["mechanism"],
        "tolerance": data.attrs.get("tolerance"),
        "error": data.attrs.get("error", ErrorSpan.WHOLE.value),
        "after": data.attrs.get("after", "free"),
        "verdict": verdict_of(data).to_dict(),
        "part": None if part is None else part.to_dict(),
        "modes": modes,
        **({} if beside is None else {"beside": asdict(beside)}),
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }


@checked_arguments()
def motion_summary(data: xr.Dataset) -> dict[str, Any]:
    """Return the results of a run without a path as plain numbers for JSON.

    `final` holds the last sample that the run reached, with time None if it reached none.

    Raises
    ------
    InputError
        The dataset is of another kind.
    """
    check_kind(data, "motion")
    reached = np.flatnonzero(np.isfinite(data["angle"].values).all(axis=1))
    last = data.isel(time=reached[-1] if reached.size else 0)
    numbers = {name: plain(data[name].item()) for name in RUN_FIGURES}
    return {
        "mechanism": data.attrs["mechanism"],
        "status": numbers.pop("status"),
        "message": numbers.pop("message"),
        "loads": load_figures(data),
        **numbers,
        "verdict": verdict_of(data).to_dict(),
        "validity": validity_summary(data),
        **kept_metrics(data),
        **sensor_figures(data),
        **reduced_run_figures(data),
        **controller_figures(data),
        "singular_positions": json.loads(data.attrs["singular_positions"]),
        "final": {
            "time": float(last["time"]) if reached.size else None,
            "angle": by_label(last["angle"], "body"),
            "point_position": {
                str(point): [finite_or_none(x) for x in last["point_position"].sel(point=point).values]
                for point in data["point"].values
            },
        },
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }
