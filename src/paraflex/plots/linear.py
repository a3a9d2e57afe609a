"""Figures of linear models: responses, poles and zeros, poles along a motion."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.figures.selection import default_mode, names_of, place_of, select_run
from paraflex.formatting import logarithmic_number
from paraflex.plots.given import drawn
from paraflex.plots.labels import plain, symbol
from paraflex.plots.layout import TWO_COLUMNS, is_narrow, label_outer_time, lay_out, panel_grid, panels
from paraflex.plots.scales import mark_powers
from paraflex.plots.style import BLACK, COLOURS, DASHES, ZERO, look_of
from paraflex.results.linear_data import HOLDINGS
from paraflex.results.linear_summary import (
    HELD_WORDS,
    MAP_WORDS,
    channel_unit,
    common_poles,
    gain_unit,
    gains_of,
    motors_of_mode,
    poles_of,
    zeros_of,
)

Complex = NDArray[np.complex128]

# Decades of a gain shown below its largest value.
_DECADES = 9.0
# Size of the rings of zeros and its increment from mode to mode, so that coincident rings are nested [pt].
_RING, _RING_STEP = 3.2, 0.9


@drawn
def singular_values(data: xr.Dataset) -> Figure:
    """Plot the largest and smallest gain from the motors of every mode to their own encoders and to the end-effector.

    Gains are singular values of the frequency response; a dip of the smallest gain indicates zeros.
    """
    modes, (figure, axes, maps) = names_of(data, "mode"), _map_panels(data)
    for panel, name in zip(axes.flat, maps, strict=False):
        for k, mode in enumerate(modes):
            gains = gains_of(data, mode, name)
            look = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[(k // len(COLOURS)) % len(DASHES)]}
            panel.plot(data["frequency"].values, gains[:, 0], label=f"mode {plain(mode)}", **look)
            if gains.shape[1] > 1:
                panel.plot(data["frequency"].values, gains[:, -1], linewidth=0.45, **look)
        panel.set_title(MAP_WORDS[name])
        panel.set_ylabel(f"largest (bold) and least gain [{gain_unit(data, name)}]")
        _over_frequency(panel, data)
        _gain_axis(panel)
    return lay_out(figure, axes, panel_height=62.0)


@drawn
def bode(
    data: xr.Dataset, mode: str | None = None, inputs: list[str] | None = None, outputs: list[str] | None = None
) -> Figure:
    """Plot the frequency responses of a mode's motors to their own encoders and to the end-effector's coordinates.

    Each column of panels shows magnitude and phase for one output.

    Parameters
    ----------
    inputs : list of str, optional
        Inputs; by default the motors of the mode, or all inputs for a mode without motors.
    outputs : list of str, optional
        Outputs; by default each motor's own encoder, then the end-effector's coordinates.
    """
    mode = default_mode(data) if mode is None else mode
    run = select_run(data, mode)
    joints, motors = json.loads(data.attrs["motor_joints"]), motors_of_mode(data, mode)
    chosen = inputs or motors or names_of(data, "input")
    own = [""] if outputs is None and set(chosen) <= set(joints) else []
    columns = own + (json.loads(data.attrs["end_effector_outputs"]) if outputs is None else outputs)
    if not columns:
        columns = names_of(data, "output")
    figure, axes = panels(2, len(columns), width=TWO_COLUMNS)
    frequency = data["frequency"].values
    for column, output in enumerate(columns):
        for k, name in enumerate(chosen):
            to = output or joints[name]
            response = _channel(run, name, to)
            axes[0, column].plot(frequency, np.abs(response), label=symbol(name), **look_of(k))
            angle = np.degrees(np.angle(response))
            # The phase lies in (-360, 0]; a response that is real up to rounding has 0 or -180.
            phase = np.where(angle > 1e-6, angle - 360.0, angle)
            axes[1, column].plot(frequency, phase, label=symbol(name), **look_of(k))
        axes[0, column].set_title("to its own encoder" if not output else f"to {symbol(output)}")
        axes[0, column].set_ylabel(f"magnitude [{channel_unit(data, chosen, [output or joints[chosen[0]]])}]")
        axes[1, column].set_ylabel("phase [°]")
        lines = axes[1, column].get_lines()
        turns = -180 if min(float(np.nanmin(line.get_ydata(), initial=0.0)) for line in lines) > -185.0 else -360
        axes[1, column].set_ylim(turns - 20.0, 20.0)
        axes[1, column].set_yticks(range(turns, 1, 90 if turns < -180 else 45))
        for panel in axes[:, column]:
            _over_frequency(panel, data)
        _gain_axis(axes[0, column])
        axes[0, column].tick_params(labelbottom=False)
        axes[0, column].set_xlabel("")
    return lay_out(figure, axes, panel_height=46.0)


@drawn
def pole_zero_map(data: xr.Dataset) -> Figure:
    """Plot poles (crosses, motors free) and zeros (rings) of all modes in the complex plane, on symlog scales.

    One panel shows the map from the motors to their own encoders, whose zeros are the poles with these motors held, the
    other the map from the motors to the end-effector. The right half plane, with non-minimum-phase zeros, is shaded.
    """
    modes, (figure, axes, maps) = names_of(data, "mode"), _map_panels(data)
    most = 2.0 * np.pi * float(data["frequency"].values[-1])
    poles = [_within(poles_of(data, mode, "free"), most) for mode in modes]
    same = common_poles(data) is not None
    zeros = {name: [_within(zeros_of(data, mode, name), most) for mode in modes] for name in maps}
    least = _linear_below([*poles, *(one for each in zeros.values() for one in each)])
    for panel, name in zip(axes.flat, maps, strict=False):
        for k, mode in enumerate(modes):
            _rings(panel, zeros[name][k], k, len(modes), f"zeros, mode {plain(mode)}")
            if not same:
                _crosses(panel, poles[k], COLOURS[k % len(COLOURS)], f"poles, mode {plain(mode)}")
        if same:
            _crosses(panel, poles[0], BLACK, "poles, motors free")
        panel.set_title(MAP_WORDS[name])
        panel.set_xlabel("real part [rad/s]")
        panel.set_ylabel("imaginary part [rad/s]")
        for axis, set_scale, set_limits in (
            (panel.xaxis, panel.set_xscale, panel.set_xlim), (panel.yaxis, panel.set_yscale, panel.set_ylim)
        ):  # fmt: skip
            set_scale("symlog", linthresh=least, linscale=0.5)
            set_limits(-1.6 * most, 1.6 * most)
            axis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=least))
            axis.set_major_formatter(FuncFormatter(_signed_power))
        panel.axvspan(0.0, 1.6 * most, color="0.95", linewidth=0.0, zorder=0.0)
        panel.axvline(0.0, color="0.35", linewidth=0.8, zorder=0.6)
        panel.axhline(0.0, **ZERO)
    return lay_out(figure, axes, panel_height=70.0 if len(maps) > 1 else 84.0)


@drawn
def poles_along_path(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot frequencies and real parts of the lowest poles of a mode along a motion, motors free and held.

    Each branch, followed by its mode shape, has a colour. Poles of frozen-time models do not decide stability.
    """
    if "branch_real" not in data:
        raise InputError(
            "these linear models are about one instant", field="data", remedy="linearise with --along, or give along="
        )
    mode = default_mode(data) if mode is None else mode
    run = select_run(data, mode)
    figure, axes = panels(2, len(HOLDINGS))
    for column, holding in enumerate(HOLDINGS):
        held = run.sel(holding=holding)
        values = held["branch_real"].values + 1j * held["branch_imag"].values
        for k in range(values.shape[1]):
            if not np.isfinite(values[:, k].real).any():
                continue
            look = {"label": f"branch {k + 1}", **look_of(k)}
            axes[0, column].plot(data["moment"].values, np.abs(values[:, k]) / (2.0 * np.pi), **look)
            axes[1, column].plot(data["moment"].values, values[:, k].real, **look)
        axes[0, column].set_title(f"mode {plain(mode)}, {HELD_WORDS[holding]}")
        axes[1, column].axhline(0.0, **ZERO)
    axes[0, 0].set_ylabel("frequency [Hz]")
    axes[1, 0].set_ylabel("real part [1/s]")
    label_outer_time(axes)
    return lay_out(figure, axes, panel_height=48.0)


def _map_panels(data: xr.Dataset) -> tuple[Figure, NDArray[Any], list[str]]:
    """Create a panel for each map, to the own encoders and to the end-effector, and return the names of the maps."""
    maps = names_of(data, "map")
    if not maps:
        raise InputError(
            "no motors, and no end-effector", field="data", remedy="draw bode for other inputs and outputs"
        )
    return *panel_grid(len(maps), 1 if is_narrow() else len(maps)), maps


def _channel(run: xr.Dataset, name: str, output: str) -> Complex:
    for what, one in (("input", name), ("output", output)):
        place_of(one, names_of(run, what), what)
    one = run.sel(input=name, output=output)
    return one["response_real"].values + 1j * one["response_imag"].values


def _over_frequency(panel: Axes, data: xr.Dataset) -> None:
    frequency = data["frequency"].values
    panel.set_xlabel("frequency [Hz]")
    mark_powers(panel, "x")
    panel.set_xlim(frequency[0], frequency[-1])


def _gain_axis(panel: Axes) -> None:
    """Make the y axis logarithmic; its range excludes isolated dips and spans about `_DECADES` decades at most."""
    values = np.concatenate([np.abs(line.get_ydata()) for line in panel.get_lines()])  # type: ignore[arg-type]
    values = values[np.isfinite(values) & (values > 0.0)]
    mark_powers(panel)
    panel.yaxis.set_minor_locator(NullLocator())
    if values.size:
        top = values.max()
        panel.set_ylim(max(0.5 * np.percentile(values, 0.5), top * 10.0**-_DECADES), 2.0 * top)


def _within(values: Complex, most: float) -> Complex:
    return values[np.abs(values) <= most]


def _linear_below(values: list[Complex]) -> float:
    """Return the threshold below which symlog axes are linear: a power of ten below all non-zero magnitudes."""
    sizes = np.abs(np.concatenate(values))
    least = float(np.min(sizes[sizes > 1e-9 * sizes.max(initial=1.0)], initial=np.inf))
    return 10.0 ** np.floor(np.log10(least)) if np.isfinite(least) else 1.0


def _crosses(panel: Axes, poles: Complex, colour: str, label: str) -> None:
    panel.plot(poles.real, poles.imag, "x", color=colour, markersize=4.0, markeredgewidth=0.8, label=label, zorder=3.0)


def _rings(panel: Axes, zeros: Complex, number: int, count: int, label: str) -> None:
    size = _RING + _RING_STEP * (count - 1 - number)
    panel.plot(
        zeros.real, zeros.imag, "o", markerfacecolor="none", markeredgecolor=COLOURS[number % len(COLOURS)],
        markersize=size, markeredgewidth=0.8, label=label, zorder=2.0,
    )  # fmt: skip


def _signed_power(value: float, _: Any) -> str:
    if value == 0.0:
        return "0"
    return ("\N{MINUS SIGN}" if value < 0.0 else "") + logarithmic_number(abs(value))
