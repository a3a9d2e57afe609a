"""Report of a verification: all models of one mechanism in common charts, and their distances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.findings import Finding
from paraflex.plots.agreement import printed
from paraflex.plots.labels import display_unit, text_symbol
from paraflex.plots.selection import names_of
from paraflex.plots.workspace import round_magnification
from paraflex.report.curves import TIPS, errors, labelled, largest, look, thinned
from paraflex.report.film import NO_SHAPES, animation
from paraflex.report.page import Chart, Curve, Page, Panel
from paraflex.report.provenance import asked, common_facts, summary_beside, verdict_word, verify_command_line
from paraflex.report.text import NO_VALUE, common_unit, count, number, quantity, table
from paraflex.results.findings import finding_lines
from paraflex.results.following import SPAN_WORDS, ErrorSpan
from paraflex.results.kinds import check_kind

_ENGINES = ("exudyn", "mujoco")
# Distances below this are rounding; they would stretch a logarithmic axis [m].
_SMALLEST_DISTANCE = 1e-9
_KED = (
    "KED, kineto-elastodynamics: the links' bending as small vibrations about the given rigid motion, which it does "
    "not change; the motors hold the rigid mechanism's angles."
)


class _Runs:
    """Runs of every model in every mode, ordered by mode."""

    def __init__(self, data: xr.Dataset) -> None:
        self.modes, self.models = names_of(data, "mode"), names_of(data, "model")
        several = len(self.modes) > 1
        self.names = [
            f"{mode}, {printed(model)}" if several else printed(model) for mode in self.modes for model in self.models
        ]

    def of_mode(self, mode: int) -> tuple[int, ...]:
        """Return the indices of all runs of a mode."""
        return tuple(mode * len(self.models) + k for k in range(len(self.models)))

    def array(self, values: xr.DataArray) -> NDArray[np.float64]:
        """Return values as an array (modes, models, samples, ...)."""
        return values.transpose("mode", "model", "time", ...).values

    def overlaid(self, chart: Chart, values: NDArray[np.float64], unit: str) -> Chart:
        """Return a chart of values (modes, models, samples) that shows all models in the mode of the selected run.

        If the chart has choices, values have a last axis for them.
        """
        shown = display_unit(unit, values)
        values = shown.factor * values
        parts = [(k, values[..., k]) for k in range(len(chart.choices))] if chart.choices else [(None, values)]
        curves = [
            Curve(
                printed(model), part[m, k], run=self.of_mode(m)[k], shown=self.of_mode(m), choice=choice, look=look(k)
            )
            for choice, part in parts
            for m in range(len(self.modes))
            for k, model in enumerate(self.models)
        ]
        return replace(chart, y=labelled(chart.y, shown.name), curves=curves)


def report_of_folder(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a verification with the summary in its folder."""
    return verification_page(data, summary_beside(folder / "verify.json"))


@checked_arguments()
def verification_page(data: xr.Dataset, summary: Mapping[str, Any]) -> Page:
    """Return the report of a verification.

    Parameters
    ----------
    data : xarray.Dataset
        Results from `studies.Verification.dataset`.
    summary : mapping
        Summary from `studies.agreement`, the content of `verify.json`.
    """
    check_kind(data, "verification")
    runs, asked_for = _Runs(data), asked(data)
    reference = str(data.attrs["reference"])
    moving = animation(data, ("mode", "model"))
    few = thinned(data)
    wide = largest(data["end_effector_desired"].values)
    more = [
        (f"Models, mode {name}", _models(mode, reference, runs, name, wide)) for name, mode in summary["modes"].items()
    ]
    for name, mode in summary["modes"].items():
        more += [
            (f"Distances of paths, mode {name}", _distances(mode, wide)),
            (f"Difference from {printed(reference)}, mode {name}", _differences(mode, summary["links"], reference)),
        ]
    facts = [(name, value) for name, value in common_facts(data) if name != "integration"]
    return Page(
        title=data.attrs["mechanism"],
        kind="verification",
        subtitle=f"{len(runs.models)} models of one mechanism, path “{asked_for.get('path', '')}”, "
        f"reference: {printed(reference)}",
        verdict=summary.get("verdict", {}).get("level", verdict_word(data)),
        facts=facts,
        command=verify_command_line(asked_for, data, _ENGINES),
        figures=_tiles(summary, reference),
        more=more,
        panels=_panels(few, runs, reference),
        time=few["time"].values,
        runs=runs.names,
        selecting="model",
        selected=runs.models.index(reference),
        film=moving,
        no_film="" if moving else NO_SHAPES,
        notes=finding_lines(map(Finding.from_dict, summary.get("verdict", {}).get("findings", [])))
        + [
            f"Mode {name}, {printed(model)}: {one['message']}"
            for name, mode in summary["modes"].items()
            for model, one in mode["models"].items()
            if one["message"]
        ],
    )


def _models(mode: Mapping[str, Any], reference: str, runs: _Runs, name: str, wide: float) -> str:
    """Return the table of all models in a mode; `wide` is the largest coordinate of the desired path [m]."""
    models = mode["models"]
    unit, away, finer, meshed = (
        common_unit("m", [one.get(key) for one in models.values() for key in keys], beside=wide)
        for keys in (
            ("tracking_error",), ("distance_max", "distance_rms"), ("change_with_finer_step",),
            ("change_with_finer_mesh",),
        )
    )  # fmt: skip
    whole = all(one["status"] == "complete" for one in models.values())
    heads = [
        ("model", ""), *([] if whole else [("status", "")]), ("tracking error", f"RMS [{unit.name}]"),
        (f"from {printed(reference)}", f"largest, RMS [{away.name}]"),
        ("finer step", f"changes it by [{finer.name}]"),
        ("finer mesh", f"changes it by [{meshed.name}]"), ("imbalance", "of energy [J]"), ("steps", ""),
        ("wall time", "[s]"), ("method", ""),
    ]  # fmt: skip
    rows = [
        (printed(model), [
            *([] if whole else [one["status"]]),
            number(one.get("tracking_error"), unit.factor, beside=wide),
            "\n".join(number(one.get(key), away.factor, beside=wide) for key in ("distance_max", "distance_rms")),
            number(one.get("change_with_finer_step"), finer.factor, beside=wide),
            number(one.get("change_with_finer_mesh"), meshed.factor, beside=wide),
            number(one.get("energy_balance_max")),
            count(one.get("steps")),
            number(one.get("wall_time")),
            one.get("method", ""),
        ])
        for model, one in models.items()
    ]  # fmt: skip
    own = runs.of_mode(runs.modes.index(name)) if name in runs.modes else ()
    selects = {printed(model): run for model, run in zip(runs.models, own, strict=False)}
    note = _KED if "ked" in models else ""
    return table(heads, rows, caption=f"Every model in mode {name}", note=note, runs=selects)


def _distances(mode: Mapping[str, Any], wide: float) -> str:
    distances = mode["distances"]
    names = list(distances)
    unit = common_unit("m", [distances[a][b] for a in names for b in names if a != b], beside=wide)
    rows = [
        (printed(a), [NO_VALUE if a == b else number(distances[a][b], unit.factor, beside=wide) for b in names])
        for a in names
    ]  # fmt: skip
    heads = [(f"[{unit.name}]", ""), *((printed(name), "") for name in names)]
    note = "Largest distance between the paths of two models."
    return table(heads, rows, caption="Distances between models", note=note)


def _differences(mode: Mapping[str, Any], links: Sequence[str], reference: str) -> str:
    others = [
        name for name, one in mode["models"].items() if name != reference and "angle_difference_rms" in one
    ]  # fmt: skip
    keys = {"rad": "angle_difference_rms", "rad/s": "angular_velocity_difference_rms"}
    angle, rate = (
        common_unit(unit, [mode["models"][name][key][link] for name in others for link in links])
        for unit, key in keys.items()
    )
    rows = [
        (text_symbol(link), [
            "\n".join(number(mode["models"][name][key][link], shown.factor)
                      for key, shown in zip(keys.values(), (angle, rate), strict=True))
            for name in others
        ])
        for link in links
    ]  # fmt: skip
    return table(
        [("link", ""), *((printed(name), f"[{angle.name}], [{rate.name}]") for name in others)], rows,
        caption=f"Difference of links from {printed(reference)}",
        note="RMS difference of a link's angle and, below it, of its angular velocity.",
    )  # fmt: skip


def _panels(data: xr.Dataset, runs: _Runs, reference: str) -> list[Panel]:
    datum, name = runs.models.index(reference), printed(reference)

    def of_parts(chart: Chart, variable: str, *, difference: bool = False) -> Chart:
        """Return a chart of one link or motor at a time in all models, or of its difference from the reference."""
        values = runs.array(data[variable])
        parts = [text_symbol(part) for part in names_of(data, "motor" if variable == "torque" else "body")]
        values = values - values[:, datum : datum + 1] if difference else values
        return runs.overlaid(replace(chart, choices=parts), values, data[variable].attrs["units"])

    def of_links(identity: str, title: str, label: str, variable: str) -> list[Chart]:
        chart = Chart(identity, title, label, choosing="link")
        apart = replace(
            chart, identity=identity[:-1] + "_differences", title=f"{title}, difference from {name}", y="difference"
        )
        return [of_parts(chart, variable), of_parts(apart, variable, difference=True)]

    def of_energy(identity: str, name: str) -> Chart:
        values = runs.array(data[f"{identity}_energy"])
        return runs.overlaid(Chart(identity, f"{name} energy", f"{name.lower()} energy"), values, "J")

    places = runs.array(data["end_effector"])
    far = errors(data.transpose("mode", "model", "time", ...)).values
    apart = np.linalg.norm(places - places[:, datum : datum + 1], axis=-1)
    far, apart = (np.where(one > _SMALLEST_DISTANCE, one, np.nan) for one in (far, apart))
    far_chart = Chart("errors", "Tracking error: distance from the desired place", "distance", log=True)
    apart_chart = Chart("apart", f"Distance from {name}", "distance", log=True)
    return [
        Panel("End-effector", [
            runs.overlaid(far_chart, far, "m"),
            runs.overlaid(apart_chart, apart, "m"),
            _paths(data, runs),
        ]),
        Panel("Links", [
            *of_links("angles", "Link angles", "angle", "chord_angle"),
            *of_links("rates", "Link angular velocities", "angular velocity", "chord_velocity"),
            of_parts(replace(TIPS, note=""), "tip_transverse"),
        ]),
        Panel("Motors and energies", [
            of_parts(Chart("torques", "Motor torques", "torque", choosing="motor"), "torque"),
            of_energy("kinetic", "Kinetic"),
            of_energy("strain", "Strain"),
        ]),
    ]  # fmt: skip


def _paths(data: xr.Dataset, runs: _Runs) -> Chart:
    """Return the chart of the paths in all models, with one magnification of deviations."""
    desired = 1e3 * runs.array(data["end_effector_desired"])[0, 0]
    places = 1e3 * runs.array(data["end_effector"])
    times = round_magnification((places - desired).reshape(-1, 2), float(np.ptp(desired, axis=0).max()))
    drawn = desired + times * (places - desired)
    curves = [Curve("desired", desired[:, 1], desired[:, 0])]
    for m in range(len(runs.modes)):
        for k, model in enumerate(runs.models):
            x, y = drawn[m, k].T
            curves.append(Curve(printed(model), y, x, look(k), run=runs.of_mode(m)[k], shown=runs.of_mode(m)))
    note = f"Deviations from the desired path are magnified {times:g} times." if times > 1.0 else ""
    return Chart("path", "End-effector paths", "y [mm]", curves, x="x [mm]", equal=True, over_time=False, note=note)


def _tiles(summary: Mapping[str, Any], reference: str) -> list[tuple[str, str, str]]:
    """Return the tiles: nearest and farthest model and the error of the reference in the first mode, number of models.

    Distances are from the reference model.
    """
    name, mode = next(iter(summary["modes"].items()))
    apart = {
        model: one["distance_max"] for model, one in mode["models"].items()
        if model != reference and one.get("distance_max") is not None
    }  # fmt: skip
    error = mode["models"].get(reference, {}).get("tracking_error")
    unit = common_unit("m", [*apart.values(), error])
    tiles = []
    for title, pick in (("nearest to the reference", min), ("farthest from it", max)):
        if apart:
            model = pick(apart, key=apart.__getitem__)
            tiles.append((title, quantity(apart[model], "m", unit), f"{printed(model)}, mode {name}"))
    if error is not None:
        span = SPAN_WORDS[ErrorSpan(summary.get("error", ErrorSpan.WHOLE.value))]
        tiles.append((f"RMS error {span}", quantity(error, "m", unit), printed(reference)))
    whole = all(one["status"] == "complete" for by in summary["modes"].values() for one in by["models"].values())
    tiles.append(("models", str(len(mode["models"])), "all complete" if whole else "not all complete"))
    return tiles
