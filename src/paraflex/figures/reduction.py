"""Charts and tables of reduced linear models, and the table of runs of reduced bodies."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from paraflex.formatting import display_unit, number, quantity, text_symbol
from paraflex.results.following import HEADLINE, ErrorSpan
from paraflex.results.linear_summary import HELD_WORDS, HOLDINGS
from paraflex.results.reduced_runs import COUNTS, DISTANCE, ESTIMATE, FULL as OF_FULL, reduced_run_figures
from paraflex.results.reduction_summary import FULL, OWN, STATIC, along_summary
from .charts import PLAIN_LOOK, Axis, Chart, Curve, Look, Span, look
from .entry import NOTHING, figure
from .linear import FREQUENCY
from .selection import names_of
from .tables import Cell, Column, Table

_ERRORS, _BASES = "Responses and errors", "Bases of other poses"
# Largest numbers of outputs, and of frequencies in a row; reduced.nc and reduced.json have all.
_OUTPUTS, _FREQUENCIES = 8, 4
# Number of states needed if it is not known.
_MANY = "more than 80"
# Smallest error along a path that is drawn; smaller ones are drawn as this one.
_LEAST = 1e-9
# A smaller relative deviation of a frequency is a rounding error.
_ROUNDING = 1e-7
# Names of positions along a motion, by unit.
_ALONG = {"m": "along the path", "s": "along the motion"}


# Charts


@figure(
    "gains of reduced models and the full model over frequency", heading=_ERRORS, takes="mode",
    written_as="reduced_responses", columns=2, height=46.0,
)  # fmt: skip
def reduced_responses(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the largest gain from a mode's inputs to every output over frequency, full and reduced models."""
    for k, output in enumerate(names_of(data, "output")[:_OUTPUTS]):
        gains = data["gain"].isel(output=k)
        curves = [
            Curve(_states_of(data, name), gains.isel(mode=m, variant=v).values, data["frequency"].values,
                  PLAIN_LOOK if name == FULL else _look(v), choice=m)
            for m in range(data.sizes["mode"]) for v, name in enumerate(names_of(data, "variant"))
        ]  # fmt: skip
        unit = f"{data['output_unit'].values[k]}/({data.attrs['input_unit']})"
        yield Chart(f"gain-{k}", f"Gain to {text_symbol(output)}", Axis("largest gain", unit, log=True), curves,
                    FREQUENCY, _choices(data), "mode", spans=_beyond(data))  # fmt: skip


@figure(
    "errors of reduced models over frequency, all modes", heading=_ERRORS, written_as="reduction_errors",
    panels="choices", height=62.0,
)  # fmt: skip
def reduction_errors(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the error of the worst output over frequency, for every method and mode.

    A line marks the wanted error.
    """
    worst = data["error"].max("output").transpose("mode", "reduction", "frequency").values
    curves = [
        Curve(name, worst[m, r], data["frequency"].values, _look(r + 1), choice=m)
        for m in range(data.sizes["mode"]) for r, name in enumerate(names_of(data, "reduction"))
    ]  # fmt: skip
    yield Chart("errors", f"Error to the worst output, {data.attrs['kept_states']} states",
                Axis("largest relative error", log=True), curves, FREQUENCY, _choices(data), "mode",
                spans=_beyond(data), levels=[float(data.attrs["accuracy"])], note=f"Wanted: {_wanted(data)}."
                )  # fmt: skip


@figure(
    "lowest frequency with motors held against number of states", heading=_ERRORS, takes="mode",
    written_as="held_frequency_by_states", panels="choices", height=62.0,
)  # fmt: skip
def held_frequency_by_states(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the lowest frequency with a mode's motors held over the number of states, for every method.

    A line marks the frequency of the full model.
    """
    states, modes = data["kept"].values, names_of(data, "mode")
    exact = data["natural_frequency"].sel(variant=FULL, holding=HOLDINGS[1]).isel(order=0).values
    found = data["held_frequency"].transpose("mode", "reduction", "kept").values
    curves = []
    known = states[np.isfinite(found).any(axis=(0, 1))] if np.isfinite(found).any() else states
    for m in range(len(modes)):
        curves.append(Curve(_states_of(data, FULL), np.full(2, exact[m]), known[[0, -1]], choice=m))
        curves += [
            Curve(name, found[m, r], states, _look(r + 1), choice=m, mark="dot", line=True)
            for r, name in enumerate(names_of(data, "reduction")) if np.isfinite(found[m, r]).any()
        ]  # fmt: skip
    of = "" if len(modes) > 1 else f" of {modes[0]}"
    yield Chart("held", f"Lowest frequency, motors{of} held", Axis("lowest frequency", "Hz", log=True), curves,
                Axis("states"), _choices(data), "mode")  # fmt: skip


@figure(
    "errors along the path with bases of one and of several poses", heading=_BASES, takes="mode",
    written_as="bases_along_path", variables=("along_error",), height=62.0,
    missing=(NOTHING, "reduce along a path: --along 21"),
)  # fmt: skip
def bases_along_path(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of errors of responses and of frequencies along a path.

    Bases are those of each pose, of one pose, and interpolated. Dashed: static shapes are of other poses too.
    """
    errors = [("along", "Responses", data["along_error"], [float(data.attrs["accuracy"])])]
    errors += [(f"along-{holding}", f"Frequencies, {HELD_WORDS[holding]}",
                data["along_frequency_error"].sel(holding=holding), []) for holding in HOLDINGS]  # fmt: skip
    unit = data.attrs["place_unit"]
    for identity, title, values, levels in errors:
        lines = values.transpose("mode", "basis", "static", "place").values
        curves = [
            Curve(_basis_name(static, name), np.maximum(lines[m, b, s], _LEAST), data["place"].values,
                  PLAIN_LOOK if name == OWN else Look(_look(b).colour, s), choice=m)
            for m in range(data.sizes["mode"]) for b, name in enumerate(names_of(data, "basis"))
            for s, static in enumerate(STATIC[: 1 if name == OWN else None]) if np.isfinite(lines[m, b, s]).any()
        ]  # fmt: skip
        yield Chart(identity, title, Axis("largest relative error", log=True), curves,
                    Axis(_ALONG[unit], unit), _choices(data), "mode", levels=levels)  # fmt: skip


def _choices(data: xr.Dataset) -> list[str]:
    """Return the names of the modes if there are several."""
    modes = names_of(data, "mode")
    return [f"mode {mode}" for mode in modes] if len(modes) > 1 else []


def _look(number: int) -> Look:
    """Return the look of a curve beside a black one, from 1; the fourth colour is black in print and is left out."""
    return look(number + (number > 2))


def _beyond(data: xr.Dataset) -> list[Span]:
    until = float(data.attrs["until"])
    return [Span(until, math.inf, f"above {number(until)} Hz")]


def _states_of(data: xr.Dataset, name: str) -> str:
    return f"{name}, {data.attrs['full_states' if name == FULL else 'kept_states']} states"


def _basis_name(static: str, name: str) -> str:
    """Return the name of a basis: which shapes are those of which poses."""
    kept = "" if name == OWN else "vibrations " if static == STATIC[0] else "all shapes "
    return f"{kept}{name}"


# Tables


def tables(data: xr.Dataset) -> Iterator[Table]:
    """Yield the tables: states needed, largest errors, frequencies, and errors along the path if there are any."""
    pairs = [(mode, name) for mode in names_of(data, "mode") for name in names_of(data, "reduction")]
    heads = [Column("mode", [mode for mode, _ in pairs]), Column("method", [name for _, name in pairs])]

    def of_outputs(title: str, values: xr.DataArray, **more: Any) -> Table:
        found = values.transpose("output", "mode", "reduction").values
        outputs = names_of(data, "output")[:_OUTPUTS]
        columns = [Column(each, list(found[k].ravel()), **more) for k, each in enumerate(outputs)]
        return Table(title, [*heads, *columns])

    until = f"up to {number(float(data.attrs['until']))} Hz"
    yield of_outputs(f"States needed for {_wanted(data)}", data["states"].fillna(np.inf), infinite=_MANY)
    yield of_outputs(f"Largest error with {data.attrs['kept_states']} states {until}", data["largest_error"], digits=2)
    yield _frequency_table(data)
    if "along_error" in data:
        yield _along_table(data)


def _wanted(data: xr.Dataset) -> str:
    """Return the wanted error and the highest frequency: "1 % up to 40 Hz"."""
    return f"{number(100.0 * float(data.attrs['accuracy']))} % up to {number(float(data.attrs['until']))} Hz"


def _frequency_table(data: xr.Dataset) -> Table:
    """Return the table of frequencies with motors free, which all modes share, and with the motors of each mode held.

    Below those of reduced models are their deviations from the full model.
    """
    found = data["natural_frequency"].isel(order=slice(_FREQUENCIES)).transpose("holding", "mode", "variant", "order")
    modes, models = names_of(data, "mode"), names_of(data, "variant")
    rows = [(h, m, v) for h in range(len(HOLDINGS)) for m in range(len(modes) if h else 1) for v in range(len(models))
            if np.isfinite(found.values[h, m, v]).any()]  # fmt: skip
    values = np.array([found.values[row] for row in rows])
    off = values / np.array([found.values[h, m, 0] for h, m, _ in rows]) - 1.0
    off = np.where(np.abs(off) < _ROUNDING, 0.0, 100.0 * off)
    below = [[None if v == 0 or math.isnan(each) else each for each in off[r]] for r, (_, _, v) in enumerate(rows)]
    columns = [Column("mode", [modes[m] if h else "all" for h, m, _ in rows]),
               Column("motors", [HOLDINGS[h] for h, _, _ in rows]), Column("model", [models[v] for _, _, v in rows]),
               *(Column(str(k + 1), list(values[:, k]), "Hz", below=[one[k] for one in below], below_unit="%")
                 for k in range(values.shape[1]))]  # fmt: skip
    return Table("Frequencies, and deviations of reduced models", columns, "Frequencies above zero.")


def _along_table(data: xr.Dataset) -> Table:
    """Return the table of errors along a path with bases of each pose, of one and of several.

    Its last column is the longest interval of the path in which the errors of the responses are below the limit.
    """
    places, unit = data["place"].values, display_unit(data.attrs["place_unit"], data["place"].values)

    def stretch(at: tuple[float, float] | None) -> str:
        if at is None:
            return "nowhere"
        return "all" if at == (places[0], places[-1]) else "-".join(number(one, 2, factor=unit.factor) for one in at)

    rows: list[tuple[Cell, ...]] = []
    for mode in names_of(data, "mode"):
        for static, bases in along_summary(data, mode).items():
            rows += [
                (mode, OWN if static == STATIC[0] else name, name, one["largest_error"],
                 *(one[f"frequency_error_{holding}"] for holding in HOLDINGS), stretch(one["within"]))
                for name, one in bases.items() if name != OWN or static == STATIC[0]
            ]  # fmt: skip
    heads = ("mode", "static shapes", "vibrations", "responses", *HOLDINGS)
    *cells, within = zip(*rows, strict=True)
    columns = [Column(head, list(each), digits=2) for head, each in zip(heads, cells, strict=True)]
    limit = f"{number(100.0 * float(data.attrs['accuracy']))} %"
    title = (
        f"{_BASES}, {data.attrs['along_method']}: errors at {places.size} poses along "
        f"{quantity(float(places[-1]), data.attrs['place_unit'], padded=False)} up to "
        f"{number(float(data.attrs['until']))} Hz"
    )
    note = "Largest errors of responses, and of frequencies with motors free and held."
    return Table(title, [*columns, Column(limit, list(within), f"at [{unit.name}]")], note)


def tiles(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return tiles of the largest number of states that any output needs, and of the largest error, by method."""
    shown = []
    for name in names_of(data, "reduction"):
        states, errors = (data[each].sel(reduction=name).values for each in ("states", "largest_error"))
        shown.append(
            (f"states needed, {name}", number(float(np.max(states)), missing=_MANY), "for every mode and output")
        )
        shown.append(
            (f"largest error, {name}", number(float(np.max(errors)), 3), f"{data.attrs['kept_states']} states")
        )
    return shown


def bound_sentences(data: xr.Dataset) -> Iterator[str]:
    """Yield a sentence on the bound of the error of each model that has one."""
    for mode in names_of(data, "mode"):
        for name in names_of(data, "reduction"):
            if np.isfinite(bound := float(data["bound"].sel(mode=mode, reduction=name))):
                yield f"mode {mode}, {name}: the gain of the error is at most {number(bound, 3)}"


# Runs of reduced bodies


def reduced_runs(data: xr.Dataset) -> Iterator[Table]:
    """Yield the table of the reduced runs of a dataset; none for runs with all flexible coordinates."""
    if DISTANCE not in data and ESTIMATE not in data:
        return
    error = HEADLINE[ErrorSpan(data.attrs["error"])] if "mode" in data.dims else ""
    runs = [data.isel(mode=r) for r in range(data.sizes["mode"])] if error else [data]
    names = names_of(data, "mode") if error else ["run"]
    numbers = [
        {name: float(run[name]) for name in (error, "wall_time") if name} | reduced_run_figures(run) for run in runs
    ]
    yield reduced_runs_table(
        ["mode" if error else ""], [([n], one) for n, one in zip(names, numbers, strict=True)], error
    )


def reduced_runs_table(
    heads: Sequence[str], runs: Iterable[tuple[Sequence[str], Mapping[str, Any]]], error: str
) -> Table:
    """Return the table of errors and times of reduced runs beside those of the runs with all flexible coordinates.

    Parameters
    ----------
    heads : sequence of str
        Headings of the columns that name a run.
    runs : iterable of (sequence of str, mapping)
        Names and plain numbers of each run; those that are not reduced are left out.
    error : str
        Name of the tracking error among the numbers; empty for runs without a path.
    """
    found = [(names, one, one["reduction"]) for names, one in runs if one.get("reduction") is not None]
    estimates = [one.get("estimate") for _, _, one in found]
    columns = [Column(head, [names[k] for names, _, _ in found]) for k, head in enumerate(heads)]

    def combined(combine: Any, name: str) -> list[float | None]:
        pairs = [(one.get(name), full.get(OF_FULL + name)) for _, one, full in found]
        return [None if None in pair else combine(*pair) for pair in pairs]

    words = reduced_words(found[0][2]) if found else ""
    rows = {names[-1]: r for r, (names, _, _) in enumerate(found)} if error else None
    if None not in estimates:
        columns.append(Column("estimated deviation", estimates, "m", digits=2))
    if not any("distance" in one for _, _, one in found):
        return Table("Reduced bodies", columns, f"{words}. The deviation is that from positions with all.", rows)
    if error:
        columns += [Column("full error", [full[OF_FULL + error] for _, _, full in found], "m"),
                    Column("off", combined(lambda few, full: few - full, error), "m", digits=2)]  # fmt: skip
    columns += [Column("distance", [full["distance"] for _, _, full in found], "m", digits=2),
                Column("relative time", combined(lambda few, full: few / full, "wall_time"), digits=2)]  # fmt: skip
    whose = "the end-effector" if error else "a named point"
    return Table("Reduced bodies", columns, f"{words}. Distance: the largest of {whose} from its place with all.", rows)


def reduced_words(one: Mapping[str, Any]) -> str:
    """Return the sizes of a reduced run: "16 of 80 flexible coordinates, 36 of 164 states"."""
    return ", ".join(f"{one[name]} of {one[OF_FULL + name]} {name.replace('_', ' ')}" for name in COUNTS)
