"""Charts of every run over time: motion and deflections of links, energies, motion of named points."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import peak, text_symbol
from paraflex.results.kinematics import KINEMATICS
from paraflex.units import EFFORTS
from .charts import DOTTED, Axis, Chart, Curve, Look, look
from .entry import figure
from .kinematics import special_points
from .runs import compared, followed, of_names, ranges, run_names, stopped_runs
from .selection import apart, names_of, place_of, point_number

ANGLE = Axis("angle", "rad", "φ")
ANGLES = Chart("angles", "Angles", ANGLE, choosing="link")
RATES = Chart("rates", "Angular velocities", Axis("angular velocity", "rad/s", "φ\u0307"), choosing="link")
ENERGY = Axis("energy", "J", zero=True)
# A point that moves less than this fraction of the largest motion is at rest.
_STILL_SHARE = 1e-3
# Largest number of points that are shown where none are named.
_MOST_POINTS = 7
# Largest numbers of points whose paths a chart shows, and of points times runs whose components a page shows.
_MOST_PATHS, _MOST_ROWS = 60, 12
# Ratio of peak tip displacements above which bodies count as twins of a symmetric mechanism and are shown once.
_ALIKE = 0.9
# Bound of rounding errors, as a share of the largest energy.
_ROUNDING = 1e-12
# Displacements of ends differ from deflections, which are measured from a link's chord.
_TIPS = "Distance of a link's last end from the tangent at its first end."
_LINKS, _POINTS = "Links", "Points"


@figure(
    "transverse displacement of the ends of all links", heading=_LINKS, takes="mode", height=56.0,
    missing=("no body of these results bends", "choose another figure, or run the mechanism with flexible links"),
)  # fmt: skip
def link_deflections(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the transverse displacements of the links' last ends over time.

    They are measured from the tangent at each link's first end. Links that do not bend are left out.
    """
    bent = [k for k, name in enumerate(names_of(data, "body")) if peak(data["tip_transverse"].sel(body=name))]
    if bent:
        chart = Chart("deflections", "Displacements of the links' ends across them",
                      Axis("transverse displacement", "m"), choosing="link", note=_TIPS)  # fmt: skip
        yield followed(chart, data, data["tip_transverse"].isel(body=bent))


@figure(
    "axial and transverse displacement and slope of links' ends", paper=13, heading=_LINKS, takes="mode",
    written_as="tip_deflections", written_with=("end_effector_desired",), panels="choices", height=34.0,
    variables=("tip_axial", "tip_slope"),
    defaults=lambda data: {"bodies": most_deflected(data)},
)  # fmt: skip
def tip_deflections(data: xr.Dataset, bodies: Sequence[str] | None = None) -> Iterator[Chart]:
    """Yield charts of axial and transverse displacement and slope of the links' last ends over time (Fig. 13).

    They are measured from the tangent at each link's first end.

    Parameters
    ----------
    bodies : sequence of str, optional
        Bodies; by default all that bend. The printed figure by default shows the two with the largest transverse tip
        displacements, twins of a symmetric mechanism counted once.
    """
    known = names_of(data, "body")
    for name in bodies or ():
        place_of(name, known, "body", "bodies")
    chosen = [name for name in known if _bends(data, name)] if bodies is None else list(bodies)
    for identity, variable, axis, title in (
        ("axial", "tip_axial", Axis("axial displacement", "m"), "Displacements of the links' ends along them"),
        ("transverse", "tip_transverse", Axis("transverse displacement", "m"), "Displacements across the links"),
        ("slopes", "tip_slope", Axis("slope", "rad"), "Slopes of the links' ends"),
    ):
        if chosen:
            values = data[variable].sel(body=chosen)
            chart = Chart(identity, title, replace(axis, extent=peak(values)), choosing="link", note=_TIPS,
                          on_page=identity == "axial")  # fmt: skip
            yield followed(chart, data, values)


def _bends(data: xr.Dataset, name: str) -> bool:
    return any(peak(data[variable].sel(body=name)) > 0.0 for variable in ("tip_axial", "tip_transverse", "tip_slope"))


def most_deflected(data: xr.Dataset) -> list[str]:
    """Return the two bodies with the largest transverse tip displacements, in the order of the mechanism.

    Twins of a symmetric mechanism are counted once, unless there are no others. Bodies that do not bend are left out,
    unless none bends.
    """
    peaks = {name: peak(data["tip_transverse"].sel(body=name)) for name in names_of(data, "body")}
    chosen: list[str] = []
    rest = dict(peaks)
    while rest and len(chosen) < 2:
        alike = [name for name in rest if rest[name] >= _ALIKE * max(rest.values())]
        chosen.append(alike[0])
        rest = {name: value for name, value in rest.items() if name not in alike}
    ranked = sorted((name for name in peaks if name not in chosen), key=lambda name: -peaks[name])
    chosen += ranked[: 2 - len(chosen)]
    chosen = [name for name in peaks if name in chosen]
    return [name for name in chosen if _bends(data, name)] or chosen[:1]


@figure(
    "angle, speed and acceleration of links, desired and actual", paper=14, heading=_LINKS, takes="mode",
    written_as="link_motions", written_with=("angle_desired",), panels="choices", height=21.5,
)  # fmt: skip
def link_motions(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of angle, angular velocity and angular acceleration of every link, desired and actual (Fig. 14)."""
    accelerations = Chart("accelerations", "Angular accelerations", Axis("angular acceleration", "rad/s²", "φ\u0308"),
                          choosing="link", on_page=False)  # fmt: skip
    for chart, name in (
        (ANGLES, "angle"),
        (RATES, "angular_velocity"),
        (accelerations, "angular_acceleration"),
    ):
        if name in data:
            desired = data[f"{name}_desired"][0] if f"{name}_desired" in data else None
            extent = peak(ranges((data[name][0] if desired is None else desired).values))
            yield followed(replace(chart, y=replace(chart.axis(None), extent=extent)), data, data[name], desired)


@figure("angular velocity over angle of every body", heading=_LINKS, takes="mode", panels="choices", columns=4,
        height=34.0)  # fmt: skip
def link_phases(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the phase diagram, angular velocity over angle; a periodic motion gives a closed curve."""
    angle, rate = (data[name].values for name in ("angle", "angular_velocity"))
    curves = []
    desired = [data[f"{name}_desired"].values[0] for name in ("angle", "angular_velocity") if "angle_desired" in data]
    for b in range(data.sizes["body"]):
        curves += of_member(data, b, [angle[..., b], rate[..., b]], [each[:, b] for each in desired])
    yield Chart(
        "phases", "Phase diagram", replace(RATES.axis(None), extent=peak(rate)), curves,
        replace(ANGLE, extent=peak(angle)), [text_symbol(body) for body in names_of(data, "body")], choosing="link",
    )  # fmt: skip


def of_member(
    data: xr.Dataset, choice: int, actual: Sequence[Array], desired: Sequence[Array], point: str | None = None,
    starts_as_desired: bool = False,
) -> Iterator[Curve]:  # fmt: skip
    """Yield the curves of a quantity of one member over time, or of the second of two over the first.

    Parameters
    ----------
    data : xarray.Dataset
        Runs, see `selection.as_runs`.
    choice : int
        Choice of the chart that shows the member.
    actual : sequence of (runs, samples) array
        Values of one or two quantities in all runs. Where a curve over another quantity starts, it has a mark.
    desired : sequence of (samples,) array
        Desired values; empty if there are none.
    point : str, optional
        Point in place of the end-effector.
    starts_as_desired : bool, default False
        Whether the mark is at the start of the desired values, if there are any, in place of the actual ones.
    """
    for r, stopped in enumerate(stopped_runs(data)):
        *x, y = (each[r] for each in actual)
        yield Curve(actual_name(data, r, point), y, *x, look=look(0), run=r, shown=(r,), choice=choice, stopped=stopped)
        if x:
            yield start_mark(*((starts_as_desired and desired) or [*x, y]), run=r, choice=choice)
    if desired:
        *x, y = desired
        yield Curve("desired", y, *x, look=Look(dash=DOTTED), choice=choice, desired=True)


def start_mark(x: Array, y: Array, run: int, choice: int | None = None) -> Curve:
    """Return the mark at the first point of a curve of a run."""
    return Curve("start", y[:1], x[:1], shown=(run,), choice=choice, mark="square")


def actual_name(data: xr.Dataset, run: int, point: str | None = None) -> str:
    """Return the name of the actual motion of the end-effector, or of a point; with the mode if there is one run."""
    names = [point or "actual", *(run_names(data) if data.sizes["mode"] == 1 else [])]
    return ", ".join(filter(None, names))


@figure("kinetic and strain energy, work, and error of the energy balance", heading="Energies", takes="mode",
        variables=("kinetic_energy", "strain_energy", "work"), height=34.0)  # fmt: skip
def energies(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of kinetic and strain energy and the work done on the mechanism; strain energy; the imbalance.

    The imbalance is |kinetic + strain energy - their initial values - work|, at the samples. Strain energy and
    imbalance have no chart if they are zero throughout.
    """
    kinetic, strain, work = (data[name].values for name in ("kinetic_energy", "strain_energy", "work"))
    yield energy_chart(data)
    if peak(strain):
        yield strain_chart(data)
    imbalance = np.abs(kinetic + strain - kinetic[:, :1] - strain[:, :1] - work)
    # Rounding errors would extend the logarithmic axis.
    imbalance = np.where(imbalance > _ROUNDING * peak([kinetic, strain, work]), imbalance, np.nan)
    if peak(imbalance):
        chart = Chart("imbalance", "Imbalance", Axis("energy", "J", log=True), on_page=False)
        yield compared(chart, data, data["work"].copy(data=imbalance))


def strain_chart(data: xr.Dataset) -> Chart:
    """Return the chart of the strain energy of all runs."""
    return compared(Chart("strain", "Strain energy", replace(ENERGY, zero=False)), data, data["strain_energy"])


def energy_chart(data: xr.Dataset) -> Chart:
    """Return the chart of kinetic and strain energy and of the work done on the mechanism in the selected run."""
    names = {"kinetic_energy": "kinetic energy", "strain_energy": "strain energy", "work": "work done on it"}
    chart = Chart("energies", "Energies", ENERGY)
    return of_names(chart, data, [(label, data[name].values) for name, label in names.items()])


@figure(
    "distance from the start, speed and acceleration of named points", takes="mode", points="points", height=34.0,
    variables=("point_velocity", "point_acceleration"),
)  # fmt: skip
def point_motions(data: xr.Dataset, points: Sequence[str] = ()) -> Iterator[Chart]:
    """Yield charts of distance from the start, speed and magnitude of acceleration of named points over time.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run.
    points : sequence of str
        Points "body.point" to plot; by default the end-effector and the points that travel most, up to seven.
    """
    shown, names = points_of(data, points), names_of(data, "point")
    place, velocity, acceleration = (
        data[name].transpose("mode", "time", "point", "axis").values[:, :, shown]
        for name in ("point_position", "point_velocity", "point_acceleration")
    )
    for values, title, axis in (
        (place - place[:, :1], "Distance from the start", Axis("distance", "m")),
        (velocity, "Speed", Axis("speed", "m/s")),
        (acceleration, "Acceleration", Axis("acceleration", "m/s²")),
    ):
        sizes = np.linalg.norm(values, axis=-1)
        chart = Chart(f"points-{axis.name}", title, replace(axis, extent=peak(sizes)))
        yield of_names(chart, data, [(names[k], sizes[:, :, j]) for j, k in enumerate(shown)])


@figure(
    "x and y of position, velocity and acceleration of named points", heading=_POINTS, takes="mode", points="points",
    panels="choices", members=4, height=33.0, variables=("point_velocity", "point_acceleration"),
)  # fmt: skip
def point_components(data: xr.Dataset, points: Sequence[str] = ()) -> Iterator[Chart]:
    """Yield charts of x and y of position, velocity and acceleration of points, one at a time; see `point_motions`."""
    most, names, axes = _MOST_ROWS // data.sizes["mode"], names_of(data, "point"), names_of(data, "axis")
    shown = points_of(data, points, max(1, min(most, _MOST_POINTS)))
    for quantity, unit, symbol in (("position", "m", "r"), ("velocity", "m/s", "v"), ("acceleration", "m/s²", "a")):
        values = data[f"point_{quantity}"].transpose("mode", "point", "axis", "time").values[:, shown]
        axis = Axis(quantity, unit, symbol, extent=peak(ranges(values, axis=-1)))
        curves = [
            Curve(name, values[r, k, a], look=look(a), run=r, shown=(r,), choice=k, stopped=stopped)
            for r, stopped in enumerate(stopped_runs(data)) for k in range(len(shown)) for a, name in enumerate(axes)
        ]  # fmt: skip
        yield Chart(f"point-{quantity}", f"{quantity.capitalize()} of points", axis, curves,
                    choices=[names[k] for k in shown], choosing="point")  # fmt: skip


@figure("paths of named points in the plane", heading=_POINTS, takes="mode", points="points",
        variables=("point_position",), written_as="point_paths", written_with=(KINEMATICS,), height=90.0,
        defaults=lambda data: {"points": _few_points(data)})  # fmt: skip
def point_paths(data: xr.Dataset, points: Sequence[str] = ()) -> Iterator[Chart]:
    """Yield the chart of the paths of named points in the plane, their trails, with cusps and crunodes.

    Parameters
    ----------
    points : sequence of str
        Points "body.point" to plot; by default all that move. The printed figure by default shows the end-effector and
        the points that travel most, up to seven.
    """
    chart = Chart("points", "Paths of points", Axis("", "m", "y"), x=Axis("", "m", "x"), equal=True)
    chart = _in_the_plane(chart, data, "point_position", points)
    drawn = {curve.name for curve in chart.curves}
    places = {kind: special_points(data, kind, drawn).T for kind in ("cusp", "crunode")}
    marks = [Curve(kind, y, x, mark="cross" if kind == "cusp" else "ring")
             for kind, (x, y) in places.items() if x.size]  # fmt: skip
    yield replace(chart, curves=[*chart.curves, *marks])


@figure("hodographs: velocity of named points in y over that in x", heading=_POINTS, takes="mode", points="points",
        variables=("point_velocity",), defaults=lambda data: {"points": _few_points(data)})  # fmt: skip
def hodographs(data: xr.Dataset, points: Sequence[str] = ()) -> Iterator[Chart]:
    """Yield the chart of the hodographs of points, which the tips of their velocity vectors draw; see `point_paths`."""
    chart = Chart("hodographs", "Hodographs of points", Axis("velocity", "m/s", "y\u0307"),
                  x=Axis("velocity", "m/s", "x\u0307"), equal=True)  # fmt: skip
    yield _in_the_plane(chart, data, "point_velocity", points)


def _few_points(data: xr.Dataset) -> list[str]:
    return [names_of(data, "point")[k] for k in moving_points(data)]


def _in_the_plane(chart: Chart, data: xr.Dataset, variable: str, points: Sequence[str]) -> Chart:
    """Return a chart, without curves, of the second component of a vector of points over the first."""
    values, names = data[variable].transpose("mode", "point", "axis", "time").values, names_of(data, "point")
    shown = points_of(data, points, _MOST_PATHS)
    curves = []
    for r, stopped in enumerate(stopped_runs(data)):
        for k, one in enumerate(shown):
            x, y = values[r, one]
            curves += [Curve(names[one], y, x, look(k), run=r, shown=(r,), stopped=stopped),
                       Curve("", y[:1], x[:1], look(k), shown=(r,), mark="square")]  # fmt: skip
    if not shown:
        x, y = np.moveaxis(values[0, ..., 0], 1, 0)
        curves = [Curve("points, which do not move", y, x, look(0), mark="dot")]
    return replace(chart, curves=curves, on_page=bool(shown))


def points_of(data: xr.Dataset, points: Sequence[str], most: int = _MOST_POINTS) -> list[int]:
    """Return the indices of named points, by default of those that move, at most `most`."""
    return [point_number(data, point, "points") for point in points] or moving_points(data, most)


def moving_points(data: xr.Dataset, most: int = _MOST_POINTS) -> list[int]:
    """Return the indices of the named points that move in the first run, the end-effector first.

    They are at most `most`, those that travel most. Only one of coincident points is returned.
    """
    first = data["point_position"].isel(mode=0, model=0, missing_dims="ignore")
    places, names = first.transpose("time", "point", "axis").values, names_of(data, "point")
    travel = ranges(places).max(axis=1)
    # Coincident points share a line, named after the end-effector if it is one of them. Names of generated points
    # contain "._".
    effector, least = data.attrs.get("end_effector_point"), _STILL_SHARE * travel.max(initial=0.0)
    moving = [k for k, name in enumerate(names) if "._" not in name and travel[k] > least]
    shown = apart(places, sorted(moving, key=lambda k: names[k] != effector), least)
    first = [k for k in shown if names[k] == effector]
    farthest = sorted((k for k in shown if k not in first), key=lambda k: -travel[k])
    return first + sorted(farthest[: most - len(first)])


# Magnitudes of runs, for tables and tiles


def energy_scale(data: xr.Dataset) -> float:
    """Return the largest energy or work of all runs [J], the scale for the rounding of energy imbalances."""
    return max((peak(data[name]) for name in ("kinetic_energy", "strain_energy", "work") if name in data), default=0.0)


def deflections_of(data: xr.Dataset) -> Array:
    """Return magnitudes of the deflections of links from their chords (..., time, body) [m].

    For results of earlier versions they are the transverse displacements of the links' ends.
    """
    name = "deflection" if "deflection" in data else "tip_transverse"
    return np.abs(data[name].transpose(..., "time", "body").values)


def effort_axis(data: xr.Dataset) -> Axis:
    """Return the axis of motor efforts: torques, forces of linear motors, or both."""
    unit = str(data["torque"].attrs.get("units", "N m"))
    name = EFFORTS.get(unit, "torque, force")
    return Axis(name, unit, "τ" if name == "torque" else "", zero=True)
