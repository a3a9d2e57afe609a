"""Statics and linear models at a pose for the page: a force that bends the links, poles and frequency responses."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import build_system, undeformed
from paraflex.dynamics.joint_coordinates import joint_value
from paraflex.dynamics.state import State
from paraflex.equilibria import Statics, statics
from paraflex.equilibria.conditions import coordinate_named
from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.linear import LinearModel, linearise
from paraflex.mechanism import ConstantSpeed, Mechanism, RigidBody
from paraflex.mechanism.masses import with_any_masses
from paraflex.plots.scene import is_plate, scene
from paraflex.results.findings import finding_lines
from paraflex.results.linear_data import end_effector_outputs, motors_of
from paraflex.results.posed import posed_at
from .seeing import Seeing

# Digits behind the point of a position [m], which is drawn magnified.
_DIGITS = 9
# Slowest poles that are listed, frequencies of a response, and distances from a pole at which it is also evaluated.
_POLES, _EVEN, _NEAR = 24, 160, (1e-3, 1e-2)
# Range of a response, below the lowest and above one of the first natural frequencies.
_BELOW, _ABOVE, _FIRST = 0.2, 3.0, 6
# Angles that are rounding [rad], and the part of the largest response below which an output does not respond.
_ROUNDING, _NOTHING = 1e-7, 1e-9


def drag_force(model: Model, q: Array, ref: str, force: Sequence[float], *, buckling: bool = True) -> dict[str, Any]:
    """Return the statics of a force along x and y [N] at a point, "body.point", as `paraflex.statics` finds it.

    Motors and prescribed motions are held at a rigid pose q (n,); an empty force leaves weight, loads and springs. The
    dict has `bodies` as in a picture, deflected, and `base`, the lines of the undeformed bodies, point by point;
    `place` of the deflected point [m], and its `deflection` by the force; `stiffness`, the force over the deflection
    along it [N/m], None without a force or if nothing yields; `buckling`, the factor of the force at which the
    mechanism buckles, None if it does not or is not asked for, as limit points beyond the force are searched;
    `buckling_note`, how far it is an estimate; and `findings`, a line each. InputError: the point is unknown, nothing
    bends, or the motors do not hold the mechanism.
    """
    names = [f"{ref}.{axis}" for axis in ("x", "y")]
    for name in names:
        coordinate_named(model.mechanism, name, "force")
    mechanism, held = _held(model, q)
    start = _undeformed(mechanism, q)
    loads = {name: float(part) for name, part in zip(names, force, strict=False)}
    found = statics(
        mechanism, loads=loads if any(loads.values()) else {}, torques={}, moved={}, held=held, steps=1,
        stiffness=names, buckling=int(buckling), start=start, warning=False,
    )  # fmt: skip
    factor = _factor(found) if buckling and any(loads.values()) else None
    places = np.column_stack([found.place(name) for name in names])
    deflection = places[-1] - places[0]
    return {
        **_lines(found, start.q),
        "place": places[-1].tolist(),
        "deflection": deflection.tolist(),
        "stiffness": _stiffness(np.array(list(loads.values())), deflection) if loads else None,
        "buckling": factor,
        "buckling_note": "" if factor is None else _accuracy(found),
        "findings": _findings(found),
    }


def _held(model: Model, q: Array) -> tuple[Mechanism, list[str]]:
    """Return the mechanism without prescribed motions, and the joints that are held, theirs included."""
    mechanism = replace(model.mechanism, prescribed=())
    if not any(mechanism.gravity):
        # Without weight masses have no effect at rest.
        mechanism = with_any_masses(mechanism)
    springs = bool(mechanism.springs or mechanism.linear_springs)
    if not (springs or any(not isinstance(body, RigidBody) and body.flexible for body in mechanism.bodies)):
        raise InputError("no link is flexible: a force bends nothing", field="body", remedy="make a link flexible")
    if not (springs or Seeing(model).holds(q)):
        remedy = "add a motor for each degree of freedom"
        raise InputError("the motors do not hold the mechanism in this pose", field="motor", remedy=remedy)
    driven = [one.joint for one in (*mechanism.motors, *model.mechanism.prescribed)]
    return mechanism, list(dict.fromkeys(driven))


def _undeformed(mechanism: Mechanism, q: Array) -> State:
    rigid = build_system(replace(mechanism.rigid(), prescribed=()))
    return undeformed(build_system(mechanism), rigid, State(0.0, q, np.zeros(rigid.n)))


def _lines(found: Statics, start: Array) -> dict[str, Any]:
    """Return the lines of the bodies, deflected and undeformed."""
    both = np.array([found.q[-1], start])
    drawn = scene(posed_at(found.system.described, found.system, "", both).data, np.arange(2.0)).bodies
    lines = {name: np.round(places, _DIGITS) for name, places in drawn.items()}
    return {
        "bodies": [[name, one[0].tolist(), is_plate(drawn[name][0])] for name, one in lines.items()],
        "base": [one[1].tolist() for one in lines.values()],
    }


def _stiffness(force: Array, deflection: Array) -> float | None:
    """Return a force (2,) over the deflection along it; None without a force or a deflection."""
    along = float(force @ deflection)
    return float(force @ force) / along if along else None


def _factor(found: Statics) -> float | None:
    """Return the least buckling factor: a limit point of the branch, else that about the last equilibrium."""
    factors = found.buckling[0 if np.any(found.limit) else -1]
    factor = float(np.min(factors, initial=np.inf))
    return factor if np.isfinite(factor) else None


def _accuracy(found: Statics) -> str:
    """Return how far the buckling factor is an estimate, from the change along the branch as `paraflex statics`."""
    if np.any(found.limit):
        return "limit point"
    first, last = (float(np.min(found.buckling[k], initial=np.inf)) for k in (0, -1))
    if not np.isfinite(first):
        return "linear estimate, of unknown error: none as seen without the force"
    if first == last:
        return "limit point beyond this force"
    return f"linear estimate, which changes along the branch: {first:.3g} times as seen without the force"


def _findings(found: Statics) -> list[str]:
    """Return a line for each finding, and for a force beyond a limit point."""
    beyond = found.fraction[found.limit]
    snaps = [f"it snaps through at {beyond[0]:.3g} of the force"] if beyond.size else []
    validity = found.validity
    doubts = [] if validity is None or validity.holds else [validity.verdict]
    return [*snaps, *doubts, *finding_lines(found.findings)]


def linear(model: Model, q: Array, mode: str) -> dict[str, Any]:
    """Return the linear model at rest in a rigid pose q (n,) with the motors of a mode; empty for all motors.

    The dict has `poles`, the slowest as [real part [1/s], imaginary part [rad/s], frequency [Hz], damping ratio],
    without the lower halves of pairs; `held`, the lowest natural frequencies with these motors held and prescribed
    motions at rest, as in `Seeing.full` [Hz], empty if nothing is driven; `unbalanced`, the acceleration with which the
    mechanism would start [m/s^2]; `input`, the name of the first motor or prescribed motion, else of a force at the
    end-effector; `frequency` [Hz]; and `responses` of the end-effector, else of the motor's joint or the sensors, as
    far as they respond: `output`, `unit`, `magnitude` [dB] and `phase` [degrees]. InputError: there are no inputs, or
    no degrees of freedom.
    """
    mechanism = _standing(model.mechanism, q)
    driven, effector = bool(mechanism.motors or mechanism.prescribed), mechanism.end_effector
    if not driven and effector is None:
        remedy = "add a motor, or choose the end-effector"
        raise InputError("nothing excites it: no motor, drive or end-effector", field="motor", remedy=remedy)
    forced = [] if driven or effector is None else [str(effector.point)]
    found = linearise(mechanism, mode=mode or None, start=_undeformed(mechanism, q), forces=forced)
    poles, held = found.poles(), found.held_frequencies(motors_of(found)) / (2.0 * np.pi)
    frequency = _frequencies(np.concatenate([np.abs(poles) / (2.0 * np.pi), held]))
    return {
        "poles": [_pole(pole) for pole in poles if pole.imag >= 0.0][:_POLES],
        "held": held[held > 0.0][:_FIRST].tolist() if driven else [],
        "unbalanced": float(found.unbalanced),
        "input": found.inputs[0].name,
        "frequency": frequency.tolist(),
        "responses": _responses(found, frequency),
    }


def _standing(mechanism: Mechanism, q: Array) -> Mechanism:
    """Return the mechanism with prescribed motions that rest at a rigid pose."""
    if not mechanism.prescribed:
        return mechanism
    rigid = build_system(replace(mechanism.rigid(), prescribed=()))
    still = [ConstantSpeed(joint_value(rigid, one.joint, q), 0.0) for one in mechanism.prescribed]
    pairs = zip(mechanism.prescribed, still, strict=True)
    return replace(mechanism, prescribed=tuple(replace(one, profile=profile) for one, profile in pairs))


def _pole(pole: complex) -> list[float | None]:
    size = float(abs(pole))
    return [float(pole.real), float(pole.imag), size / (2.0 * np.pi), -float(pole.real) / size if size else None]


def _frequencies(natural: Array) -> Array:
    """Return the frequencies of a response [Hz]: logarithmically spaced, and near natural ones."""
    peaks = np.unique(np.round(natural[natural > 0.0], 9)) if np.any(natural > 0.0) else np.ones(1)
    low, high = _BELOW * peaks[0], _ABOVE * peaks[:_FIRST][-1]
    peaks = peaks[peaks < high]
    near = [peaks * (1.0 + sign * part) for part in _NEAR for sign in (-1.0, 1.0)]
    return np.unique(np.concatenate([np.geomspace(low, high, _EVEN), *near]))


def _responses(found: LinearModel, frequency: Array) -> list[dict[str, Any]]:
    """Return magnitude and phase from the first input; the phase lies in (-360, 0] degrees."""
    given = found.inputs[0]
    outputs = end_effector_outputs(found) or found.motor_joints()[:1] or [one.name for one in found.outputs]
    values = found.select([given.name], outputs).frequency_response(2.0 * np.pi * frequency)[:, :, 0].T
    units, into = {one.name: one.unit for one in found.outputs}, given.unit
    into = f"({into})" if " " in into or "/" in into else into
    phases = np.degrees(np.angle(values))
    phases = np.where(phases > np.degrees(_ROUNDING), phases - 360.0, phases)
    sizes = 20.0 * np.log10(np.maximum(np.abs(values), np.finfo(float).tiny))
    return [
        {"output": name, "unit": f"{units[name]}/{into}", "magnitude": size.tolist(), "phase": phase.tolist()}
        for name, size, phase in zip(outputs, sizes, phases, strict=True)
        if np.max(size) > np.max(sizes) + 20.0 * np.log10(_NOTHING)
    ]
