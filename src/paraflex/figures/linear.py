"""Charts and tables of linear models: gains, frequency responses, poles, zeros, frequencies and damping ratios."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
import xarray as xr

from paraflex.arrays import Array, Complex
from paraflex.formatting import NO_VALUE, number, text_symbol
from paraflex.results.linear_summary import (
    END_EFFECTOR,
    HELD_WORDS,
    HOLDINGS,
    MAP_WORDS,
    Root,
    channel_unit,
    common_poles,
    gain_unit,
    gains_of,
    limiting_zero,
    motors_of_mode,
    oscillations,
    poles_of,
    right_half_plane,
    roots,
    zeros_of,
)
from paraflex.units import DisplayUnit
from .charts import DASHED, DOTTED, N_COLOURS, PLAIN_LOOK, Axis, Chart, Curve, Look, Span, look
from .entry import NOTHING, figure
from .selection import names_of, place_of
from .tables import Column, Table, table_of

# Rows of poles: mode, state of its motors, and poles.
Row = tuple[str, str, Complex]

_HEADING = "Responses, poles and zeros"
# Remedy for models without maps from motors.
_OTHERS = "draw bode for other inputs and outputs"
FREQUENCY = Axis("frequency", "Hz", log=True)
_DEGREES = DisplayUnit("°", 180.0 / math.pi)
# Largest numbers of branches drawn, and of oscillations, poles or zeros in a row; linear.nc and linear.json have all.
_BRANCHES, _OSCILLATIONS, _ROOTS = 7, 6, 5
# A smaller damping ratio is a rounding error.
_ROUNDING = 1e-7
# Share of the largest drawn magnitude below which a pole is zero.
_NOTHING = 1e-7
# Sizes of the rings of the last mode's zeros, and its increment from mode to mode, so that equal rings are nested.
_RING, _RING_STEP = 0.7, 0.25
_ROOTS_NOTE = "Those on the imaginary axis as frequencies [Hz]; * marks the right half plane."


# Charts


@figure(
    "gains from motors to their encoders and to the end-effector over frequency, all modes", heading=_HEADING,
    written_as="singular_values", height=62.0, missing=(NOTHING, _OTHERS),
)  # fmt: skip
def singular_values(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the largest and least gain from a mode's motors to their own encoders and to the end-effector.

    Gains are singular values of the frequency response; a dip of the least gain indicates zeros.
    """
    frequency = data["frequency"].values
    for name in names_of(data, "map"):
        curves = []
        for k, mode in enumerate(names_of(data, "mode")):
            gains, own = gains_of(data, mode, name), Look(k % N_COLOURS, min(k // N_COLOURS, DASHED))
            curves.append(Curve(f"mode {mode}", gains[:, 0], frequency, own))
            if gains.shape[1] > 1:
                curves.append(Curve(f"mode {mode}", gains[:, -1], frequency, own._replace(dash=DOTTED)))
        yield Chart(
            f"gain-{name}", f"Gains: {MAP_WORDS[name]}", Axis("gain", gain_unit(data, name), log=True), curves,
            FREQUENCY, note="Singular values; the least, dotted, dips at zeros.",
        )  # fmt: skip


@figure(
    "magnitude and phase from motors to their encoders and to the end-effector", takes="mode", written_as="bode",
    panels="choices", height=46.0,
)  # fmt: skip
def bode(data: xr.Dataset, inputs: list[str] | None = None, outputs: list[str] | None = None) -> Iterator[Chart]:
    """Yield charts of magnitude and phase from a mode's motors to their own encoders and to the end-effector.

    Parameters
    ----------
    inputs : list of str, optional
        Inputs; by default the motors of the mode, or all inputs for a mode without motors.
    outputs : list of str, optional
        Outputs; by default each motor's own encoder, then the end-effector's coordinates.
    """
    run = data.isel(mode=0)
    joints = json.loads(data.attrs["motor_joints"])
    chosen = inputs or motors_of_mode(data, names_of(data, "mode")[0]) or names_of(data, "input")
    if outputs is None:
        own = [""] if set(chosen) <= set(joints) else []
        outputs = own + json.loads(data.attrs["end_effector_outputs"])
    magnitudes, phases, units, ranges = list[Curve](), list[Curve](), list[Axis](), list[Axis]()
    outputs = outputs or names_of(data, "output")
    for c, output in enumerate(outputs):
        angles = []
        for k, name in enumerate(chosen):
            response = _channel(run, name, output or joints[name])
            # The phase lies in (-360°, 0]; a response that is real up to rounding has 0 or -180°.
            angle = np.angle(response)
            angles.append(np.where(angle > 1e-8, angle - 2.0 * np.pi, angle))
            for curves, y in ((magnitudes, np.abs(response)), (phases, angles[-1])):
                curves.append(Curve(text_symbol(name), y, data["frequency"].values, look(k), choice=c))
        unit = channel_unit(data, chosen, [output or joints[chosen[0]]])
        units.append(Axis("magnitude", unit, log=True))
        ranges.append(_phase_axis(angles))
    words = [f"to {text_symbol(output)}" if output else "to its own encoder" for output in outputs]
    if words:
        yield Chart("magnitude", "Magnitude", units, magnitudes, FREQUENCY, words, "output")
        yield Chart("phase", "Phase", ranges, phases, FREQUENCY, words, "output")


def _channel(run: xr.Dataset, name: str, output: str) -> Complex:
    i, k = place_of(name, names_of(run, "input"), "input"), place_of(output, names_of(run, "output"), "output")
    one = run.isel(input=i, output=k)
    return one["response_real"].values + 1j * one["response_imag"].values


def _phase_axis(angles: Sequence[Array]) -> Axis:
    """Return the axis of phases (k,) in (-360°, 0], whose range is half of that if no phase is below -180°."""
    lowest = min(np.nanmin(each, initial=0.0) for each in angles)
    turns = -180 if math.degrees(lowest) > -185.0 else -360
    ticks = [math.radians(each) for each in range(turns, 1, 45 if turns == -180 else 90)]
    room = math.radians(20.0)
    return Axis("phase", "rad", low=ticks[0] - room, high=room, ticks=ticks, shown=_DEGREES)


@figure(
    "poles and zeros in the complex plane, all modes", heading=_HEADING, written_as="pole_zero_map", height=70.0,
    missing=(NOTHING, _OTHERS),
)  # fmt: skip
def pole_zero_map(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of poles (crosses, motors free) and zeros (rings) of all modes, on symmetrical logarithmic axes.

    One chart shows the map from the motors to their own encoders, whose zeros are the poles with these motors held, the
    other the map from the motors to the end-effector. The right half plane, with non-minimum-phase zeros, is shaded.
    """
    modes, maps, common = names_of(data, "mode"), names_of(data, "map"), common_poles(data)
    most = 2.0 * np.pi * float(data["frequency"].values[-1])
    poles = [("poles, motors free", common, PLAIN_LOOK)] if common is not None else [
        (f"poles, mode {mode}", poles_of(data, mode, "free"), look(k)) for k, mode in enumerate(modes)
    ]  # fmt: skip
    zeros = {name: [zeros_of(data, mode, name) for mode in modes] for name in maps}
    sizes = np.abs(
        np.concatenate([*(values for _, values, _ in poles), *(one for each in zeros.values() for one in each)])
    )
    least = 10.0 ** np.floor(np.log10(np.min(sizes[sizes > _NOTHING * most], initial=most)))
    real, imaginary = (
        Axis(f"{part} part", "rad/s", linear_below=least, zero=True, low=-1.6 * most, high=1.6 * most)
        for part in ("real", "imaginary")
    )

    def marks(name: str, values: Complex, own: Look, mark: Literal["ring", "cross"], size: float = 1.0) -> Curve:
        kept = values[np.abs(values) <= most]
        texts = [Root(complex(one.real, abs(one.imag)), False, 1).text for one in kept]
        return Curve(name, kept.imag, kept.real, own, mark=mark, size=size, texts=texts)

    for name in maps:
        rings = [
            marks(f"zeros, mode {mode}", zeros[name][k], look(k), "ring", _RING + _RING_STEP * (len(modes) - 1 - k))
            for k, mode in enumerate(modes)
        ]
        crosses = [marks(each, values, own, "cross") for each, values, own in poles]
        yield Chart(
            f"map-{name}", f"Poles and zeros: {MAP_WORDS[name]}", imaginary, [*rings, *crosses], real,
            spans=[Span(0.0, math.inf)],
            note="Symmetrical logarithmic axes. Right of the line, shaded: zeros of non-minimum phase, unstable poles.",
        )  # fmt: skip


@figure(
    "frequencies and real parts of poles along the motion", heading=_HEADING, takes="mode", panels="choices",
    written_as="poles_along_path", variables=("branch_real",),
    missing=(NOTHING, "linearise with --along, or give along="),
)  # fmt: skip
def poles_along_path(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of frequencies and real parts of the lowest poles along a motion, motors free and held.

    Each branch, followed by its mode shape, has a colour. Poles of frozen-time models do not decide stability.
    """
    chosen = [(mode, holding) for mode in names_of(data, "mode") for holding in HOLDINGS]
    choices = [f"mode {mode}, {HELD_WORDS[holding]}" for mode, holding in chosen]
    frequencies, real = list[Curve](), list[Curve]()
    for c, (mode, holding) in enumerate(chosen):
        held = data.sel(mode=mode, holding=holding).isel(branch=slice(_BRANCHES))
        values = held["branch_real"].values + 1j * held["branch_imag"].values
        for k in np.flatnonzero(np.isfinite(values.real).any(axis=0)):
            for curves, y in ((frequencies, np.abs(values[:, k]) / (2.0 * np.pi)), (real, values[:, k].real)):
                curves.append(Curve(f"branch {k + 1}", y, data["moment"].values, look(int(k)), choice=c))
    time = Axis("time", "s")
    note = "Each branch is followed by its motion. Frozen at instants, poles say nothing about stability."
    yield Chart("branches", "Frequencies along the motion", Axis("frequency", "Hz"), frequencies, time, choices,
                "mode and motors", note=note)  # fmt: skip
    yield Chart("branch-real", "Real parts along the motion", Axis("real part", "1/s", zero=True), real, time, choices,
                "mode and motors")  # fmt: skip


# Tables


def tables(data: xr.Dataset) -> Iterator[Table]:
    """Yield the tables: frequencies with damping ratios, poles unless all are on the imaginary axis, and zeros."""
    rows = held_rows(data)
    yield _frequency_table(rows)
    if not all(one.on_axis for _, _, poles in rows for one in roots(poles)):
        cells = [(mode, held, _lowest(poles)) for mode, held, poles in rows]
        yield table_of("Poles", [("mode", ""), ("motors", ""), ("lowest", "")], cells, _ROOTS_NOTE)
    for name in names_of(data, "map"):
        modes = names_of(data, "mode")
        zeros = [zeros_of(data, mode, name) for mode in modes]
        columns = [Column("mode", modes), Column("lowest zeros", list(map(_lowest, zeros))),
                   Column("minimum phase", list(map(_phase, zeros)))]  # fmt: skip
        yield Table(f"Zeros: {MAP_WORDS[name]}", columns, _ROOTS_NOTE)


def tiles(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return the tiles of the first frequencies with motors held, and of the lowest right-half-plane zero."""
    modes = names_of(data, "mode")
    shown = []
    first = {mode: oscillations(poles_of(data, mode, "held"))[:1] for mode in modes if motors_of_mode(data, mode)}
    known = {mode: found[0].frequency for mode, found in first.items() if found}
    if known:
        for words, choose in (("lowest", min), ("highest", max))[: 2 if len(known) > 1 else 1]:
            mode = choose(known, key=lambda name: known[name])
            shown.append((f"{words} first frequency, motors held", f"{number(known[mode])} Hz", f"mode {mode}"))
    limits = {mode: limiting_zero(zeros_of(data, mode, END_EFFECTOR)) for mode in modes if END_EFFECTOR in data["map"]}
    limits = {mode: limit for mode, limit in limits.items() if limit}
    if limits:
        mode = min(limits, key=lambda name: limits[name])
        shown.append(
            ("lowest right-half-plane zero to the end-effector", f"{number(limits[mode])} rad/s", f"mode {mode}")
        )
    return shown


def held_rows(data: xr.Dataset) -> list[Row]:
    """Return rows of mode, state of its motors ("free", "held", or "none" if it has none), and poles.

    If the poles with motors free are the same in all modes, they have one row, "all".
    """
    modes, common = names_of(data, "mode"), common_poles(data)
    rows = [("all", "free", common)] if common is not None else [
        (mode, "free" if motors_of_mode(data, mode) else "none", poles_of(data, mode, "free")) for mode in modes
    ]  # fmt: skip
    return rows + [(mode, "held", poles_of(data, mode, "held")) for mode in modes if motors_of_mode(data, mode)]


def _frequency_table(rows: Sequence[Row]) -> Table:
    """Return the table of the lowest frequencies and, if any pole is damped, of damping ratios below them."""
    found = [oscillations(poles)[:_OSCILLATIONS] for _, _, poles in rows]
    shown = [row for row, own in zip(rows, found, strict=True) if own]
    found = [own for own in found if own]
    damped = any(abs(one.damping_ratio) > _ROUNDING for own in found for one in own)
    columns = [Column("mode", [mode for mode, _, _ in shown]), Column("motors", [held for _, held, _ in shown])]
    for k in range(max(map(len, found), default=0)):
        each = [own[k] if k < len(own) else None for own in found]
        ratios = [None if one is None else 0.0 if abs(one.damping_ratio) < _ROUNDING else 100.0 * one.damping_ratio
                  for one in each]  # fmt: skip
        cells = [None if one is None else one.frequency for one in each]
        columns.append(Column(str(k + 1), cells, "Hz", below=ratios if damped else (), below_unit="%"))
    note = (
        "Poles s: |s| / 2π and, below it, the damping ratio if any has one. Motions without a frequency are left out."
    )
    return Table("Frequencies and damping" if damped else "Frequencies", columns, note)


def _lowest(values: Complex) -> str:
    """Return the lowest poles or zeros and, below them, how many more there are."""
    found = roots(values)
    more = f"\nand {len(found) - _ROOTS} more" if len(found) > _ROOTS else ""
    return (", ".join(one.text for one in found[:_ROOTS]) or "none") + more


def _phase(zeros: Complex) -> str:
    """Return whether a map with these zeros is of minimum phase."""
    if not zeros.size:
        return NO_VALUE
    if limit := limiting_zero(zeros):
        return f"no, from {number(limit)} rad/s on"
    return "nearly, beside the axis" if right_half_plane(zeros).size else "yes"
