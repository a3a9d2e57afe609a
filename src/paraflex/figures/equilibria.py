"""Charts and tables of static equilibria: force, stiffness and other quantities along the travel, buckling, loads."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import ROUNDING, number, peak, text_symbol
from paraflex.results.statics_steps import NAMED_UNITS, branch_parts, seen_buckling, step_kinds
from .charts import DOTTED, PLAIN_LOOK, Axis, Chart, Curve, Look, look
from .entry import figure
from .selection import names_of
from .shapes import figure_of
from .tables import Column, Table

# Largest numbers of frequencies drawn, and of joints or coordinates offered by a chart; statics.nc has all.
_FREQUENCIES, _MOST_CHOICES = 4, 60
# Largest displacement of a buckling shape, as a share of the mechanism's size.
_SWING = 0.12
# Largest numbers of rows and of coordinates in the table of steps; statics.nc has all.
_ROWS, _COLUMNS = 24, 2
# Stress up to which a beam counts as unstressed [Pa].
_NO_STRESS = 1.0
# Ratio of internal terms, stiffness times length, to the forces that are their differences: the scale for rounding.
_PARTS = 1e5
# Relative difference below which buckling factors are equal.
_SAME = 0.01
_ALONG = "Along the travel"
_HELD = "Held and moved coordinates are fixed."


# Charts


@figure(
    "force against travel of loaded and moved coordinates", heading=_ALONG, written_as="force_travel",
    variables=("given_travel",), height=62.0,
)  # fmt: skip
def force_travel(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of force against travel of every coordinate that is loaded or moved."""
    note = "Dotted: unstable equilibria; rings: limit points." if branch_parts(data).unstable.any() else ""
    for k in given_coordinates(data):
        one = data.isel(named=k)
        name, word = text_symbol(str(one["named"].item())), quantity_word(one, "effort")
        yield Chart(
            f"force-{k}", f"{word.capitalize()} against travel: {name}",
            Axis(word, unit_of(one, "effort"), zero=True),
            _branch(data, "", one["travel"].values, one["effort"].values, look(0)),
            Axis(f"travel of {name}", unit_of(one, "travel")), note=note,
        )  # fmt: skip


@figure(
    "stiffness and lowest frequencies against travel", heading=_ALONG, written_as="stiffness_travel",
    variables=("given_travel",), height=62.0,
)  # fmt: skip
def stiffness_travel(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the requested stiffnesses, and of the lowest natural frequencies, against the given travel."""
    for kind, title in (("m", "Stiffness"), ("rad", "Stiffness against turning")):
        own = [k for k in range(data.sizes["named"])
               if data["unit"].values[k] == kind and np.isfinite(data["stiffness"].values[:, k]).any()]  # fmt: skip
        if own:
            unit = unit_of(data.isel(named=own[0]), "stiffness")
            values = {text_symbol(str(data["named"].values[k])): data["stiffness"].values[:, k] for k in own}
            yield _along(data, f"stiffness-{kind}", title, Axis("stiffness", unit, log=True), values)
    values = data["natural_frequency"].values[:, :_FREQUENCIES]
    if values.size:
        axis = Axis("natural frequency", "Hz", low=0.0)
        numbered = {str(k + 1): one for k, one in enumerate(values.T)}
        yield _along(data, "frequencies", "Natural frequencies", axis, numbered, _HELD)


@figure("travel of coordinates that are free", heading=_ALONG, variables=("given_travel",), height=62.0)
def free_travels(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the travel of coordinates that are neither moved nor loaded nor held, one at a time."""
    free = [k for k, role in enumerate(data["role"].values)
            if role == "free" and peak(data["travel"].values[:, k]) >= ROUNDING]  # fmt: skip
    curves, axes, choices = [], [], []
    for choice, k in enumerate(free[:_MOST_CHOICES]):
        one, name = data.isel(named=k), text_symbol(str(data["named"].values[k]))
        curves += _branch(data, name, _travel(data), one["travel"].values, look(0), choice)
        axes.append(Axis(f"travel of {name}", unit_of(one, "travel")))
        choices.append(name)
    if curves:
        yield Chart("travels", "Travel of free coordinates", axes, curves, _abscissa(data), choices,
                    choosing="coordinate")  # fmt: skip


@figure("largest stress of every beam against travel", heading=_ALONG, variables=("given_travel", "stress"),
        height=62.0)  # fmt: skip
def stress_travel(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the largest stress of every beam against the given travel."""
    values = data["stress"].transpose("step", "body").values
    shown = {text_symbol(name): values[:, b] for b, name in enumerate(names_of(data, "body")) if peak(values[:, b])}
    if shown:
        note = "Largest magnitude along a beam, bending and axial."
        yield _along(data, "stresses", "Stresses of beams", Axis("stress", "Pa"), shown, note)


@figure("force in every joint against travel", heading=_ALONG, variables=("given_travel", "joint_force"), height=62.0)
def joint_force_travel(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of magnitude and components of joint forces against the given travel, one joint at a time."""
    names = names_of(data, "joint")[:_MOST_CHOICES]
    force = data["joint_force"].transpose("joint", "step", "axis").values[: len(names)]
    curves = [
        Curve(word, y, _travel(data), look(k), run=0, choice=j)
        for j, one in enumerate(force)
        for k, (word, y) in enumerate((("magnitude", np.linalg.norm(one, axis=-1)), ("x", one[:, 0]), ("y", one[:, 1])))
    ]  # fmt: skip
    if curves:
        yield Chart("joints", "Forces of joints", Axis("force", "N"), curves, _abscissa(data),
                    [text_symbol(name) for name in names], choosing="joint",
                    note="On the joint's second body, in the ground frame.")  # fmt: skip


def buckling_chart(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the buckling shapes at the last stable equilibrium that has any, for the page."""
    curves, choices = [], []
    for choice, (_, factor, (before, swung)) in enumerate(buckled(data)):
        curves += [*_outlines(data, before, PLAIN_LOOK._replace(dash=DOTTED), "before", choice),
                   *_outlines(data, swung, None, "", choice)]  # fmt: skip
        choices.append(f"load factor {number(factor)}")
    if not choices:
        return
    yield Chart(
        "buckling", "Buckling shapes" if len(choices) > 1 else f"Buckling shape at {choices[0]}", Axis("y", "m"),
        curves, Axis("x", "m"), choices if len(choices) > 1 else (), choosing="factor", equal=True,
        note="The size of the displacements is arbitrary.",
    )  # fmt: skip


def buckled(data: xr.Dataset) -> Iterator[tuple[int, float, Array]]:
    """Yield the step of `seen_buckling`, and for each factor there the stations before and after (2, stations, 2)."""
    if (seen := seen_buckling(data)) is None:
        return
    step, numbers = seen
    places = data["shape"].values[step].astype(float)
    swing = _SWING * float(np.max(np.ptp(places, axis=0)))
    for which in numbers:
        factor, shape = (data[f"buckling_{name}"].values[step, which] for name in ("factor", "shape"))
        yield step, float(factor), np.stack([places, places + swing * shape])


def shape_chart(data: xr.Dataset) -> Chart:
    """Return the chart of the mechanism at its only equilibrium, beside its undeformed shape, for the page."""
    curves = [*_outlines(data, data["shape_base"].values[-1], PLAIN_LOOK._replace(dash=DOTTED), "undeformed"),
              *_outlines(data, data["shape"].values[-1], None, "")]  # fmt: skip
    return Chart("shape", "Shape at rest", Axis("y", "m"), curves, Axis("x", "m"), equal=True)


def _travel(data: xr.Dataset) -> Array:
    return data["given_travel"].values


def _abscissa(data: xr.Dataset) -> Axis:
    attrs = data["given_travel"].attrs
    return Axis(f"travel of {text_symbol(attrs['coordinate'])}", attrs["units"])


def _along(data: xr.Dataset, identity: str, title: str, axis: Axis, values: dict[str, Array], note: str = "") -> Chart:
    """Return a chart of quantities (steps,) by name against the given travel."""
    curves = [curve for k, (name, each) in enumerate(values.items())
              for curve in _branch(data, name, _travel(data), each, look(k))]  # fmt: skip
    return Chart(identity, title, axis, curves, _abscissa(data), note=note)


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


def _outlines(
    data: xr.Dataset, places: Array, own: Look | None, name: str, choice: int | None = None
) -> Iterator[Curve]:
    """Yield curves of the bodies with stations at `places` (stations, 2), each in its colour unless a look is given."""
    owners = data["station_body"].values
    for k, body in enumerate(dict.fromkeys(map(str, owners))):
        # A body with a single station has no line.
        if np.count_nonzero(owners == body) > 1:
            line = figure_of(places[None, owners == body])[0]
            yield Curve(
                name or text_symbol(body), line[:, 1], line[:, 0], own or look(k)._replace(dash=0), choice=choice
            )


# Tables


def tables(data: xr.Dataset) -> Iterator[Table]:
    """Yield the tables: named coordinates at the last step, steps, stresses, reactions."""
    yield from last_tables(data)
    if data.sizes["step"] > 1:
        yield step_table(data)
    if is_stressed(data):
        yield stress_table(data)
    yield reaction_table(data)


def step_table(data: xr.Dataset) -> Table:
    """Return the table of steps, thinned out if there are many, with the first coordinates that are moved or loaded."""
    kinds, parts = step_kinds(data), _parts(data)
    columns = [Column("", kinds), Column("load factor", list(data["fraction"].values))]
    for k in given_coordinates(data)[:_COLUMNS]:
        one = data.isel(named=k)
        for quantity in ("travel", "effort", "stiffness"):
            name = str(one["named"].item()) if quantity == "travel" else quantity_word(one, quantity)
            unit = unit_of(one, quantity)
            beside = parts.get(unit, 0.0)
            columns.append(Column(name, list(one[quantity].values), unit, beside=beside, infinite="rigid"))
    if word := lowest_frequencies(data).get("natural_frequency"):
        columns.append(Column(word, list(data["natural_frequency"].values[:, 0]), "Hz"))
    steps = range(data.sizes["step"])
    every = math.ceil(len(steps) / _ROWS)
    kept = [k for k in steps if k % every == 0 or k == steps[-1] or kinds[k] == "limit point"]
    note = "Frequencies are those of small vibrations about each equilibrium, held and moved coordinates fixed."
    return Table("Steps", columns, note).filled().thinned(kept)


def last_tables(data: xr.Dataset) -> list[Table]:
    """Return tables of the named coordinates at the last step, for lengths and for angles."""
    last, title = data.isel(step=-1), "At the last step" if data.sizes["step"] > 1 else "At rest"
    tables, parts = [], _parts(data)
    for kind in ("m", "rad"):
        own = last.isel(named=np.flatnonzero(last["unit"].values == kind))
        if not own.sizes["named"]:
            continue
        one = own.isel(named=0)
        columns = [
            Column("coordinate", names_of(own, "named")),
            Column("", list(own["role"].values)),
        ]
        for quantity, infinite in (("travel", ""), ("effort", ""), ("stiffness", "rigid"), ("compliance", "free")):
            name, unit = quantity_word(one, quantity), unit_of(one, quantity)
            columns.append(Column(name, list(own[quantity].values), unit, beside=parts.get(unit, 0.0),
                                  infinite=infinite))  # fmt: skip
        tables.append(Table(title, columns, "A force acts on the mechanism along its coordinate. Stiffness: with all "
                            "held and moved coordinates fixed.").filled())  # fmt: skip
    return tables


def stress_table(data: xr.Dataset) -> Table:
    """Return the table of the largest stresses of the beams whose stresses are known."""
    own = data.isel(body=np.flatnonzero(np.isfinite(data["stress_max"].values)))
    return Table("Stresses of beams", [
        Column("beam", names_of(own, "body")),
        *(Column(name, list(own[key].values), unit) for name, key, unit in (
            ("stress", "stress_max", "Pa"), ("safety factor", "safety_factor", ""), ("at", "stress_place", "m"),
        ) if key in own),
        Column("step", [int(k) for k in own["stress_step"].values]),
    ], "Bending and axial together, the largest of all steps.").filled()  # fmt: skip


def reaction_table(data: xr.Dataset) -> Table:
    """Return the table of forces and moments of joints at the last step."""
    names = names_of(data, "joint") if data.sizes.get("joint") else []
    force, moment = (data[name].values[-1] if names else np.zeros((0, 2)) for name in ("joint_force", "joint_moment"))
    beside = _parts(data)
    return Table("Reactions", [
        Column("joint", names),
        *(Column(f"force {axis}", list(force[:, k]), "N", beside=beside["N"]) for k, axis in enumerate("xy")),
        Column("moment", [float(each) for each in moment], "N m", beside=beside["N m"]),
    ], "On the joint's second body, in the ground frame, at the last step.")  # fmt: skip


def _parts(data: xr.Dataset) -> dict[str, float]:
    """Return magnitudes by unit of what forces, moments and coordinates at the last step are differences of."""
    parts = {"m": _PARTS, "rad": _PARTS, "N": _PARTS, "N m": _PARTS}
    if data.sizes.get("joint"):
        wide = float(np.max(np.nan_to_num(np.ptp(data["joint_position"].values[-1], axis=0)), initial=0.0))
        size = max(peak(data["joint_force"].values[-1]), 1.0)
        parts |= {"N": _PARTS * size, "N m": _PARTS * max(peak(data["joint_moment"].values[-1]), size * wide)}
    return parts


# Words and quantities


def lowest_frequencies(data: xr.Dataset) -> dict[str, str]:
    """Return variables of natural frequencies and labels: "held" and "free" if a coordinate is moved, else "lowest"."""
    words = {"natural_frequency": "held", "free_frequency": "free"}
    words = words if (data["role"] == "moved").any() else {"natural_frequency": "lowest"}
    return {name: word for name, word in words.items() if name in data and np.isfinite(data[name].values[:, :1]).any()}


def buckling_words(data: xr.Dataset) -> str:
    """Return a text on the buckling factors as seen from the start and from the last step; empty if none is known.

    Without loads, a factor of the travel is reported only if the travel reaches it: a travel has no safety margin.
    """
    factors = data["buckling_factor"].values
    loaded = bool((data["role"] == "loaded").any())
    if not (factors.size and np.isfinite(factors[0, 0]) and (loaded or factors[0, 0] <= 1.0)):
        return ""
    higher = " and ".join(number(each) for each in factors[0, 1:] if np.isfinite(each))
    seen = [f"load factor {number(factors[0, 0])} as seen from the start" + (f" (next {higher})" if higher else "")]
    if data.sizes["step"] > 1 and np.isfinite(factors[-1, 0]):
        seen.append(f"{number(factors[-1, 0])} as seen from the last step")
        if abs(factors[-1, 0] / factors[0, 0] - 1.0) > _SAME:
            seen[-1] += ": linear estimates, which change along the branch"
    return ", ".join(seen)


def no_buckling(data: xr.Dataset) -> str:
    """Return the reason why no buckling factor is known at the start; empty if one is known, or nothing buckles."""
    reason = str(data["buckling_note"].values[0]) if "buckling_note" in data else ""
    return f"no factor of buckling: {reason}" if reason and (data["role"] == "loaded").any() else ""


def is_stressed(data: xr.Dataset) -> bool:
    """Check whether beams have stresses above rounding."""
    return "stress_max" in data and float(np.nanmax(data["stress_max"].values, initial=0.0)) > _NO_STRESS


def given_coordinates(data: xr.Dataset) -> list[int]:
    """Return the indices of the coordinates that are moved or loaded."""
    return [k for k, role in enumerate(data["role"].values) if role in ("moved", "loaded")]


def unit_of(one: xr.Dataset, quantity: str) -> str:
    """Return the SI unit of a quantity of a named coordinate."""
    return NAMED_UNITS[quantity][one["unit"].item() == "rad"]


def quantity_word(one: xr.Dataset, quantity: str) -> str:
    """Return the heading of a quantity's column."""
    return quantity if quantity != "effort" else "force" if one["unit"].item() == "m" else "torque"
