"""Summaries of linear models as plain numbers and in words: poles, zeros, and those in the right half-plane."""

import json
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Complex
from paraflex.formatting import number, quantity
from .kinds import check_kind

# Motors are free, or those of the actuation mode are held.
HOLDINGS = ("free", "held")
ENCODERS, END_EFFECTOR = "encoders", "end_effector"
# A value whose real part is below this fraction of its magnitude is on the imaginary axis, within rounding.
_ON_AXIS = 1e-4
# Zeros with a real part below this fraction of their magnitude do not limit the bandwidth. They occur in motion, and
# where double zeros are split.
_BESIDE_AXIS = 0.05
# Poles or zeros with a relative difference below this one are multiple: rounding splits double ones.
_SAME = 1e-4
# Poles with motors free of different modes are equal if their relative difference is below this one.
_COMMON = 1e-6
# Poles and zeros below this fraction of the median magnitude are zero: a double one at zero is split by the square root
# of the rounding error.
_ZERO = 1e-7
MAP_WORDS = {ENCODERS: "motors to their encoders", END_EFFECTOR: "motors to the end-effector"}
HELD_WORDS = {"free": "motors free", "held": "motors held"}
SOURCES = {
    "a pose at rest": "about a pose at rest", "static equilibrium": "about static equilibrium",
    "a planned motion": "about the planned motion at t = {time} s", "a run": "about the run at t = {time} s",
}  # fmt: skip


class Root(NamedTuple):
    """Pole or zero: value in the upper half-plane, whether its mirror image is one as well, and multiplicity."""

    value: complex
    mirrored: bool
    times: int

    @property
    def on_axis(self) -> bool:
        """Whether the value is on the imaginary axis."""
        return not self.mirrored and abs(self.value.real) <= _ON_AXIS * abs(self.value)

    @property
    def right(self) -> bool:
        """Whether the value or its mirror image is in the right half-plane."""
        return self.mirrored or self.value.real > _ON_AXIS * abs(self.value)

    @property
    def text(self) -> str:
        """Text: "51.35 Hz", "±1409 rad/s", "-3.20 ± 45.1i rad/s"; an asterisk marks the right half-plane."""
        size = abs(self.value)
        times = f" ×{self.times}" if self.times > 1 else ""
        if size == 0.0:
            return f"0{times}"
        if self.on_axis:
            return f"{number(size / (2.0 * np.pi))} Hz{times}"
        sign = "±" if self.mirrored else "-" if self.value.real < 0.0 else "+"
        real = f"{sign}{number(abs(self.value.real))}"
        imaginary = f" ± {number(self.value.imag)}i" if self.value.imag > _ON_AXIS * size else ""
        return f"{real}{imaginary} rad/s{times}{'*' if self.right else ''}"


def roots(values: Complex) -> list[Root]:
    """Group poles or zeros by magnitude; conjugates and mirror images (at the imaginary axis) form one root."""
    known, out = _without_rounding(values[np.isfinite(values.real)]), list[Root]()
    left = list(known[np.argsort(np.abs(known), kind="stable")])
    while left:
        value = left[0]
        near = [one for one in left if _alike(one, value)]
        mirrors = [one for one in left if _alike(-one, value)] if abs(value.real) > _ON_AXIS * abs(value) else []
        left = [one for one in left if not any(one is each for each in (*near, *mirrors))]
        complex_pair = abs(value.imag) > _ON_AXIS * abs(value)
        count = max(1, len(near) // 2) if complex_pair else len(near)
        shown = complex(value.real, abs(value.imag))
        out.append(Root(complex(abs(value.real), abs(value.imag)) if mirrors else shown, bool(mirrors), count))
    return out


def _without_rounding(values: Complex) -> Complex:
    """Return values, with those that are zero within rounding set to zero."""
    return np.where(np.abs(values) <= _ZERO * np.median(np.abs(values)), 0.0, values) if values.size else values


def _alike(one: complex, other: complex) -> bool:
    """Check whether two values are equal or conjugate within rounding."""
    return abs(complex(one.real, abs(one.imag)) - complex(other.real, abs(other.imag))) <= _SAME * abs(other)


def poles_of(data: xr.Dataset, mode: str, holding: str) -> Complex:
    """Return the poles of a mode [rad/s], with motors "free" or "held"."""
    return _known(data, "pole", mode=mode, holding=holding)


def zeros_of(data: xr.Dataset, mode: str, channels: str) -> Complex:
    """Return the zeros of a mode [rad/s], from its motors to "encoders" or to the "end_effector"."""
    return _known(data, "zero", mode=mode, map=channels)


def _known(data: xr.Dataset, name: str, **chosen: str) -> Complex:
    real, imag = (data[f"{name}_{part}"].sel(chosen).values for part in ("real", "imag"))
    return (real + 1j * imag)[np.isfinite(real)]


def common_poles(data: xr.Dataset) -> Complex | None:
    """Return the poles with motors free [rad/s] if all modes have the same; None if not, or if there is one mode."""
    first, *others = (poles_of(data, mode, "free") for mode in data["mode"].values.tolist())
    same = (one.size == first.size and np.allclose(abs(one), abs(first), rtol=_COMMON, atol=0.0) for one in others)
    return first if others and all(same) else None


def gains_of(data: xr.Dataset, mode: str, channels: str) -> Array:
    """Return the descending singular values (frequencies, k) of the frequency response of a mode's motors.

    The outputs are the "encoders" of these motors or the "end_effector". Without motors, the inputs are those of the
    mode. Values are NaN if there are no inputs or no outputs.
    """
    motors = motors_of_mode(data, mode)
    inputs, outputs = motors or inputs_of_mode(data, mode), _outputs(data, channels, motors)
    if not (inputs and outputs):
        return np.full((data.sizes["frequency"], 1), np.nan)
    chosen = data.sel(mode=mode, input=inputs, output=outputs).transpose("frequency", "output", "input", ...)
    response = chosen["response_real"].values + 1j * chosen["response_imag"].values
    return np.asarray(np.linalg.svd(response, compute_uv=False), dtype=float)


def _outputs(data: xr.Dataset, channels: str, motors: Sequence[str]) -> list[str]:
    joints = json.loads(data.attrs["motor_joints"])
    return json.loads(data.attrs["end_effector_outputs"]) if channels == END_EFFECTOR else [joints[k] for k in motors]


def gain_unit(data: xr.Dataset, channels: str) -> str:
    """Return the unit of the gains from motors to "encoders" or to the "end_effector"."""
    motors = [*json.loads(data.attrs["motor_joints"])]
    return channel_unit(data, motors or data["input"].values.tolist(), _outputs(data, channels, motors))


def channel_unit(data: xr.Dataset, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return the unit of the responses of outputs to inputs, "SI units" if the units differ."""
    unit = {
        what: dict(zip(data[what].values.tolist(), data[f"{what}_unit"].values.tolist(), strict=True))
        for what in ("input", "output")
    }
    into = [unit["input"][name] for name in inputs if name in unit["input"]]
    below = [f"({one})" if " " in one or "/" in one else one for one in into]
    units = {f"{unit['output'][name]}/{one}" for name in outputs for one in below}
    return units.pop() if len(units) == 1 else "SI units"


class Oscillation(NamedTuple):
    """Frequency |s| / (2 pi) [Hz] and damping ratio of a pair of complex poles s."""

    frequency: float
    damping_ratio: float


def oscillations(poles: Complex) -> list[Oscillation]:
    """Return frequency and damping ratio of each pair of complex poles, in the order of the poles."""
    upper = poles[poles.imag > _ON_AXIS * np.abs(poles)]
    return [Oscillation(float(abs(s) / (2.0 * np.pi)), float(-s.real / abs(s)) + 0.0) for s in upper]


def inputs_of_mode(data: xr.Dataset, mode: str) -> list[str]:
    """Return the names of the inputs of a mode."""
    own = np.isfinite(data["B"].sel(mode=mode).values).any(axis=0)
    return [str(name) for name in data["input"].values[own]]


def motors_of_mode(data: xr.Dataset, mode: str) -> list[str]:
    """Return the names of the motors among the inputs of a mode."""
    motors = json.loads(data.attrs["motor_joints"])
    return [name for name in inputs_of_mode(data, mode) if name in motors]


def about(data: xr.Dataset) -> str:
    """Return the operating point of the linear models in words."""
    return SOURCES[data.attrs["about"]].format(time=number(float(data.attrs["time"]), 6))


@checked_arguments()
def linear_summary(data: xr.Dataset) -> dict[str, Any]:
    """Return the summary of linear models as plain values for JSON.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset made by `linear_dataset`.

    Raises
    ------
    InputError
        The dataset is of another kind.
    """
    check_kind(data, "linear")
    attrs = data.attrs
    return {
        "kind": "linear model",
        "mechanism": attrs["mechanism"],
        "about": attrs["about"],
        "time": float(attrs["time"]),
        **{
            f"{key}s": dict(zip(data[key].values.tolist(), data[f"{key}_unit"].values.tolist(), strict=True))
            for key in ("state", "input", "output")
        },
        "modes": {mode: _mode_summary(data, mode) for mode in data["mode"].values.tolist()},
        "parameters": json.loads(attrs["parameters"]),
        "version": attrs["paraflex_version"],
    }


def _mode_summary(data: xr.Dataset, mode: str) -> dict[str, Any]:
    out: dict[str, Any] = {
        "inputs": inputs_of_mode(data, mode),
        "unbalanced": float(data["unbalanced"].sel(mode=mode)),
    }
    for holding in HOLDINGS:
        natural = data["natural_frequency"].sel(mode=mode, holding=holding).values
        poles = poles_of(data, mode, holding)
        out[f"motors_{holding}"] = {
            "natural_frequencies": natural[np.isfinite(natural)].tolist(),
            "oscillations": [one._asdict() for one in oscillations(poles)],
            "poles": _pairs(poles),
        }
    out["zeros"] = {str(name): _zero_summary(zeros_of(data, mode, str(name))) for name in data["map"].values}
    return out


def _zero_summary(zeros: Complex) -> dict[str, Any]:
    right = right_half_plane(zeros)
    return {
        "zeros": _pairs(zeros), "right_half_plane": _pairs(right), "minimum_phase": not right.size,
        "limiting_zero": limiting_zero(zeros) or None,
    }  # fmt: skip


def right_half_plane(values: Complex) -> Complex:
    """Return the poles or zeros that are in the right half-plane."""
    values = _without_rounding(values)
    return values[values.real > _ON_AXIS * np.abs(values)]


def phase_sentences(data: xr.Dataset) -> Iterator[str]:
    """Yield a sentence for each input-output map that is not minimum phase, on the bandwidth that its zeros allow."""
    for name in (str(each) for each in data["map"].values):
        by_limit: dict[str, list[str]] = {}
        for mode in data["mode"].values.tolist():
            if limit := limiting_zero(zeros_of(data, mode, name)):
                by_limit.setdefault(number(limit), []).append(mode)
        if by_limit:
            listed = "; ".join(f"{', '.join(modes)} from {limit} rad/s on" for limit, modes in by_limit.items())
            yield (
                f"{MAP_WORDS[name]}: not of minimum phase in {listed}. No controller that follows these outputs is "
                "faster than about the lowest of these zeros"
            )


def remarks(data: xr.Dataset) -> list[str]:
    """Return remarks on the models: a pose that is not in equilibrium, non-minimum phase, or motion frozen in time."""
    from paraflex.dynamics.linearise import BALANCED  # imported late: it loads the kernels

    values = {str(mode): float(data["unbalanced"].sel(mode=mode)) for mode in data["mode"].values}
    largest = max(values, key=lambda mode: values[mode])
    out = []
    if values[largest] > BALANCED:
        of = f" (mode {largest})" if len(values) > 1 else ""
        out.append(
            f"not in equilibrium: if released, the mechanism would start with "
            f"{quantity(values[largest], 'm/s^2', padded=False)}{of}; "
            "here constant forces hold it (--balanced linearises about equilibrium)"
        )
    out += phase_sentences(data)
    if data.attrs["about"] in ("a planned motion", "a run"):
        out.append("in motion, models are frozen at an instant: their poles say nothing about stability")
    return out


def limiting_zero(zeros: Complex) -> float:
    """Return the magnitude of the lowest zero in the right half-plane away from the imaginary axis, 0 without one."""
    zeros = _without_rounding(zeros)
    sizes = np.abs(zeros[zeros.real > _BESIDE_AXIS * np.abs(zeros)])
    return float(sizes.min()) if sizes.size else 0.0


def _pairs(values: Complex) -> list[list[float]]:
    return [[float(one.real), float(one.imag)] for one in values]
