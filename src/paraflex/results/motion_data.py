"""Labelled dataset of a run without a path: coordinates, points, joint forces, energies."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.control.loop.runs import ControlledMotion
from paraflex.driven import DrivenMotion
from paraflex.findings import Finding
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.methods import title_of
from paraflex.motion import MotionRun
from paraflex.validity import beyond_range, implausible_numbers
from .acting import load_variables
from .controllers import with_controllers
from .findings import keep_findings, validity_variables
from .kinds import RUN_FIGURES
from .kinematics import add_kinematics
from .labelled import Variables, error_variables, label, link_coordinates, padded, provenance, with_totals
from .links import system_links


@checked_arguments()
def motion_dataset(
    run: MotionRun,
    *,
    options: IntegrationOptions | None = None,
    parameters: dict[str, Any] | None = None,
    findings: Iterable[Finding] = (),
) -> xr.Dataset:
    """Return the labelled dataset of a run without a path.

    Parameters
    ----------
    run : MotionRun
        Run. One that did not finish has NaN after its last sample, which `status` reports; for one that an event
        stopped, the time ends with the event.
    options : IntegrationOptions, optional
        Integration options, stored as provenance; by default those of the run.
    parameters : dict, optional
        Model as read and requested options, stored as provenance.
    findings : iterable of Finding
        Findings on the model from checks before the run, stored with those on its numbers and on the run.

    Returns
    -------
    xarray.Dataset
        Dimensions time, coordinate, body, point, joint, row, axis, motor, station, spring, end, section, drive, load,
        sensor; for each controller NAME also sample_NAME, input_NAME and output_NAME (see `results.controllers`). The
        attributes of every variable give units and signs.
    """
    system, solution, mechanism = run.system, run.solution, run.system.described
    q, v = solution.q, solution.v
    torques = run.applied
    links = system_links(system, solution, torques, len(q))
    values: Variables = {
        "coordinate_value": (("coordinate",), q),
        "coordinate_rate": (("coordinate",), v),
        **links.variables,
    }  # fmt: skip
    data: dict[str, Any] = {
        name: (("time", *dims), padded(each, run.times.size)) for name, (dims, each) in values.items()
    }
    data |= error_variables(links)
    data |= load_variables(mechanism, run.times)
    data |= {name: getattr(solution, name) for name in RUN_FIGURES}
    data |= {name: each.item() for name, each in validity_variables([run.validity]).items()}
    if run.in_time:
        data["applied_torque"] = (("time", "motor"), padded(torques, run.times.size))
    else:
        data["applied_torque"] = (("motor",), np.array(list(run.torques.values()), dtype=float))
    names = [
        f"{body.name}.{part}"
        for body in system.bodies
        for part in ("x", "y", "phi", *(f"eta{k + 1}" for k in range(body.nf)))
    ]
    coordinates = {"time": run.times, "coordinate": names, **link_coordinates(system, links)}
    out = with_totals(xr.Dataset(data, coords=coordinates))
    label(out, mechanism)
    out.attrs = provenance(system, title_of(solution.method), options or solution.options, parameters) | {
        "kind": "motion",
        "singular_positions": json.dumps(solution.singular_positions),
    }
    if isinstance(run, ControlledMotion):
        out = with_controllers(out, [run.controllers], [motor.name for motor in mechanism.motors])
    if isinstance(run, DrivenMotion):
        add_kinematics(out, run)
    # Masses of kinematics only stand in for those that are not given.
    weighed = not isinstance(run, DrivenMotion) or not np.isnan(solution.multipliers).all()
    numbers = implausible_numbers(mechanism) if weighed else ()
    keep_findings(out, [*findings, *numbers, *beyond_range(run.validity), *run.findings])
    return out
