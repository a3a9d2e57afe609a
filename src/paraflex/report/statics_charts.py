"""Charts of static equilibria: force, stiffness and other quantities against travel, and buckling shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.plots.labels import ROUNDING, display_unit, peak, text_symbol
from paraflex.plots.scene import figure_of
from paraflex.plots.selection import names_of
from paraflex.report.curves import DOTTED, joint_force_curves, look
from paraflex.report.page import PLAIN_LOOK, Chart, Curve, Look, Panel
from paraflex.results.statics_data import branch_parts, seen_buckling
from paraflex.results.statics_rows import given_coordinates, is_wide, quantity_word, shown_unit, unit_of
from paraflex.units import STRESS

Array = NDArray[np.float64]

# Largest numbers of frequencies drawn, and of joints or coordinates offered by a chart; statics.nc has all.
_FREQUENCIES, _MOST_CHOICES = 4, 60
# Largest displacement of a buckling shape, as a share of the mechanism's size.
_SWING = 0.12


class _Abscissa(NamedTuple):
    """Abscissa of charts: values (steps,), in the unit of the label."""

    values: Array
    label: str


def statics_panels(data: xr.Dataset) -> list[Panel]:
    """Return the charts of equilibria (dimension step first): along the travel and of buckling, or else the shape."""
    over, panels = _over(data), []
    if over is not None:
        own = (_stiffness_charts, _travel_chart, _frequency_chart, _stress_chart, _joint_chart)
        charts = [*_force_charts(data), *(chart for make in own for chart in make(data, over))]
        panels.append(Panel("Along the travel", charts))
    shapes = list(_buckling_chart(data))
    return [*panels, *([Panel("Buckling", shapes)] if shapes else [])] or [Panel("Shape", [_shape_chart(data)])]


def _over(data: xr.Dataset) -> _Abscissa | None:
    if "given_travel" not in data:
        return None
    travel = data["given_travel"]
    unit = display_unit(travel.attrs["units"], travel.values)
    return _Abscissa(unit.factor * travel.values, f"travel of {text_symbol(travel.attrs['coordinate'])} [{unit.name}]")


def _branch(data: xr.Dataset, name: str, x: Array, y: Array, own: Look, choice: int | None = None) -> list[Curve]:
    """Return the curves of a branch: solid where stable, dotted where unstable, with rings at limit points."""
    parts, y, own = branch_parts(data), np.where(np.isfinite(y), y, np.nan), own._replace(dash=0)
    curves = [Curve(name, np.where(parts.stable, y, np.nan), x, own, run=0, choice=choice)]
    if parts.unstable.any():
        dotted = own._replace(dash=DOTTED)
        curves.append(Curve(name, np.where(parts.unstable, y, np.nan), x, dotted, run=0, choice=choice))
    if parts.limit.any():
        texts = ["limit point"] * int(parts.limit.sum())
        curves.append(Curve(texts[0], y[parts.limit], x[parts.limit], own, choice=choice, mark="ring", texts=texts))
    return curves


def _force_charts(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of force against travel for each coordinate that is moved or loaded."""
    note = "Dotted: unstable equilibria; rings: limit points." if branch_parts(data).unstable.any() else ""
    for k in given_coordinates(data):
        one = data.isel(named=k)
        name, unit = text_symbol(str(one["named"].item())), display_unit(str(one["unit"].item()), one["travel"].values)
        word = quantity_word(one, "effort")
        yield Chart(
            f"force-{k}", f"{word.capitalize()} against travel: {name}", f"{word} [{unit_of(one, 'effort')}]",
            _branch(data, "", unit.factor * one["travel"].values, one["effort"].values, look(0)),
            x=f"travel of {name} [{unit.name}]", over_time=False, note=note,
        )  # fmt: skip


def _stiffness_charts(data: xr.Dataset, over: _Abscissa) -> Iterator[Chart]:
    for kind in ("m", "rad"):
        own = [k for k in range(data.sizes["named"])
               if data["unit"].values[k] == kind and np.isfinite(data["stiffness"].values[:, k]).any()]  # fmt: skip
        if not own:
            continue
        unit = shown_unit(unit_of(data.isel(named=own[0]), "stiffness"))
        values = unit.factor * data["stiffness"].values
        names = [text_symbol(str(data["named"].values[k])) for k in own]
        curves = [curve for i, k in enumerate(own)
                  for curve in _branch(data, names[i], over.values, values[:, k], look(i))]  # fmt: skip
        title = "Stiffness" if kind == "m" else "Stiffness against turning"
        yield Chart(
            f"stiffness-{kind}", title, f"stiffness [{unit.name}]", curves, x=over.label, over_time=False,
            log=is_wide(values[:, own]),
        )  # fmt: skip


def _travel_chart(data: xr.Dataset, over: _Abscissa) -> Iterator[Chart]:
    """Yield the chart of the travel of free coordinates, which are neither moved nor loaded nor held."""
    free = [k for k, role in enumerate(data["role"].values) if role == "free"]
    curves, choices = [], []
    for k in free[:_MOST_CHOICES]:
        one = data.isel(named=k)
        if peak(one["travel"].values) < ROUNDING:
            continue
        unit = display_unit(str(one["unit"].item()), one["travel"].values)
        name = text_symbol(str(one["named"].item()))
        curves += _branch(data, name, over.values, unit.factor * one["travel"].values, look(0), len(choices))
        choices.append(f"{name} [{unit.name}]")
    if curves:
        label = "travel" if len(choices) > 1 else f"travel of {choices[0]}"
        yield Chart("travels", "Travel of free coordinates", label, curves,
                    x=over.label, over_time=False, choices=choices if len(choices) > 1 else (),
                    choosing="coordinate")  # fmt: skip


def _frequency_chart(data: xr.Dataset, over: _Abscissa) -> Iterator[Chart]:
    values = data["natural_frequency"].values[:, :_FREQUENCIES]
    if values.size:
        curves = [curve for k in range(values.shape[1])
                  for curve in _branch(data, str(k + 1), over.values, values[:, k], look(k))]  # fmt: skip
        yield Chart("frequencies", "Natural frequencies", "frequency [Hz]", curves, x=over.label, over_time=False,
                    note="Held and moved coordinates are fixed.")  # fmt: skip


def _stress_chart(data: xr.Dataset, over: _Abscissa) -> Iterator[Chart]:
    if "stress" not in data:
        return
    values = STRESS.factor * data["stress"].transpose("step", "body").values
    own = [b for b in range(values.shape[1]) if np.nan_to_num(values[:, b]).any()]
    if own:
        names = names_of(data, "body")
        curves = [curve for i, b in enumerate(own)
                  for curve in _branch(data, text_symbol(names[b]), over.values, values[:, b], look(i))]  # fmt: skip
        yield Chart("stresses", "Stresses of beams", f"stress [{STRESS.name}]", curves, x=over.label, over_time=False,
                    note="Largest magnitude along a beam, bending and axial.")  # fmt: skip


def _joint_chart(data: xr.Dataset, over: _Abscissa) -> Iterator[Chart]:
    names = names_of(data, "joint")[:_MOST_CHOICES] if data.sizes.get("joint") else []
    if not names:
        return
    force = data["joint_force"].transpose("joint", "step", "axis").values
    curves = joint_force_curves(force[: len(names)], over.values)
    yield Chart("joints", "Forces of joints", "force [N]", curves, x=over.label, over_time=False,
                choices=[text_symbol(name) for name in names], choosing="joint",
                note="On the joint's second body, in the ground frame.")  # fmt: skip


def _buckling_chart(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the buckling shapes at the last stable equilibrium that has any."""
    seen = seen_buckling(data)
    if seen is None:
        return
    step, numbers = seen
    curves, choices = [], []
    places = data["shape"].values[step].astype(float)
    size = float(np.max(np.ptp(places, axis=0)))
    for which in numbers:
        swung = places + _SWING * size * data["buckling_shape"].values[step, which]
        curves += [*_outlines(data, places, PLAIN_LOOK._replace(dash=DOTTED), "before", len(choices)),
                   *_outlines(data, swung, None, "", len(choices))]  # fmt: skip
        choices.append(f"at {data['buckling_factor'].values[step, which]:.4g} of what is given")
    if curves:
        several = len(choices) > 1
        title = "How it buckles" if several else f"How it buckles {choices[0]}"
        yield Chart(
            "buckling", title, "y [mm]", curves, x="x [mm]", equal=True, over_time=False,
            choices=choices if several else (), choosing="factor", note="The size of the displacements is arbitrary.",
        )  # fmt: skip


def _shape_chart(data: xr.Dataset) -> Chart:
    """Return the chart of the mechanism at its only equilibrium, beside its undeformed shape."""
    curves = [*_outlines(data, data["shape_base"].values[-1], PLAIN_LOOK._replace(dash=DOTTED), "undeformed"),
              *_outlines(data, data["shape"].values[-1], None, "")]  # fmt: skip
    return Chart("shape", "Shape at rest", "y [mm]", curves, x="x [mm]", equal=True, over_time=False)


def _outlines(
    data: xr.Dataset, places: Array, own: Look | None, name: str, choice: int | None = None
) -> Iterator[Curve]:
    """Yield curves of the bodies with stations at `places` (stations, 2), each in its colour unless a look is given."""
    owners = data["station_body"].values
    for k, body in enumerate(dict.fromkeys(map(str, owners))):
        # A body with a single station has no line.
        if np.count_nonzero(owners == body) < 2:
            continue
        line = 1e3 * figure_of(places[None, owners == body])[0]
        yield Curve(name or text_symbol(body), line[:, 1], line[:, 0], own or look(k)._replace(dash=0), choice=choice)
