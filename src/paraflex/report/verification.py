"""The report of a verification: all models of one mechanism, overlaid, and how far they are apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.findings import Finding
from paraflex.plots.agreement import printed
from paraflex.plots.labels import display_unit, text_symbol
from paraflex.plots.workspace import round_magnification
from paraflex.report.curves import TIP_LABEL, TIP_TITLE, look, thinned
from paraflex.report.film import NO_SHAPES, animation
from paraflex.report.page import Chart, Curve, Page, Panel
from paraflex.report.provenance import asked, common_facts, verify_command_line
from paraflex.report.text import NOTHING, count, number, table
from paraflex.report.tracking import errors, torque_unit
from paraflex.results.doubts import doubt_lines
from paraflex.results.following import SPAN_WORDS, ErrorSpan
from paraflex.results.kinds import check_kind

_ENGINES = ("exudyn", "mujoco")
# Distances below this are rounding; they would stretch a logarithmic axis [m].
_SHORTEST = 1e-9


class _Runs:
    """Which runs there are: every model in every mode, modes first."""

    def __init__(self, data: xr.Dataset) -> None:
        self.modes = [str(name) for name in data["mode"].values]
        self.models = [str(name) for name in data["model"].values]
        several = len(self.modes) > 1
        self.names = [
            f"{mode}, {printed(model)}" if several else printed(model) for mode in self.modes for model in self.models
        ]

    def of_mode(self, mode: int) -> tuple[int, ...]:
        """All runs of a mode."""
        return tuple(mode * len(self.models) + k for k in range(len(self.models)))

    def array(self, values: xr.DataArray) -> NDArray[np.float64]:
        """Values (modes, models, samples, ...)."""
        return values.transpose("mode", "model", "time", ...).values

    def overlaid(self, values: NDArray[np.float64], choice: int | None = None, factor: float = 1.0) -> list[Curve]:
        """Curves of values (modes, models, samples): all models of the selected run's mode."""
        return [
            Curve(printed(model), factor * values[m, k], run=self.of_mode(m)[k], shown=self.of_mode(m), choice=choice,
                  look=look(k))
            for m in range(len(self.modes))
            for k, model in enumerate(self.models)
        ]  # fmt: skip


@checked_arguments()
def verification_page(data: xr.Dataset, figures: Mapping[str, Any]) -> Page:
    """The report of a verification.

    Parameters
    ----------
    data : xarray.Dataset
        From `studies.Verification.dataset`.
    figures : mapping
        From `studies.agreement`: what `verify.json` holds.
    """
    check_kind(data, "verification")
    runs, asked_for = _Runs(data), asked(data)
    reference = str(data.attrs["reference"])
    moving = animation(data, ("mode", "model"))
    few = data.isel(time=thinned(data.sizes["time"]))
    tables = [(f"Models, mode {name}", _models(mode, reference, runs, name)) for name, mode in figures["modes"].items()]
    more = []
    for name, mode in figures["modes"].items():
        more += [
            (f"Largest distance between the paths of two models, mode {name}", _distances(mode)),
            (f"Difference from {printed(reference)}, mode {name}", _differences(mode, figures["links"], reference)),
        ]
    facts = [(name, value) for name, value in common_facts(data) if name != "integration"]
    return Page(
        title=data.attrs["mechanism"],
        kind="verification",
        subtitle=f"{len(runs.models)} models of one mechanism, path “{asked_for.get('path', '')}”, "
        f"reference: {printed(reference)}",
        facts=facts,
        command=verify_command_line(asked_for, data, _ENGINES),
        figures=_tiles(figures, reference),
        tables=tables,
        more=more,
        panels=_panels(few, runs, reference),
        time=few["time"].values,
        runs=runs.names,
        selecting="model",
        selected=runs.models.index(reference),
        film=moving,
        no_film="" if moving else NO_SHAPES,
        notes=doubt_lines(map(Finding.from_dict, figures.get("verdict", {}).get("findings", [])))
        + [
            f"Mode {name}, {printed(model)}: {one['message']}"
            for name, mode in figures["modes"].items()
            for model, one in mode["models"].items()
            if one["message"]
        ],
    )


def _models(mode: Mapping[str, Any], reference: str, runs: _Runs, name: str) -> str:
    models = mode["models"]
    unit = display_unit("m", np.array([one.get("tracking_error") or np.nan for one in models.values()]))
    heads = [
        ("model", ""), ("status", ""), ("tracking error", f"RMS [{unit.name}]"),
        (f"from {printed(reference)}", "largest, RMS [m]"), ("finer step", "changes it by [m]"),
        ("finer mesh", "changes it by [m]"), ("imbalance", "of energy [J]"), ("steps", ""), ("wall time", "[s]"),
        ("method", ""),
    ]  # fmt: skip
    rows = [
        (printed(model), [
            one["status"],
            number(one.get("tracking_error"), unit.factor),
            f"{number(one.get('distance_max'))}\n{number(one.get('distance_rms'))}",
            number(one.get("change_with_finer_step")),
            number(one.get("change_with_finer_mesh")),
            number(one.get("energy_balance_max")),
            count(one.get("steps")),
            number(one.get("wall_time")),
            one.get("method", ""),
        ])
        for model, one in models.items()
    ]  # fmt: skip
    own = runs.of_mode(runs.modes.index(name)) if name in runs.modes else ()
    selects = {printed(model): run for model, run in zip(runs.models, own, strict=False)}
    return table(heads, rows, caption=f"Every model in mode {name}", runs=selects)


def _distances(mode: Mapping[str, Any]) -> str:
    names = list(mode["distances"])
    rows = [
        (printed(a), [NOTHING if a == b else number(mode["distances"][a][b]) for b in names])
        for a in names
    ]  # fmt: skip
    return table([("[m]", ""), *((printed(name), "") for name in names)], rows, caption="Distances between models")


def _differences(mode: Mapping[str, Any], links: Sequence[str], reference: str) -> str:
    others = [
        name for name, one in mode["models"].items() if name != reference and "angle_difference_rms" in one
    ]  # fmt: skip
    rows = [
        (text_symbol(link), [
            f"{number(mode['models'][name]['angle_difference_rms'][link])}\n"
            f"{number(mode['models'][name]['angular_velocity_difference_rms'][link])}"
            for name in others
        ])
        for link in links
    ]  # fmt: skip
    return table(
        [("link", ""), *((printed(name), "[rad], [rad/s]") for name in others)], rows,
        caption=f"Difference of links from {printed(reference)}",
        note="RMS difference of a link's angle and, below it, of its angular velocity.",
    )  # fmt: skip


def _panels(data: xr.Dataset, runs: _Runs, reference: str) -> list[Panel]:
    datum = runs.models.index(reference)
    places = runs.array(data["end_effector"])
    gaps = np.where((far := errors(data.transpose("mode", "model", "time", ...))) > _SHORTEST, far, np.nan)
    apart = np.linalg.norm(places - places[:, datum : datum + 1], axis=-1)
    apart = np.where(apart > _SHORTEST, apart, np.nan)
    name = printed(reference)
    return [
        Panel("End-effector", [
            _one("errors", "Tracking error: distance from the desired place", "distance", "m", gaps, runs, log=True),
            _one("apart", f"Distance from {name}", "distance", "m", apart, runs, log=True),
            _paths(data, runs),
        ]),
        Panel("Links", [
            _links("angles", "Link angles", "angle", "rad", data, "chord_angle", runs),
            _links("angle_differences", f"Link angles, difference from {name}", "difference", "rad", data,
                   "chord_angle", runs, datum),
            _links("rates", "Link angular velocities", "angular velocity", "rad/s", data, "chord_velocity", runs),
            _links("rate_differences", f"Link angular velocities, difference from {name}", "difference", "rad/s", data,
                   "chord_velocity", runs, datum),
            _links("deflections", TIP_TITLE, TIP_LABEL, "m", data,
                   "tip_transverse", runs),
        ]),
        Panel("Motors and energies", [
            _links("torques", "Motor torques", "torque", torque_unit(data), data, "torque", runs, dim="motor"),
            _one("kinetic", "Kinetic energy", "kinetic energy", "J", runs.array(data["kinetic_energy"]), runs),
            _one("strain", "Strain energy", "strain energy", "J", runs.array(data["strain_energy"]), runs),
        ]),
    ]  # fmt: skip


def _one(
    identity: str, title: str, label: str, unit: str, values: NDArray[np.float64], runs: _Runs, *, log: bool = False
) -> Chart:
    shown = display_unit(unit, values)
    curves = runs.overlaid(values, factor=shown.factor)
    return Chart(identity, title, f"{label} [{shown.name}]", curves, log=log)


def _links(
    identity: str, title: str, label: str, unit: str, data: xr.Dataset, variable: str, runs: _Runs,
    datum: int | None = None, dim: str = "body",
) -> Chart:  # fmt: skip
    """A quantity of one link or motor at a time in all models, or its difference from a model."""
    values = runs.array(data[variable])
    if datum is not None:
        values = values - values[:, datum : datum + 1]
    shown, names = display_unit(unit, values), [str(name) for name in data[dim].values]
    curves = [
        curve for p in range(len(names)) for curve in runs.overlaid(values[..., p], choice=p, factor=shown.factor)
    ]
    return Chart(
        identity, title, f"{label} [{shown.name}]", curves, choices=[text_symbol(name) for name in names],
        choosing="link" if dim == "body" else dim,
    )  # fmt: skip


def _paths(data: xr.Dataset, runs: _Runs) -> Chart:
    """Paths in all models, deviations magnified alike."""
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


def _tiles(figures: Mapping[str, Any], reference: str) -> list[tuple[str, str, str]]:
    """The nearest model to the reference and its distance in the first mode, and how long all took."""
    name, mode = next(iter(figures["modes"].items()))
    apart = {
        model: one["distance_max"] for model, one in mode["models"].items()
        if model != reference and one.get("distance_max") is not None
    }  # fmt: skip
    tiles = []
    for title, pick in (("nearest to the reference", min), ("farthest from it", max)):
        if apart:
            model = pick(apart, key=apart.__getitem__)
            unit = display_unit("m", np.array([apart[model]]))
            tiles.append((title, f"{number(apart[model], unit.factor)} {unit.name}", f"{printed(model)}, mode {name}"))
    error = mode["models"].get(reference, {}).get("tracking_error")
    if error is not None:
        unit = display_unit("m", np.array([error]))
        span = SPAN_WORDS[ErrorSpan(figures.get("error", ErrorSpan.WHOLE.value))]
        tiles.append((f"RMS error {span}", f"{number(error, unit.factor)} {unit.name}", printed(reference)))
    whole = all(one["status"] == "complete" for by in figures["modes"].values() for one in by["models"].values())
    tiles.append(("models", str(len(mode["models"])), "all complete" if whole else "not all complete"))
    return tiles
