"""Charts and tables of a verification: all models of a mechanism in common charts, and their distances."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import peak, text_symbol
from .charts import Axis, Chart, Curve, look
from .entry import figure
from .run_motion import most_deflected
from .runs import after_motion, check_magnification, round_magnification
from .selection import names_of
from .tables import Column, Table

_NAMES = {
    "ked": "KED",
    "linear": "linear geometry",
    "second-order": "second-order geometry",
    "segments": "finite segments",
    "exudyn": "Exudyn",
    "mujoco": "MuJoCo",
}
_KED = (
    " KED, kineto-elastodynamics: the links' bending as small vibrations about the given rigid motion, which it does "
    "not change; the motors hold the rigid mechanism's angles."
)
# Distances below this are rounding; they would stretch a logarithmic axis [m].
_SMALLEST_DISTANCE = 1e-9
_EFFECTOR, _LINKS, _MOTORS = "End-effector", "Links", "Motors and energies"


def printed(model: str) -> str:
    """Return the name of a model in legends and tables."""
    return _NAMES.get(model, model)


# Charts


@figure("distances of all models from the desired position and from the reference", heading=_EFFECTOR,
        written_as="model_distances", panels="runs")  # fmt: skip
def model_distances(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the end-effector's distance from its desired position and from that in the reference model."""
    reference = str(data.attrs["reference"])
    places, wanted = _places(data)
    datum = names_of(data, "model").index(reference)
    for identity, title, other in (
        ("errors", "the desired position", wanted), ("apart", printed(reference), places[:, datum : datum + 1])
    ):  # fmt: skip
        away = np.linalg.norm(places - other, axis=-1)
        curves = _by_model(data, np.where(away > _SMALLEST_DISTANCE, away, np.nan))
        yield Chart(identity, f"Distance from {title}", Axis("distance", "m", log=True), curves,
                    spans=after_motion(data))  # fmt: skip


@figure(
    "path of the end-effector in two models", paper=23, heading=_EFFECTOR, takes="models", written_as="compared_paths"
)
def compared_paths(data: xr.Dataset, magnification: float | None = None) -> Iterator[Chart]:
    """Yield the chart of the end-effector's paths, with magnified deviations from the desired path.

    Parameters
    ----------
    magnification : float, optional
        Magnification of the deviations; by default a value at which they are visible.
    """
    check_magnification(magnification)
    places, wanted = _places(data)
    desired = wanted[0, 0]
    times = magnification
    if times is None:
        times = round_magnification((places - desired).reshape(-1, 2), float(np.ptp(desired, axis=0).max()))
    word = "desired" if times == 1.0 else f"desired, deviations from it × {times:g}"
    x, y = np.moveaxis(desired + times * (places - desired), -1, 0)
    curves = [*_by_model(data, y, x), Curve(word, desired[:, 1], desired[:, 0], desired=True),
              Curve("start", desired[:1, 1], desired[:1, 0], mark="square")]  # fmt: skip
    yield Chart("path", "End-effector paths", Axis("y", "m"), curves, Axis("x", "m"), equal=True)


@figure(
    "angle and speed of links in two models", paper=22, heading=_LINKS, takes="models", written_as="compared_links",
    panels="choices", height=21.5,
)  # fmt: skip
def compared_links(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the angle and the angular velocity of every link.

    A link's angle is that of the line from its first end to its last, which every model has.
    """
    yield _of_parts(data, "angles", "Link angles", Axis("angle", "rad", "φ"), data["chord_angle"])
    yield _of_parts(data, "rates", "Link angular velocities", Axis("angular velocity", "rad/s", "φ̇"),
                    data["chord_velocity"])  # fmt: skip


@figure("angle and speed of links in all models, relative to the reference", heading=_LINKS, takes="mode",
        panels="choices", height=21.5)  # fmt: skip
def link_differences(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the difference of every link's angle and angular velocity from that in the reference model."""
    for identity, name, axis in (
        ("angle", "angles", Axis("difference of angle", "rad", "Δφ")),
        ("velocity", "angular velocities", Axis("difference of angular velocity", "rad/s", "Δφ̇")),
    ):
        values, reference = data[f"chord_{identity}"], str(data.attrs["reference"])
        title = f"Link {name}, difference from {printed(reference)}"
        yield _of_parts(data, f"{identity}_differences", title, axis,
                        values - values.sel(model=reference, drop=True))  # fmt: skip


@figure("transverse displacement of links' ends in all models", heading=_LINKS, takes="mode", panels="choices",
        members=2, height=44.0, variables=("tip_transverse",))  # fmt: skip
def compared_deflections(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the transverse tip displacement of links in every model, the most deflected links first."""
    values, bodies = data["tip_transverse"], names_of(data, "body")
    if peak(values.values):
        first = most_deflected(data.sel(model=str(data.attrs["reference"])))
        values = values.sel(body=[*first, *(name for name in bodies if name not in first)])
        yield _of_parts(data, "tips", "Transverse displacements of links' ends", Axis("transverse displacement", "m"),
                        values)  # fmt: skip


@figure("torques of motors in all models", heading=_MOTORS, takes="mode", panels="choices", variables=("torque",))
def compared_torques(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the torque of every motor."""
    unit = str(data["torque"].attrs.get("units", "N m"))
    yield _of_parts(data, "torques", "Motor torques", Axis("torque", unit, "τ"), data["torque"], "motor")


@figure("kinetic and strain energy in all models", heading=_MOTORS, takes="mode",
        variables=("kinetic_energy", "strain_energy"))  # fmt: skip
def compared_energies(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the kinetic and the strain energy."""
    for name in ("kinetic", "strain"):
        values = data[f"{name}_energy"].transpose("mode", "model", "time").values
        yield Chart(name, f"{name.capitalize()} energy", Axis(f"{name} energy", "J"), _by_model(data, values),
                    spans=after_motion(data))  # fmt: skip


def _of_parts(
    data: xr.Dataset, identity: str, title: str, axis: Axis, values: xr.DataArray, choosing: str = "link"
) -> Chart:
    """Return a chart of values (mode, model, time, part) in all models, one part at a time."""
    values = values.transpose("mode", "model", "time", ...)
    shown = values.values
    extent = peak(np.fmax.reduce(shown, axis=2) - np.fmin.reduce(shown, axis=2))
    curves = [curve for k in range(shown.shape[3]) for curve in _by_model(data, shown[..., k], choice=k)]
    choices = list(map(text_symbol, names_of(values, str(values.dims[3]))))
    return Chart(identity, title, replace(axis, extent=extent), curves, choices=choices, choosing=choosing,
                 spans=after_motion(data))  # fmt: skip


def _by_model(data: xr.Dataset, y: Array, x: Array | None = None, choice: int | None = None) -> list[Curve]:
    """Return the curves of values (modes, models, samples): those of all models in the mode of the selected run."""
    known = np.all(np.isfinite(_places(data)[0]), axis=-1)
    models = names_of(data, "model")
    return [
        Curve(
            printed(model), y[m, k], None if x is None else x[m, k], look(k), run=runs_of_mode(data, m)[k],
            shown=runs_of_mode(data, m), choice=choice, stopped=bool(known[m, k].any() and not known[m, k].all()),
        )
        for m in range(len(y)) for k, model in enumerate(models)
    ]  # fmt: skip


def _places(data: xr.Dataset) -> tuple[Array, Array]:
    """Return actual and desired positions of the end-effector (modes, models, samples, 2) [m]."""
    actual, desired = (data[f"end_effector{which}"].transpose("mode", "model", "time", "axis").values
                       for which in ("", "_desired"))  # fmt: skip
    return actual, desired


def runs_of_mode(data: xr.Dataset, mode: int) -> tuple[int, ...]:
    """Return the numbers of the runs of all models in a mode, by its number."""
    count = data.sizes["model"]
    return tuple(range(mode * count, (mode + 1) * count))


# Tables


def model_table(
    summary: Mapping[str, Any], mode: str, extent: float = 0.0, runs: Mapping[str, int] | None = None
) -> Table:
    """Return the table of all models in a mode, from the summary of `studies.agreement`.

    Parameters
    ----------
    extent : float
        Largest coordinate of the desired path [m], the scale of rounding errors.
    runs : mapping of str to int, optional
        Runs of a page by the printed name of the model.
    """
    models, reference = summary["modes"][mode]["models"], printed(summary["reference"])
    whole = all(one["status"] == "complete" for one in models.values())

    def of(key: str) -> list[Any]:
        return [one.get(key) for one in models.values()]

    return Table(f"Models, mode {mode}", [
        Column("model", list(map(printed, models))),
        *([] if whole else [Column("status", of("status"))]),
        *(Column(name, of(key), unit, beside=extent if unit == "m" else 0.0) for name, key, unit in (
            ("tracking error", "tracking_error", "m"), ("largest distance", "distance_max", "m"),
            ("RMS distance", "distance_rms", "m"), ("change with finer step", "change_with_finer_step", "m"),
            ("change with finer mesh", "change_with_finer_mesh", "m"), ("energy imbalance", "energy_balance_max", "J"),
            ("constraint violation", "constraint_position_max", "m"), ("steps", "steps", ""),
            ("wall time", "wall_time", "s"),
        )),
        Column("method", [one.get("method", "") for one in models.values()]),
    ], f"Distances are from the path of {reference}.{_KED if 'ked' in models else ''}", runs).filled()  # fmt: skip


def distance_table(summary: Mapping[str, Any], mode: str, extent: float = 0.0) -> Table:
    """Return the table of the largest distances between the paths of two models in a mode."""
    distances = summary["modes"][mode]["distances"]
    return Table(f"Distances of paths, mode {mode}", [
        Column("", list(map(printed, distances))),
        *(Column(printed(b), [None if a == b else distances[a][b] for a in distances], "m", beside=extent, digits=3)
          for b in distances),
    ], "Largest distance between the paths of two models.").in_one_unit()  # fmt: skip


def link_tables(summary: Mapping[str, Any], mode: str) -> Iterator[Table]:
    """Yield tables of the RMS difference of every link's angle and angular velocity from the reference in a mode."""
    links: Sequence[str] = summary["links"]
    models = {name: one for name, one in summary["modes"][mode]["models"].items()
              if name != summary["reference"] and "angle_difference_rms" in one}  # fmt: skip
    for key, word, unit in (("angle", "angles", "rad"), ("angular_velocity", "angular velocities", "rad/s")):
        if models:
            yield Table(f"Difference of {word} from {printed(summary['reference'])}, mode {mode}", [
                Column("link", links),
                *(Column(printed(name), [one[f"{key}_difference_rms"][link] for link in links], unit, digits=3)
                  for name, one in models.items()),
            ], "RMS over time.").in_one_unit()  # fmt: skip


def path_extent(data: xr.Dataset | None) -> float:
    """Return the largest coordinate of the desired path [m]; 0 without data."""
    return 0.0 if data is None else peak(data["end_effector_desired"].values)
