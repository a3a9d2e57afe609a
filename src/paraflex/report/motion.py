"""Report of a run without a path."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.findings import DONE_STATUSES
from paraflex.plots.labels import DisplayUnit, text_symbol
from paraflex.plots.selection import names_of
from paraflex.report.controllers import controller_panels, controller_tables
from paraflex.report.curves import (
    TIPS,
    bending,
    deflections_of,
    energies,
    energy_scale,
    followed,
    joint_force_curves,
    largest,
    look,
    thinned,
)
from paraflex.report.film import NO_SHAPES, animation
from paraflex.report.loads import load_panel, load_tables, load_tiles
from paraflex.report.page import Chart, Curve, Page, Panel
from paraflex.report.provenance import asked, common_facts, run_command_line, verdict_word
from paraflex.report.reduced_runs import reduction_tables
from paraflex.report.text import count, number, pairs, quantity
from paraflex.results.findings import finding_lines, finished, verdict_of
from paraflex.results.kinds import check_kind
from paraflex.results.loads import load_figures
from paraflex.results.validity import validity_line, validity_summary

_ALONE = ("",)
# Largest number of points, bodies or joints that a chart offers for choice; results.nc has all.
_MOST_CHOICES = 60


@checked_arguments()
def motion_page(data: xr.Dataset) -> Page:
    """Return the report of a run, a dataset from `results.motion_dataset`."""
    check_kind(data, "motion")
    data = data.transpose("time", ...)
    moving = animation(data, ())
    few = thinned(data)
    status = str(data["status"].item())
    return Page(
        title=data.attrs["mechanism"],
        kind="run",
        subtitle=_subtitle(data),
        verdict=verdict_word(data),
        facts=common_facts(data),
        command=run_command_line(asked(data)),
        figures=_figures(data),
        more=[*controller_tables(data), *load_tables(data), *reduction_tables(data), ("Integration", _table(data))],
        panels=_panels(few),
        time=few["time"].values,
        runs=_ALONE,
        film=moving,
        no_film="" if moving else NO_SHAPES,
        notes=[
            *([] if status == "complete" else [f"{status}: {data['message'].item()}"]),
            *finding_lines(verdict_of(data)),
        ],
        remarks=list(filter(None, [validity_line({"": validity_summary(data)})])) if finished(data).all() else [],
    )


def _subtitle(data: xr.Dataset) -> str:
    """Return a text on the drives and torques that move the mechanism."""
    drives = names_of(data, "drive") if "drive" in data.dims else []
    torques = {str(name): data["applied_torque"].sel(motor=name).values for name in data["motor"].values}
    given = [text_symbol(name) for name, values in torques.items() if np.any(np.nan_to_num(values))]
    parts = [*([f"driven by {', '.join(map(text_symbol, drives))}"] if drives else []),
             *([f"given torques of {', '.join(given)}"] if given else [])]  # fmt: skip
    return "; ".join(parts) or "left to its loads"


def _table(data: xr.Dataset) -> str:
    wide = largest(data["point_position"].values)
    facts = [
        ("status", str(data["status"].item())),
        ("steps, rejected", f"{count(data['steps'].item())}, {count(data['rejected'].item())}"),
        ("Newton iterations", count(data["newton_iterations"].item())),
        ("factorisations", count(data["factorisations"].item())),
        ("wall time", f"{number(data['wall_time'].item())} s"),
        ("constraint violation, position", f"{number(data['constraint_position_max'].item(), beside=wide)} m"),
        ("constraint violation, velocity", f"{number(data['constraint_velocity_max'].item())} m/s"),
        ("imbalance of energy", f"{number(data['energy_balance_max'].item(), beside=energy_scale(data))} J"),
    ]
    facts += [(f"torque of {text_symbol(str(name))}", _torque(data["applied_torque"].sel(motor=name)))
             for name in data["motor"].values]  # fmt: skip
    passed = json.loads(data.attrs.get("singular_positions", "[]"))
    if passed:
        facts.append(("singular positions passed", ", ".join(f"{t:.4g} s" for t in passed[:6])))
    return pairs(facts)


def _torque(values: xr.DataArray) -> str:
    """Return a constant torque, or the smallest and the largest value of a varying one, as text."""
    if "time" not in values.dims:
        return f"{number(float(values))} N m"
    return f"{number(float(values.min()))} to {number(float(values.max()))} N m"


def _panels(data: xr.Dataset) -> list[Panel]:
    # The charts need a dimension of runs.
    run, bodies = data.expand_dims("run"), names_of(data, "body")
    angles, rates = (
        Chart("angles", "Angles", "angle", choosing="body"),
        Chart("rates", "Angular velocities", "angular velocity", choosing="body"),
    )
    motion = [followed(angles, run["angle"], _ALONE), followed(rates, run["angular_velocity"], _ALONE)]
    if bending(run).size:
        motion.append(followed(TIPS, bending(run), _ALONE))
    motion.append(_phases(data, bodies))
    points = _points(data)
    if points is not None:
        motion.append(points)
    panels = [Panel("Motion", motion), Panel("Energies", [energies(run, _ALONE)])]
    if data.sizes["joint"]:
        panels.append(Panel("Joints", [_joint_forces(data)]))
    return [
        *panels,
        *controller_panels(run, _ALONE),
        *load_panel(run, _ALONE),
        Panel("Coordinates", [_coordinates(data, bodies)]),
    ]


def _phases(data: xr.Dataset, bodies: list[str]) -> Chart:
    angle, rate = data["angle"].values, data["angular_velocity"].values
    curves = [Curve(text_symbol(body), rate[:, b], angle[:, b], run=0, look=look(b)) for b, body in enumerate(bodies)]
    return Chart("phases", "Phase diagram", "angular velocity [rad/s]", curves, x="angle [rad]", over_time=False)


def _points(data: xr.Dataset) -> Chart | None:
    """Return the chart of the paths of points that move, without generated points; None if there are none."""
    places = data["point_position"].transpose("point", "time", "axis").values
    names = names_of(data, "point")
    moving = [
        k for k, name in enumerate(names)
        if "._" not in name and np.isfinite(places[k, :, 0]).any() and np.nanmax(np.nanstd(places[k], axis=0)) > 1e-9
    ][:_MOST_CHOICES]  # fmt: skip
    if not moving:
        return None
    unit = DisplayUnit("mm", 1e3) if largest(places[moving]) < 10.0 else DisplayUnit("m", 1.0)
    curves = [
        Curve(names[k], unit.factor * places[k, :, 1], unit.factor * places[k, :, 0], run=0, look=look(i))
        for i, k in enumerate(moving)
    ]
    return Chart(
        "points", "Paths of points", f"y [{unit.name}]", curves, x=f"x [{unit.name}]", equal=True, over_time=False
    )


def _joint_forces(data: xr.Dataset) -> Chart:
    force = data["joint_force"].transpose("joint", "time", "axis").values
    names = names_of(data, "joint")[:_MOST_CHOICES]
    return Chart(
        "forces", "Joint forces", "force [N]", joint_force_curves(force[: len(names)]),
        choices=[text_symbol(name) for name in names], choosing="joint",
        note="On the joint's second body, in the ground frame.",
    )  # fmt: skip


def _coordinates(data: xr.Dataset, bodies: list[str]) -> Chart:
    """Return the chart of the coordinates of one body at a time: position and angle of its frame, or flexible ones."""
    names = names_of(data, "coordinate")
    values = data["coordinate_value"].transpose("coordinate", "time").values
    curves, choices = [], []
    for body in bodies[:_MOST_CHOICES]:
        own = [k for k, name in enumerate(names) if name.startswith(f"{body}.")]
        kinds = (
            (f"{text_symbol(body)}: x, y [m], φ [rad]", own[:3]),
            (f"{text_symbol(body)}: flexible [m √kg]", own[3:]),
        )
        for choice, members in kinds:
            if members:
                curves += [
                    Curve(
                        text_symbol(names[k].removeprefix(f"{body}.")),
                        values[k],
                        run=0,
                        choice=len(choices),
                        look=look(i),
                    )
                    for i, k in enumerate(members)
                ]
                choices.append(choice)
    return Chart(
        "coordinates", "Generalised coordinates", "coordinate", curves, choices=choices, choosing="body",
        note="Flexible coordinates are mass-normalised modes." if len(choices) > len(bodies[:_MOST_CHOICES]) else "",
    )  # fmt: skip


def _figures(data: xr.Dataset) -> list[tuple[str, str, str]]:
    tiles = load_tiles({"": load_figures(data)})
    deflections = deflections_of(data)
    if largest(deflections) > 0.0:
        body = int(np.argmax([largest(one) for one in deflections.T]))
        name = text_symbol(str(data["body"].values[body]))
        tiles.append(("largest deflection", quantity(largest(deflections), "m"), name))
    status = str(data["status"].item())
    last = "" if status in DONE_STATUSES else "last sample "
    reached = np.isfinite(data["angle"].values).all(axis=1)
    end = np.max(data["time"].values[reached], initial=0.0)
    ended = ("status", status, f"{last}t = {end:.4g} s, computed in {number(data['wall_time'].item())} s")
    # The failure of a run comes before its numbers.
    return [ended, *tiles] if last else [*tiles, ended]
