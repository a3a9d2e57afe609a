"""Report of reduced linear models: states needed, and errors and responses beside those of the full model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.selection import names_of
from paraflex.formatting import text_symbol
from paraflex.report.curves import look
from paraflex.report.page import PLAIN_LOOK, Chart, Curve, Look, Page, Panel
from paraflex.report.provenance import asked, command_line
from paraflex.report.text import NO_VALUE, number, table
from paraflex.results.kinds import check_kind
from paraflex.results.linear_data import HOLDINGS
from paraflex.results.linear_summary import HELD_WORDS
from paraflex.results.reduction_along import OWN, STATIC, along_heads, along_rows, basis_name
from paraflex.results.reduction_data import FULL, percent_off

# Share of the largest gain or error below which values are not drawn.
_LEAST = 1e-12


@checked_arguments()
def reduction_page(data: xr.Dataset) -> Page:
    """Return the report of reduced models, a dataset from `results.reduction_dataset`."""
    check_kind(data, "reduction")
    attrs = data.attrs
    kept, full = int(attrs["kept_states"]), int(attrs["full_states"])
    until, accuracy = float(attrs["until"]), float(attrs["accuracy"])
    needed = f"States needed for {100.0 * accuracy:.3g} % up to {until:g} Hz"
    worst = f"Largest error with {kept} states up to {until:g} Hz"
    return Page(
        title=attrs["mechanism"],
        kind="reduced models",
        subtitle=f"{kept} of {full} states, about {attrs['about']}",
        facts=[
            ("states", f"{kept} of {full}"), ("up to", f"{until:g} Hz"),
            ("damping ratio of responses", f"{float(attrs['damping_ratio']):g}"),
            ("paraflex", str(attrs["paraflex_version"])),
        ],
        command=command_line(asked(data)),
        figures=_tiles(data),
        more=[
            (needed, _of_outputs(data, "states", needed, _states)),
            (worst, _of_outputs(data, "largest_error", worst, number)),
            ("Frequencies", _frequencies(data)),
            *_along_tables(data),
        ],
        panels=[
            Panel("Responses and errors", [*_gain_charts(data), *_error_charts(data)]),
            *([Panel("Bases of other poses", [_along_chart(data)])] if "along_error" in data else []),
        ],
    )  # fmt: skip


def _tiles(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return tiles of the largest number of states that any output needs, and of the largest error, by method."""
    tiles = []
    for name in names_of(data, "reduction"):
        states, errors = data["states"].sel(reduction=name).values, data["largest_error"].sel(reduction=name).values
        most = np.nan if np.isnan(states).any() else float(np.max(states))
        tiles.append((f"states needed, {name}", _states(most), "for every mode and output"))
        tiles.append((f"largest error, {name}", number(float(np.max(errors))), f"{data.attrs['kept_states']} states"))
    return tiles


def _states(value: float) -> str:
    return "more than 80" if np.isnan(value) else f"{value:.0f}"


def _of_outputs(data: xr.Dataset, name: str, caption: str, text: Callable[[float], str]) -> str:
    """Return a table with one row for each mode and method and one column for each output."""
    outputs = names_of(data, "output")
    rows = [
        (mode, [method, *(text(data[name].sel(mode=mode, reduction=method, output=one).item()) for one in outputs)])
        for mode in names_of(data, "mode") for method in names_of(data, "reduction")
    ]  # fmt: skip
    return table([("mode", ""), ("method", ""), *((text_symbol(one), "") for one in outputs)], rows, caption=caption)


def _frequencies(data: xr.Dataset) -> str:
    """Return the table of the frequencies of the full models, and of reduced ones with their relative errors."""
    count = data.sizes["order"]
    rows: list[tuple[str, list[str]]] = []
    for mode in names_of(data, "mode"):
        for holding in HOLDINGS:
            found = data["natural_frequency"].sel(mode=mode, holding=holding)
            exact = found.sel(variant=FULL).values
            for name in names_of(data, "variant"):
                values = found.sel(variant=name).values
                cells = [_frequency(*each, full=name == FULL) for each in zip(values, exact, strict=True)]
                if np.isfinite(values).any():
                    rows.append((f"{mode}, {HELD_WORDS[holding]}", [name, *cells]))
    heads = [("", ""), ("model", ""), *((str(k + 1), "Hz") for k in range(count))]
    note = "Frequencies above zero; below, the errors of reduced models."
    return table(heads, rows, caption="Frequencies", note=note)


def _frequency(value: float, exact: float, *, full: bool) -> str:
    if np.isnan(value):
        return NO_VALUE
    return f"{value:.4g}" + ("" if full or np.isnan(exact) else f"\n{percent_off(value, exact)}")


def _gain_charts(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the largest gain from a mode's inputs to every output, for the full and the reduced models."""
    modes, frequency = names_of(data, "mode"), data["frequency"].values
    for k, output in enumerate(names_of(data, "output")):
        gains = data["gain"].sel(output=output)
        curves = [
            Curve(name, _drawn(gains.sel(mode=mode, variant=name).values), frequency,
                  PLAIN_LOOK if name == FULL else look(v), choice=m)
            for m, mode in enumerate(modes) for v, name in enumerate(names_of(data, "variant"))
        ]  # fmt: skip
        unit = f"{data['output_unit'].sel(output=output).item()}/({data.attrs['input_unit']})"
        yield Chart(f"gain-{k}", f"Gain to {text_symbol(output)}", f"largest gain [{unit}]", curves, **_over(modes))


def _error_charts(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the error of the worst output over frequency, with a line for each method."""
    modes, frequency = names_of(data, "mode"), data["frequency"].values
    curves = [
        Curve(name, _drawn(data["error"].sel(mode=mode, reduction=name).max("output").values), frequency, look(r + 1),
              choice=m)
        for m, mode in enumerate(modes) for r, name in enumerate(names_of(data, "reduction"))
    ]  # fmt: skip
    yield Chart("errors", "Error to the worst output", "largest error over gain", curves, **_over(modes),
                note=f"Wanted: {float(data.attrs['accuracy']):g} up to {float(data.attrs['until']):g} Hz.")  # fmt: skip


def _along_tables(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return the table of errors along a path with bases of each pose, of one and of several; empty without a path."""
    rows = list(along_rows(data))
    if not rows:
        return []
    title, stretch = along_heads(data)
    heads = [("mode", ""), ("static shapes", ""), ("vibrations", ""), ("responses", "largest error"),
             *(("frequencies", HELD_WORDS[holding]) for holding in HOLDINGS), ("within", stretch)]  # fmt: skip
    cells = [(one.mode, [one.static_shapes, one.vibrations, *(NO_VALUE if error is None else number(error)
                                                              for error in one[3:6]), one.within])
             for one in rows]  # fmt: skip
    return [("Bases of other poses", table(heads, cells, caption=title, note=f"{title}."))]


def _along_chart(data: xr.Dataset) -> Chart:
    """Return the chart of the largest error of responses over the position along the path, a line for each basis."""
    modes, places = names_of(data, "mode"), data["place"].values
    curves = []
    for m, mode in enumerate(modes):
        for b, name in enumerate(names_of(data, "basis")):
            for static in names_of(data, "static")[: 1 if name == OWN else None]:
                errors = data["along_error"].sel(mode=mode, static=static, basis=name).values
                if np.isfinite(errors).all():
                    line = PLAIN_LOOK if name == OWN else Look(look(b).colour, STATIC.index(static))
                    curves.append(Curve(basis_name(static, name), errors, places, line, choice=m))
    unit = data.attrs["place_unit"]
    return Chart("along", "Error with bases of other poses", "largest error over gain", curves,
                 **_over(modes) | {"x": f"along the path [{unit}]", "log_x": False})  # fmt: skip


def _over(modes: list[str]) -> dict[str, Any]:
    several = len(modes) > 1
    return {"x": "frequency [Hz]", "log": True, "log_x": True, "over_time": False,
            "choices": modes if several else (), "choosing": "mode"}  # fmt: skip


def _drawn(values: np.ndarray) -> np.ndarray:
    """Return values for a logarithmic axis, with NaN where they are negligible."""
    return np.where(values > _LEAST * np.nanmax(values, initial=0.0), values, np.nan)
