"""Figure of numerical damping: damping ratio, period error and spectral radius of each integration method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.integrators import METHODS
from paraflex.integrators.spectra import Spectrum, spectrum
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.methods import method_look
from paraflex.plots.scales import name_powers
from paraflex.plots.style import ZERO, journal_style

# Orders of the multistep methods that are shown; IDA is omitted because its characteristic roots are those of BDF.
_ORDERS = {"adams": (4,), "bdf": (2, 5), "ndf": (2,)}
CURVES: tuple[tuple[str, int | None], ...] = tuple(
    (name, order) for name in METHODS if name != "ida" for order in _ORDERS.get(name, (None,))
)
# Frequencies h omega that a step resolves, and the whole range up to those at which modes need only be damped [rad].
_RESOLVED, _HIGH = np.geomspace(0.1, 3.0, 120), np.geomspace(0.1, 1e4, 240)
# Range of damping ratio and period error shown, and largest spectral radius shown.
_SHOWN, _GROWN = (1e-6, 1.0), 1.5


@journal_style()
@checked_arguments(curves='give pairs of a method and an order or None, such as [("bdf", 2)]')
def numerical_damping(curves: Sequence[tuple[str, int | None]] = CURVES) -> Figure:
    """Plot damping ratio, period error and spectral radius over h omega, for x'' = -omega^2 x and steps of size h.

    Damping ratio and period error are shown where the method is stable and their magnitude is not negligible.

    Parameters
    ----------
    curves : sequence of (str, int or None)
        Names of methods, each with an order if the method has several; by default all methods but IDA.
    """
    figure, axes = panels(1, 3)
    members: dict[str, int] = {}
    for name, order in curves:
        method = METHODS[name]
        number = members[method.family.value] = members.get(method.family.value, -1) + 1
        look: dict[str, Any] = method_look(method.family.value, number) | {"marker": ""}
        label = method.title if not method.multistep else f"{method.title.split(' ')[0]} {order}"
        low, high = (spectrum(name, frequency, order=order) for frequency in (_RESOLVED, _HIGH))
        axes[0, 0].plot(low.frequency, _shown(low, low.damping_ratio), label=label, **look)
        axes[0, 1].plot(low.frequency, _shown(low, np.abs(low.period_error)), label=label, **look)
        axes[0, 2].plot(high.frequency, np.where(high.radius < _GROWN, high.radius, np.nan), label=label, **look)
    titles = ("damping ratio", "period error, as a fraction", "spectral radius")
    for panel, title in zip(axes[0], titles, strict=True):
        panel.set_title(title)
        panel.set_xlabel(r"$h\,\omega$ [rad]")
        panel.set_xscale("log")
        name_powers(panel.xaxis)
    for panel in axes[0, :2]:
        panel.set_yscale("log")
        panel.set_ylim(*_SHOWN)
        panel.grid(color="0.9", linewidth=0.4)
        name_powers(panel.yaxis)
    axes[0, 2].set_ylim(0.0, _GROWN)
    axes[0, 2].axhline(1.0, **ZERO)
    return lay_out(figure, axes, panel_height=62.0)


def _shown(found: Spectrum, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with NaN where the method is unstable or the value is too small for the logarithmic axis."""
    return np.where((found.radius < 1.0 + 1e-9) & (values > 0.1 * _SHOWN[0]), values, np.nan)
