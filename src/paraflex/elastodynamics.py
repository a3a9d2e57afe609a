"""Kineto-elastodynamics (KED): elastic response to a prescribed rigid motion, without feedback on that motion.

All coordinates xi = (dr, dphi, u) of all bodies are small displacements about the motion q_r(t) of the rigid mechanism.
At every instant the mechanism is a structure, undeformed in its nominal pose, with the joints of the active motors
held:

    M xi'' + K xi + C(t)^T mu = -(M q_r'' + h),    C(t) xi = 0,    C = [Phi_q(q_r); angle rows of the active motors]

dr is expressed in the body frame, so that M and K of a body are constant. The instantaneous-structure assumption
neglects the terms from the rotation of the body frames while xi changes (Coriolis, gyroscopic, softening by rotation).
Motor torques are replaced by the forces that hold the motors at their nominal angles.

Winfrey (1971), J. Eng. Ind. 93, 268-272; Erdman, Sandor and Oakberg (1972), J. Eng. Ind. 94, 1193-1205; Midha, Erdman
and Frohrib (1978), Mech. Mach. Theory 13, 603-618; Turcic and Midha (1984), J. Dyn. Syst. Meas. Control 106, 243-248.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .actuation import FeedForward, actuation_condition
from .arguments import checked_arguments
from .arrays import Array
from .dynamics import System, acting_loads, joint_coordinate, pack_signals, undeformed_motion
from .dynamics.points import quarter_turn
from .errors import InputError, IntegrationError
from .integrators import Solution
from .integrators.beam_ends import beyond_ends, end_of_motion
from .integrators.linear_structure import Block, Response, march
from .integrators.methods import GeneralisedAlpha
from .kernel.bodies import motion_forces, system_energy
from .kernel.packed import make_scratch
from .mechanism import ActuationMode, Geometry, grouped, with_actuators
from .tracking import TrackingRun, TrackingTask

# Relative rounding error by which a sample spacing may exceed a whole number of steps.
_ROUNDED_SPACING = 1e-9


@checked_arguments()
def simulate_ked(
    task: TrackingTask,
    mode: str | ActuationMode,
    *,
    step: float = 1e-4,
    spectral_radius: float = 0.8,
    on_progress: Callable[[float], None] | None = None,
) -> TrackingRun:
    """Compute the elastic response of a mechanism whose active motors follow the planned motion exactly.

    Parameters
    ----------
    task : TrackingTask
        Task with the planned motion. Second-order geometry is replaced by linear geometry, as the model is linear in
        the displacements.
    mode : str or ActuationMode
        Mode whose motors are held, by its name, signs ("+-+-") or motor names ("tau1,tau5"); the other motors turn
        freely.
    step : float
        Largest step size [s]; the time between two samples is divided evenly.
    spectral_radius : float
        Spectral radius of the generalised-alpha method at infinite frequency, from 0 (asymptotic annihilation) to 1 (no
        numerical damping; constraint forces then keep every disturbance).
    on_progress : callable, optional
        Function called with the time reached [s]. A KeyboardInterrupt, in it or elsewhere, ends the run, which is
        returned as far as computed and marked "interrupted".

    Returns
    -------
    TrackingRun
        Run, which ends where a point reaches the end of the beam along which it slides, if `SlidingJoint.at_end` is
        "stop". Its `torques` are the feed-forward torques of the mode, which do not drive this model; its `holding`
        torques are those that hold the motors. Its task has linear geometry. In its solution q = q_r + xi with
        derivatives v and a; the multipliers are those of the system's rows, of least norm (rows scaled to one size)
        where rows are dependent; work and energy balance are NaN; the largest violations are those of the nonlinear
        constraints at the samples, which indicate how small the displacements are. The wall time is that of the whole
        call.

    Raises
    ------
    InputError
        Springs or dampers, a step that is not positive, a spectral radius outside [0, 1], or a point that starts off
        the beam along which it slides.
    ActuationError, SingularActuationError
        The mode cannot drive the mechanism along the path.
    IntegrationError
        The rank of the constraints changes along the motion; the error carries a TrackingRun with the results so far.
    """
    began = time.perf_counter()
    _check(task, step)
    numbers = GeneralisedAlpha(spectral_radius=spectral_radius).numbers
    # Finite segments without springs between them are rigid links: they have no geometry option, and their own names.
    if task.mechanism.geometry is not Geometry.LINEAR and task.whole is None:
        task = task.remodelled(task.mechanism.with_geometry(Geometry.LINEAR))
    torques, samples = task.torques(mode), task.motion.t
    condition = actuation_condition(task.effort, torques.mode)
    substeps = max(1, math.ceil((samples[1] - samples[0]) / step * (1.0 - _ROUNDED_SPACING)))
    times = np.linspace(samples[0], samples[-1], substeps * (samples.size - 1) + 1)
    nominal, rigid = _nominal(task, times), task.motion
    end = end_of_motion(rigid.system, rigid.t, rigid.q, rigid.v)
    stop = math.inf if end is None else end.time
    blocks = [Block(body.all, body.mass_matrix, np.diag(body.stiffness)) for body in task.system.bodies]
    held = [motor.joint for motor in task.mechanism.motors if motor.name in torques.mode.motors]
    kept: list[Response] = []
    reached: list[float] = []
    steps = 0
    status, message, event, failure = "complete", "", "", None
    try:
        responses = march(numbers, blocks, lambda instants: nominal[instants].structure(held), times)
        for steps, (t, response) in enumerate(_until(stop, times, responses)):
            if steps % substeps == 0 or t == stop:
                kept.append(response)
                reached.append(stop if t == stop else samples[steps // substeps])
                if on_progress is not None:
                    on_progress(t)
    except KeyboardInterrupt:
        status, message = "interrupted", f"interrupted at t = {times[steps]:.6g} s"
    except IntegrationError as error:
        status, message, failure = "failed", str(error), error
    fields = _fields(task, torques, np.array(reached), kept)
    if end is not None and reached[-1] == stop:
        status, event = "stopped", str(end.function.event)
        message = f"{end.function.reached(fields['q'][-1])} at t = {stop:.6g} s"
    wall_time = time.perf_counter() - began
    solution = Solution(
        **fields,
        status=status,
        message=message,
        steps=steps,
        factorisations=steps + 1,
        wall_time=wall_time,
        event=event,
        findings=beyond_ends(task.system, fields["t"], fields["q"], fields["v"]),
    )
    holding = _holding(task.system, torques.mode, kept[: len(kept) - bool(event)])
    run = TrackingRun(task, torques, condition, solution, method="KED, generalised-alpha", holding=holding)
    if failure is not None:
        failure.partial = run
        raise failure
    return run


def _check(task: TrackingTask, step: float) -> None:
    mechanism = task.mechanism
    beyond = {(group.table, group.plural_noun): members for group, members in grouped(with_actuators(mechanism))
              if group.resists}  # fmt: skip
    beyond["damped beam", "damped beams"] = tuple(
        body for body in mechanism.bodies if getattr(body, "damping", None) is not None
    )
    for (field, words), members in beyond.items():
        for member in members:
            raise InputError(
                f"kineto-elastodynamics does not account for {words}",
                field=field,
                value=member.name,
                remedy="leave it out; of finite segments use the task they were cut from",
            )
    for body in mechanism.bodies:
        if len(task.system.parts(body.name)) > 1 and task.whole is None:
            raise InputError(
                "kineto-elastodynamics takes one frame per beam", field=f"body.{body.name}.frames",
                remedy="leave frames out",
            )  # fmt: skip
    if not (math.isfinite(step) and step > 0.0):
        raise InputError("must be positive", field="step", value=step, remedy="give a time in seconds, such as 1e-4")


@dataclass(frozen=True)
class _NominalMotion:
    """Rigid motion q, v, a (k, n) at times t in the coordinates of a system, undeformed."""

    system: System
    t: Array
    q: Array
    v: Array
    a: Array

    def __getitem__(self, instants: slice) -> "_NominalMotion":
        return _NominalMotion(self.system, *(part[instants] for part in (self.t, self.q, self.v, self.a)))

    @property
    def angles(self) -> Array:
        """Angles of the body frames (k, bodies)."""
        return self.q[:, [body.angle for body in self.system.bodies]]

    def structure(self, held: Sequence[str]) -> tuple[Array, Array]:
        """Return constraints C (k, rows, n), held joints last, and forces -(M q_r'' + h) (k, n), in body frames."""
        forces, packed = np.zeros_like(self.q), self.system.packed
        acting = acting_loads(self.system.mechanism, self.t)
        motion_forces(packed, self.q, self.v, self.a, acting, forces, make_scratch(packed))
        joints = np.array([self.system.jacobian(q) for q in self.q])
        motors = [joint_coordinate(self.system, name, self.q).rows[:, None] for name in held]
        return self.to_bodies(np.concatenate([joints, *motors], axis=1)), -self.to_bodies(forces)

    def to_bodies(self, values: Array) -> Array:
        """Rotate translational parts of vectors (k, n) or rows (k, m, n) from the ground frame to the body frames."""
        angles = self.angles if values.ndim == 2 else self.angles[:, None, :]
        return _turned(self.system, values, -angles)

    def displaced(self, xi: Array, dxi: Array, ddxi: Array) -> tuple[Array, Array, Array]:
        """Return q_r + xi and its two derivatives; d = R dr rotates with its frame, d' = R (dr' + w E dr)."""
        rates, seconds = dxi.copy(), ddxi.copy()
        for body in self.system.bodies:
            r = body.position
            w, dw = self.v[:, body.angle, None], self.a[:, body.angle, None]
            rates[:, r] += w * quarter_turn(xi[:, r])
            seconds[:, r] += 2.0 * w * quarter_turn(dxi[:, r]) + dw * quarter_turn(xi[:, r]) - w**2 * xi[:, r]
        turned = (_turned(self.system, values, self.angles) for values in (xi, rates, seconds))
        q, v, a = (nominal + change for nominal, change in zip((self.q, self.v, self.a), turned, strict=True))
        return q, v, a


def _nominal(task: TrackingTask, times: Array) -> _NominalMotion:
    """Return the rigid motion in the coordinates of the task's system."""
    rigid = task.plan.follow(times)
    return _NominalMotion(task.system, times, *undeformed_motion(task.system, rigid.system, rigid.q, rigid.v, rigid.a))


def _holding(system: System, mode: ActuationMode, kept: list[Response]) -> Array:
    """Return the torques (k, motors) of the held motors, -mu, as C^T mu is on the left-hand side of the equations."""
    torques = np.zeros((len(kept), len(system.mechanism.motors)))
    active = [k for k, motor in enumerate(system.mechanism.motors) if motor.name in mode.motors]
    for row, response in zip(torques, kept, strict=True):
        row[active] = -response.mu[system.m :]
    return torques


def _turned(system: System, values: Array, angles: Array) -> Array:
    """Return values (..., n) with the translational part of every body rotated by its angle (..., bodies)."""
    x = np.array([body.offset for body in system.bodies])
    c, s = np.cos(angles), np.sin(angles)
    out = values.copy()
    out[..., x] = c * values[..., x] - s * values[..., x + 1]
    out[..., x + 1] = s * values[..., x] + c * values[..., x + 1]
    return out


def _until(stop: float, times: Array, responses: Iterable[Response]) -> Iterator[tuple[float, Response]]:
    """Yield instants and responses, the last one interpolated at `stop`."""
    earlier, before = math.nan, None
    for t, response in zip(times.tolist(), responses, strict=False):
        if before is not None and t >= stop:
            part = (stop - earlier) / (t - earlier)
            yield stop, Response(*(x + part * (y - x) for x, y in zip(before, response, strict=True)))
            return
        yield t, response
        earlier, before = t, response


def _fields(task: TrackingTask, torques: FeedForward, t: Array, kept: list[Response]) -> dict[str, Any]:
    """Return the fields of a Solution at the kept instants; violations are those of the nonlinear constraints."""
    system = task.system
    xi, dxi, ddxi, mu = (np.array(values) for values in zip(*kept, strict=True))
    q, v, a = _nominal(task, t).displaced(xi, dxi, ddxi)
    scratch = make_scratch(system.packed)
    energy = np.array([system_energy(system.packed, *state, scratch) for state in zip(q, v, strict=True)])
    signals, _ = pack_signals(task.mechanism, torques.signals, float(task.motion.t[-1]))
    violation = np.array([system.constraints(signals, *state) for state in zip(t, q, v, strict=True)])
    position, velocity = np.max(np.abs(violation), axis=(0, 2))
    return {
        "t": t,
        "q": q,
        "v": v,
        "a": a,
        "multipliers": mu[:, : system.m],
        "kinetic_energy": energy[:, 0],
        "strain_energy": energy[:, 1],
        "work": np.full(t.size, np.nan),
        "constraint_position_max": float(position),
        "constraint_velocity_max": float(velocity),
        "energy_balance_max": math.nan,
    }
