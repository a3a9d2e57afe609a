"""Report of a tracking study: comparison of all actuation modes, and details of each mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.findings import DONE_STATUSES
from paraflex.plots.labels import display_unit, text_symbol
from paraflex.plots.selection import default_mode, names_of, samples
from paraflex.report.controllers import controller_panels, controller_tables
from paraflex.report.curves import (
    DOTTED,
    ERRORS,
    STRAIN,
    TIPS,
    bending,
    compared,
    deflections_of,
    energies,
    energy_scale,
    errors,
    followed,
    largest,
    look,
    plane_path,
    thinned,
    torque_chart,
    torque_unit,
)
from paraflex.report.film import NO_SHAPES, animation
from paraflex.report.loads import load_panel, load_tables, load_tiles
from paraflex.report.page import Chart, Curve, Look, Page, Panel
from paraflex.report.provenance import asked, common_facts, run_command_line, summary_beside, verdict_word
from paraflex.report.reduced_runs import reduction_tables
from paraflex.report.text import NO_VALUE, count, number, quantity, table
from paraflex.results.controllers import controller_names
from paraflex.results.findings import finding_lines, finished, verdict_of
from paraflex.results.following import headline, ranked_by_motion
from paraflex.results.formulas import during_motion
from paraflex.results.kinds import check_kind
from paraflex.results.loads import load_figures
from paraflex.results.validity import validity_line, validity_summary


def report_of_folder(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a tracking study; modes that could not start are in the summary of its folder only."""
    summary = folder / "summary.json"
    modes = summary_beside(summary)["modes"] if summary.is_file() else {}
    return tracking_page(
        data, {name: mode.get("message", "") for name, mode in modes.items() if name not in data["mode"].values}
    )


@checked_arguments()
def tracking_page(data: xr.Dataset, failed: Mapping[str, str] | None = None) -> Page:
    """Return the report of a tracking study.

    Parameters
    ----------
    data : xarray.Dataset
        Results from `results.tracking_dataset`.
    failed : mapping of str to str, optional
        Modes that could not start, each with its reason.
    """
    check_kind(data, "tracking")
    data = data.transpose("mode", "time", ...)
    runs = names_of(data, "mode")
    run = asked(data)
    path = run.get("path")
    modes = f"{len(runs)} actuation modes" if len(runs) > 1 else f"actuation mode {runs[0]}"
    moving = animation(data)
    few = thinned(data)
    # The validity is that of complete runs only.
    whole = data.isel(mode=finished(data))
    valid = validity_line({name: validity_summary(whole.sel(mode=name)) for name in names_of(whole, "mode")})
    return Page(
        title=data.attrs["mechanism"],
        kind="run",
        subtitle=", ".join([f"path “{path}”", modes] if path else [modes]),
        verdict=verdict_word(data, failed or {}),
        facts=[*([("model", _model(run))] if run else []), *_after(data), *common_facts(data)],
        command=run_command_line(run),
        figures=_figures(data),
        more=[
            ("Modes" if len(runs) > 1 else "Run", mode_table(data, failed or {})),
            *controller_tables(data),
            *load_tables(data, default_mode(data)),
            *reduction_tables(data),
            ("Integration", solver_table(data)),
        ],
        panels=[*_panels(few, runs), *controller_panels(few, runs), *load_panel(few, runs)],
        time=few["time"].values,
        runs=runs,
        selected=runs.index(default_mode(data)),
        film=moving,
        no_film="" if moving else NO_SHAPES,
        notes=[*_unfinished(data, failed or {}), *finding_lines(verdict_of(data))],
        remarks=[valid] if valid else [],
    )


def mode_table(data: xr.Dataset, failed: Mapping[str, str]) -> str:
    """Return the table of the results of every mode."""
    runs = names_of(data, "mode")
    errors_rms, words = headline(data)
    gaps, deflections = errors(data).values, deflections_of(data)
    ranked = gaps[:, during_motion(data["time"].values, data.attrs["motion_end"])] if ranked_by_motion(data) else gaps
    length, bend = display_unit("m", gaps), display_unit("m", deflections)
    after = _after_columns(data)
    motors = names_of(data, "motor")
    torques = [data[name].transpose("mode", "motor").values for name in ("peak_torque", "rms_torque")]
    wide, work, effort = largest(data["end_effector_desired"].values), energy_scale(data), largest(torques[0])
    whole = not failed and bool((data["status"] == "complete").all())
    heads = [
        ("mode", ""), *([] if whole else [("status", "")]),
        ("error", f"RMS [{length.name}]"), ("largest", f"[{length.name}]"),
        *((name, f"[{unit}]") for name, unit, _ in after),
        *((text_symbol(motor), f"[{torque_unit(data)}]") for motor in motors),
        ("deflection", f"largest [{bend.name}]"), ("strain", "energy [J]"),
    ]  # fmt: skip
    rows = []
    for r, name in enumerate(runs):
        one = data.isel(mode=r)
        rows.append((name, [
            *([] if whole else [str(one["status"].item())]),
            number(errors_rms[r].item(), length.factor, beside=wide),
            number(largest(ranked[r]), length.factor, beside=wide),
            *(number(values[r]) for _, _, values in after),
            *("\n".join(number(each, beside=effort) for each in pair)
              for pair in zip(*(each[r] for each in torques), strict=True)),
            _deflection(deflections[r], data["body"].values, bend.factor, wide),
            number(largest(one["strain_energy"].values), beside=work),
        ]))  # fmt: skip
    rows += [(name, ["failed", *[NO_VALUE] * (len(heads) - 2)]) for name in failed]
    kind = "Forces" if torque_unit(data) == "N" else "Torques"
    note = f"Error and largest: {words}. "
    if after:
        note += "Error after: RMS, after the motion; drift: mean speed then; vibration: RMS about the drift. "
        if controller_names(data):
            note += "Settling: until within 5 % of the largest error; overshoot: beyond the end of the path. "
    note += f"{kind}: peak and, below it, RMS. Deflection: from a link's chord. Strain energy: peak."
    if not whole:
        note += " For a mode that stopped early: until then."
    selects = {name: r for r, name in enumerate(runs)}
    return table(heads, rows, caption="What every mode came to", note=note, runs=selects)


def solver_table(data: xr.Dataset) -> str:
    """Return the table of the solver's statistics for every mode, and of its errors in energy and constraints."""
    heads = [
        ("mode", ""), ("imbalance", "energy [J]"), ("constraints", "position [m]"), ("constraints", "velocity [m/s]"),
        ("steps", ""), ("rejected", "steps"), ("iterations", "of Newton"), ("factorisations", ""), ("wall time", "[s]"),
    ]  # fmt: skip
    wide, work = largest(data["end_effector_desired"].values), energy_scale(data)
    counts = ("steps", "rejected", "newton_iterations", "factorisations")
    rows = []
    for r, name in enumerate(names_of(data, "mode")):
        one = data.isel(mode=r)
        rows.append((name, [
            number(one["energy_balance_max"].item(), beside=work),
            number(one["constraint_position_max"].item(), beside=wide),
            number(one["constraint_velocity_max"].item()),
            *(count(one[each].item()) for each in counts),
            number(one["wall_time"].item()),
        ]))  # fmt: skip
    note = "Imbalance: largest, of energy and work. Constraints: largest violation; 0 is below rounding."
    return table(heads, rows, caption="The integration of every mode", note=note)


def _after(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return a fact on the motors after the motion, if runs continue after it."""
    if data["time"].values[-1] <= data.attrs.get("motion_end", np.inf) or "after" not in data.attrs:
        return []
    if asked(data).get("ked"):
        return [("after the motion", "motors held, as all the time")]
    return [("after the motion", "motors held by brakes" if data.attrs["after"] == "hold" else "motors free")]


def _after_columns(data: xr.Dataset) -> list[tuple[str, str, NDArray[np.float64]]]:
    """Return name, unit and values of the results after the motion; empty if runs end with it."""
    columns = []
    for name, key, unit in (
        ("error after", "tracking_rms_after", "m"),
        ("drift", "drift_speed", "m"),
        ("vibration", "residual_vibration", "m"),
        *((("settling", "settling_time", "s"), ("overshoot", "overshoot", "m")) if controller_names(data) else ()),
    ):
        values = data[key].values
        if np.isfinite(values).any():
            shown = display_unit(unit, values)
            columns.append((name, shown.name + ("/s" if key == "drift_speed" else ""), shown.factor * values))
    brakes = data["brake_energy"].values if "brake_energy" in data else np.zeros(1)
    if np.any(brakes > 0.0):
        columns.append(("brakes", "J", brakes))
    return columns


def _panels(data: xr.Dataset, runs: list[str]) -> list[Panel]:
    def of_links(identity: str, title: str, label: str, name: str) -> Chart:
        chart = Chart(identity, title, label, choosing="link")
        return followed(chart, data[name], runs, desired=data[f"{name}_desired"][0])

    condition = Chart(
        "condition", "Condition number of the actuation matrix", "condition number", log=True,
        note="Condition of the matrix from motor torques to forces along the path: it grows without bound towards "
             "positions where the active motors lose control of a direction.",
    )  # fmt: skip
    links = [
        of_links("angles", "Link angles", "angle", "angle"),
        of_links("rates", "Link angular velocities", "angular velocity", "angular_velocity"),
        _phases(data, names_of(data, "body"), runs),
    ]
    if bending(data).size:
        axial = "Displacements of the links' ends along them"
        axial_chart = replace(TIPS, identity="axial", title=axial, y="axial displacement")
        links = [
            followed(TIPS, bending(data), runs),
            followed(axial_chart, bending(data, "tip_axial"), runs),
            *links,
        ]
    return [
        Panel("Following the path", [compared(ERRORS, errors(data), runs), plane_path(data, runs)]),
        Panel("Motors", [
            followed(torque_chart(data), data["torque"], runs),
            compared(condition, data["actuation_condition"], runs),
        ]),
        Panel("Links", links),
        Panel("Energies", [energies(data, runs), compared(STRAIN, data["strain_energy"], runs)]),
    ]  # fmt: skip


def _phases(data: xr.Dataset, bodies: list[str], runs: list[str]) -> Chart:
    """Return the phase diagram, angular velocity over angle; a periodic motion gives a closed curve."""
    angle, rate = data["angle"].values, data["angular_velocity"].values
    way, pace = data["angle_desired"].values[0], data["angular_velocity_desired"].values[0]
    curves = []
    for b in range(len(bodies)):
        curves.append(Curve("desired", pace[:, b], way[:, b], Look(dash=DOTTED), choice=b))
        curves += [
            Curve(run, rate[r, :, b], angle[r, :, b], run=r, shown=(r,), choice=b, look=Look(look(b).colour))
            for r, run in enumerate(runs)
        ]
    return Chart(
        "phases", "Phase diagram", "angular velocity [rad/s]", curves, x="angle [rad]",
        choices=[text_symbol(body) for body in bodies], choosing="link", over_time=False,
    )  # fmt: skip


def _figures(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return the tiles of the main numbers; failed modes come first, and numbers are those of complete modes."""
    rms, words = headline(data)
    whole = finished(data)
    errors_rms = np.where(whole, rms.values, np.nan)
    several = data.sizes["mode"] > 1
    peaks = np.where(whole, [largest(one) for one in data["torque"].values], np.nan)
    tiles = [] if whole.all() else [_broken_off(data, whole)]
    if np.isfinite(errors_rms).any():
        best = int(np.nanargmin(errors_rms))
        value = quantity(errors_rms[best], "m")
        tiles.append((f"{'least ' if several else ''}RMS error {words}", value, _name(data, best)))
    if np.isfinite(peaks).any():
        least = int(np.nanargmin(peaks))
        kind = "force" if torque_unit(data) == "N" else "torque"
        value = f"{number(peaks[least])} {torque_unit(data)}"
        tiles.append((f"least peak {kind}" if several else f"peak {kind}", value, _name(data, least)))
    deflections = np.where(whole, [largest(one) for one in deflections_of(data)], np.nan)
    if np.isfinite(deflections).any() and np.nanmax(deflections) > 0.0:
        most = int(np.nanargmax(deflections))
        tiles.append(("largest deflection", quantity(deflections[most], "m"), _name(data, most)))
    return [*tiles, *load_tiles({name: load_figures(data.sel(mode=name)) for name in names_of(data, "mode")})]


def _broken_off(data: xr.Dataset, whole: NDArray[np.bool_]) -> tuple[str, str, str]:
    """Return the tile of incomplete runs: their number and the times at which they ended."""
    first = np.flatnonzero(~whole)
    ends = [float(data["time"].values[max(samples(data.isel(mode=r)) - 1, 0)]) for r in first]
    word = str(data["status"].values[first[0]])
    value = f"{first.size} of {whole.size} modes" if whole.size > 1 else f"at {ends[0]:.3g} s"
    of = f"from t = {min(ends):.3g} s on" if whole.size > 1 else _name(data, int(first[0]))
    return word, value, f"{of}, of {data['time'].values[-1]:g} s"


def _name(data: xr.Dataset, run: int) -> str:
    return f"mode {data['mode'].values[run]}"


def _unfinished(data: xr.Dataset, failed: Mapping[str, str]) -> list[str]:
    """Return the reasons why modes failed or ended early."""
    out = [f"Mode {name} could not be run: {reason}" for name, reason in failed.items()]
    for r, name in enumerate(data["mode"].values):
        status = str(data["status"].values[r])
        if status != "complete":
            part = "" if status in DONE_STATUSES else ". Its curves and numbers are of the part before"
            out.append(f"Mode {name}: {status}. {data['message'].values[r]}{part}".rstrip())
    return out


def _model(run: Mapping[str, object]) -> str:
    if run.get("rigid"):
        return "rigid links"
    if run.get("ked"):
        return "kineto-elastodynamics"
    if run.get("segments"):
        return f"{run['segments']} finite segments on the longest link"
    return f"{run.get('geometry', 'linear')} geometry"


def _deflection(values: NDArray[np.float64], bodies: NDArray[np.str_], factor: float, wide: float) -> str:
    """Return the largest of deflections (samples, bodies) and its body as text; `wide` is the mechanism's size [m]."""
    if not np.isfinite(values).any() or np.nanmax(values) == 0.0:
        return NO_VALUE
    where = int(np.nanargmax(np.nanmax(np.where(np.isfinite(values), values, -1.0), axis=0)))
    return f"{number(largest(values), factor, beside=wide)}\n{text_symbol(str(bodies[where]))}"
