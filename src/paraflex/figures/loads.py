"""Charts and tables of the loads of runs: stresses of beams, joints, motors and prescribed motions, ground."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.formatting import NO_VALUE, display_unit, number, peak, text_symbol
from paraflex.results.beam_stresses import CONTACT, stresses_of
from paraflex.results.kinematics import KINEMATICS
from paraflex.results.loads import resolved_error, sliding_joints
from paraflex.units import EFFORTS
from .charts import DOTTED, Axis, Chart, Curve, look
from .entry import figure
from .runs import followed, of_names, stopped_runs
from .selection import names_of
from .tables import Cell, Column, Table, columns_of

# Loads by run: the names of a run, such as its path and mode, and what `results.loads.load_figures` returns.
LoadsOfRuns = Mapping[tuple[str, ...], Mapping[str, Any]]
# Largest number of joints whose components are drawn; results.nc has all.
_MOST_CHOICES = 60
# Number of rows above which a table of stresses has only the beam with the largest stress of each run.
_MOST_ROWS = 40
_LOADS = "Loads"
_ERRORS = " After ±: how far a load may be off by errors of integration, where that is more than 1 %."
_NO_STRESS = (
    "the stresses of these beams are not known",
    "give their sections outer_fibre, or sides, and run the model again",
)


# Charts


@figure(
    "largest stress of every beam over time", heading=_LOADS, takes="mode", variables=("stress",), height=56.0,
    missing=_NO_STRESS,
)  # fmt: skip
def beam_stresses(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the largest magnitude of stress along every beam over time, bending and axial."""
    own = [b for b, values in enumerate(data["stress"].transpose("body", ...).values) if peak(values)]
    if own:
        note = "Largest magnitude along a beam, bending and axial."
        chart = Chart("stresses", "Stresses of beams", Axis("stress"), choosing="beam", note=note)
        yield followed(chart, data, data["stress"].isel(body=own))


@figure(
    "largest stress of the run along every beam", takes="mode", variables=("section_moment",), height=56.0,
    missing=_NO_STRESS,
)  # fmt: skip
def stress_envelope(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the largest magnitude of stress over the run along every beam.

    Dotted lines are the axial part. Two values at one position are those on both sides of a node; crosses are the
    largest values under joints that slide along the beam.
    """
    found = stresses_of(data)
    whole, axial = (np.fmax.reduce(each, axis=1) for each in (found.whole, np.abs(found.axial)))
    curves = []
    for r in range(data.sizes["mode"]):
        bodies = [body for body in names_of(data, "body") if peak(whole[r, found.owners == body])]
        for k, body in enumerate(bodies):
            own, name, about = found.owners == body, text_symbol(body), {"run": r, "shown": (r,)}
            place = found.place[r, 0, own]
            curves.append(Curve(name, whole[r, own], place, look(k), **about))
            curves.append(Curve(name, axial[r, own], place, look(k)._replace(dash=DOTTED), **about))
            if "contact_moment" in data and len(marks := _under_contacts(data.isel(mode=r), body)):
                curves.append(Curve(name, marks[:, 1], marks[:, 0], look(k), **about, mark="cross"))
    if curves:
        note = "Dotted: the axial part. Crosses: under joints that slide along the beam."
        yield Chart("envelope", "Largest stresses along beams", Axis("stress", "Pa", low=0.0), curves,
                    Axis("distance from the first end", "m"), note=note)  # fmt: skip


def _under_contacts(run: xr.Dataset, body: str) -> np.ndarray:
    """Return position [m] and magnitude [Pa] (k, 2) of the largest stress under each joint that slides along a body."""
    found = stresses_of(run, CONTACT)
    known = np.flatnonzero((found.owners == body) & np.isfinite(found.whole).any(axis=0))
    at = [(int(np.nanargmax(found.whole[:, c])), c) for c in known]
    return np.array([(found.place[spot], found.whole[spot]) for spot in at])


@figure(
    "magnitude of the force in every joint over time", heading="Joints", takes="mode", variables=("joint_force",),
    height=56.0, written_as="joint_forces", written_with=(KINEMATICS, "frame_force"),
)  # fmt: skip
def joint_forces(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the magnitudes of all joint forces or of one, with components if there is a single run."""
    if not data.sizes["joint"]:
        return
    force = data["joint_force"].transpose("mode", "time", "joint", "axis")
    sizes = force.reduce(np.linalg.norm, "axis").assign_attrs(units="N")
    note = "On the joint's second body, in the ground frame."
    chart = followed(Chart("forces", "Joint forces", Axis("force"), choosing="joint", note=note), data, sizes)
    if data.sizes["mode"] == 1:
        several, (stopped,) = bool(chart.choices), stopped_runs(data)
        parts = {"magnitude": sizes.values[0], "x": force.values[0, ..., 0], "y": force.values[0, ..., 1]}
        curves = [
            Curve(word, values[:, j], look=look(k), run=0, choice=1 + j if several else None, stopped=stopped)
            for j in range(min(sizes.sizes["joint"], _MOST_CHOICES)) for k, (word, values) in enumerate(parts.items())
        ]  # fmt: skip
        chart = replace(chart, curves=[*(curve for curve in chart.curves if curve.choice == 0), *curves])
    yield replace(chart, choices=chart.choices[: 1 + _MOST_CHOICES])


@figure(
    "angle or travel of every joint, and its rate, over time", heading="Joints", takes="mode",
    variables=("joint_coordinate",), columns=2, height=44.0, written_as="joint_motions", written_with=(KINEMATICS,),
)  # fmt: skip
def joint_motions(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of angle and rate of the joints that turn, and of travel and speed of those that slide."""
    slides = sliding_joints(data)
    turns = ~slides & (data["joint_kind"].values != "weld")
    for own, variable, unit, identity, title, axis in (
        (turns, "joint_coordinate", "rad", "angle", "Joint angles", Axis("angle", symbol="φ")),
        (turns, "joint_speed", "rad/s", "rate", "Angular velocities of joints", Axis("angular velocity", symbol="φ̇")),
        (slides, "joint_coordinate", "m", "travel", "Joint travels", Axis("travel")),
        (slides, "joint_speed", "m/s", "speed", "Sliding speeds of joints", Axis("speed")),
    ):
        if own.any():
            values = data[variable].isel(joint=np.flatnonzero(own)).assign_attrs(units=unit)
            chart = Chart(f"joint-{identity}", title, axis, choosing="joint")
            yield followed(chart, data, values.transpose("mode", "time", "joint"))


@figure("torque, speed and power of motors and prescribed motions", heading=_LOADS, takes="mode", height=34.0,
        written_as="drive_efforts", written_with=(KINEMATICS, "frame_force"))  # fmt: skip
def drive_efforts(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of torque or force, speed and power of motors and prescribed motions over time."""
    torque = "torque" if "torque" in data else "applied_torque"
    if not {"motor_power", "drive_power"} & set(data):
        return  # results of an earlier version
    for quantity, usual, names in (
        ("effort", "N m", {"motor": torque, "drive": "drive_torque"}),
        ("speed", "rad/s", {"motor": "motor_speed", "drive": "drive_speed"}),
        ("power", "W", {"motor": "motor_power", "drive": "drive_power"}),
    ):
        found = {dim: data[name] for dim, name in names.items() if name in data and data.sizes[dim]}
        if not found:
            continue
        members = [name for dim in found for name in names_of(data, dim)]
        values = [
            xr.broadcast(one, data["time"])[0].transpose("mode", "time", dim).values for dim, one in found.items()
        ]
        units = dict.fromkeys(unit for one in found.values() for unit in str(one.attrs.get("units", usual)).split(", "))
        whose = " and ".join({"motor": "motors", "drive": "prescribed motions"}[dim] for dim in found)
        # Units of rotating members precede those of sliding ones.
        unit = ", ".join(sorted(units, key=lambda unit: unit in ("N", "m/s")))
        word = {**EFFORTS, "N m, N": "torque, force"}.get(unit, quantity)
        title = {"torque, force": "Efforts", "power": "Powers"}.get(word, f"{word.capitalize()}s")
        # The chart of the motors' torques alone is also that of `motor_torques`, shown once on a page.
        identity = "torques" if quantity == "effort" and "drive" not in found else f"{quantity}s"
        axis = Axis(word, symbol="τ" if word == "torque" else "", zero=True)
        choosing = "drive" if "drive" in found else "motor"
        both = xr.DataArray(np.concatenate(values, axis=2), {"member": members}, ("mode", "time", "member"))
        yield followed(
            Chart(identity, f"{title} of {whose}", axis, choosing=choosing), data, both.assign_attrs(units=unit)
        )


@figure(
    "shaking force and moment of the mechanism on the ground", heading=_LOADS, takes="mode", variables=("frame_force",),
    height=40.0, written_as="frame_loads", written_with=(KINEMATICS, "frame_force"),
)  # fmt: skip
def frame_loads(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of force and moment of the mechanism on the ground, the latter about the origin."""
    note = "Sum over all joints and springs on the ground: the shaking force."
    force = Chart("frame", "Force on the ground", Axis("force", zero=True), choosing="direction", note=note)
    yield followed(force, data, data["frame_force"].transpose("mode", "time", "axis"))
    moment = Chart("frame-moment", "Moment on the ground about the origin", Axis("moment", "N m", zero=True))
    # The moment continues the sequence of looks.
    yield of_names(moment, data, [("", data["frame_moment"].transpose("mode", "time").values)], first=2)


# Tables


def run_columns(runs: Sequence[tuple[str, ...]], heads: Sequence[str]) -> list[Column]:
    """Return columns with the names of runs, one run for each row."""
    return [Column(head, [run[k] for run in runs]) for k, head in enumerate(heads)]


def stress_table(loads: LoadsOfRuns, heads: Sequence[str] = (), *, largest: bool = False) -> Table:
    """Return the table of the largest stresses of beams.

    Parameters
    ----------
    loads : mapping of tuple to mapping
        Loads by run.
    heads : sequence of str
        Headings of the names of a run.
    largest : bool
        Whether only the beam with the largest stress of each run is listed, as always if there are many rows.
    """
    rows = [(run, body, one) for run, each in loads.items() for body, one in each.get("beams", {}).items()]
    note = (
        "Stress: bending and axial together, with place and time of the largest. Bending, in the outermost fibre, and "
        "axial are each largest at places and times of their own, and do not add up to it."
    )
    if largest or len(rows) > _MOST_ROWS:
        beams = [[row for row in rows if row[0] == run] for run in dict.fromkeys(run for run, *_ in rows)]
        rows = [max(each, key=lambda row: row[2]["stress_max"] or 0.0) for each in beams]
        note += " For each run, the beam with the largest stress."
    figures = [one for *_, one in rows]
    if any(one["stress_max"] is None for one in figures):
        note += " A section without outer_fibre has no bending stress."
    elif any(one["axial_stress_max"] is None for one in figures):
        note += " Coordinates of a beam without axial stress do not stretch: its stress is of bending alone."
    if any(resolved_error(one, "stress") for one in figures):
        note += _ERRORS
    columns = [
        *run_columns([run for run, *_ in rows], heads),
        Column("beam", [body for _, body, _ in rows]),
        _largest(figures, "stress", "Pa"),
        Column("safety factor", [_safety(one["safety_factor"]) for one in figures]),
        *columns_of(figures, ("at", "place", "m"), ("time", "time", "s"), ("bending", "bending_stress_max", "Pa"),
                    ("axial", "axial_stress_max", "Pa")),
    ]  # fmt: skip
    return Table("Stresses of beams", columns, note).filled()


def _safety(factor: float | None) -> Cell:
    return f"{number(factor, 3)}\nover strength" if factor is not None and factor < 1.0 else factor


def effort_table(loads: Mapping[str, Any]) -> Table:
    """Return the table of the largest efforts of motors and prescribed motions of one run."""
    efforts = {**loads.get("motors", {}), **loads.get("drives", {})}
    rows = list(efforts.values())
    units = {one["torque_unit"] for one in rows}
    word = EFFORTS.get(units.pop() or "" if len(units) == 1 else "", "torque, force")
    columns = [Column("motor or drive", list(efforts))]
    for head, key, other in ((word, "torque", "N m or N"), ("speed", "speed", "rad/s or m/s")):
        if word == "torque, force":
            cells: list[Cell] = [f"{number(one[f'{key}_max'])}\n{one[f'{key}_unit'] or other}" for one in rows]
            columns.append(Column(head, cells))
        else:
            columns.append(Column(head, [one[f"{key}_max"] for one in rows], rows[0][f"{key}_unit"]))
        columns.append(Column("at", [one[f"{key}_time"] for one in rows], "s"))
    columns += columns_of(rows, ("power", "power_max", "W"), ("at", "power_time", "s"), ("energy", "energy", "J"))
    note = "Largest magnitudes and their times; energy: integral of the power's magnitude."
    return Table("Motors and prescribed motions", columns, note)


def joint_tables(loads: Mapping[str, Any]) -> Iterator[Table]:
    """Yield the tables of joints that turn, joints that slide, and loads on the ground, of one run.

    Angles and travels have separate tables because their units differ.
    """
    title, joints = "Joints and ground", loads.get("joints", {})
    wide = {key: max((one[f"{key}_max"] or 0.0 for one in joints.values()), default=0.0) for key in ("force", "moment")}
    for unit, what, word in (("rad", "Joints that turn", "angle"), ("m", "Joints that slide", "travel")):
        own = {name: one for name, one in joints.items() if one["unit"] == unit}
        rows = list(own.values())
        shown = display_unit(unit, [one[key] for one in rows for key in ("least", "most")])
        note = f"{what}. From and to: {word}; largest magnitudes and their times."
        if any(resolved_error(one, key) for one in rows for key in ("force", "moment")):
            note += _ERRORS
        yield Table(title, [
            Column("joint", list(own)),
            *columns_of(rows, ("from", "least", unit), ("to", "most", unit), shown=shown),
            *columns_of(rows, ("speed", "speed_max", f"{unit}/s"), ("at", "speed_time", "s")),
            *(column for key, of in (("force", "N"), ("moment", "N m")) for column in (
                _largest(rows, key, of, beside=wide[key]),
                Column("at", [_time(one, key, wide[key]) for one in rows], "s"),
            )),
        ], note)  # fmt: skip
    frame = [loads["frame"]] if "frame" in loads else []
    yield Table(title, [
        Column("", ["on the ground"] * len(frame)),
        *(column for key, of in (("force", "N"), ("moment", "N m")) for column in (
            _largest(frame, key, of), Column("at", [one[f"{key}_time"] for one in frame], "s"),
        )),
    ], "The sum of all joints, about the origin.")  # fmt: skip


def _largest(rows: Sequence[Mapping[str, Any]], load: str, unit: str, *, beside: float = 0.0) -> Column:
    """Return the column of a largest load with its errors."""
    errors = [resolved_error(one, load) for one in rows]
    return Column(load, [one[f"{load}_max"] for one in rows], unit, beside=beside, errors=errors)


def _time(one: Mapping[str, Any], load: str, beside: float) -> float | None:
    """Return the time of a largest load; None for a load that is zero, up to rounding beside a magnitude."""
    return None if number(one[f"{load}_max"], beside=beside) in ("0", NO_VALUE) else one[f"{load}_time"]
