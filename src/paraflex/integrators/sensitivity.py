"""Forward sensitivities of a run: its steps are solved to rounding and differentiated stage by stage."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import inputs_of, numbers_of, with_numbers
from paraflex.errors import InputError, IntegrationError, Moment, SliderOffBeamError
from paraflex.kernel import indices as at
from paraflex.kernel.arrays import allocated
from paraflex.kernel.krylov import make_krylov
from paraflex.kernel.packed import PackedSystem, Signals, make_scratch
from paraflex.kernel.rounding import History, sample_energies, solve_steps_to_rounding
from paraflex.kernel.run_state import FINISHED, PAUSED, make_march
from paraflex.kernel.sensitivity import make_piece, sensitivity_steps
from paraflex.kernel.sensitivity_samples import DIFFERENCE_STEP, PLACES, Sensitivity
from paraflex.kernel.tangent import make_tangent
from .beam_ends import STAY_ON_BEAM, BeamEnds
from .integration import CAUSES
from .methods import METHODS, Family, Treatment
from .native import NativeRun, prepare
from .options import IntegrationOptions
from .run import Problem, empty_samples

# Number of steps in memory at a time.
_STEPS_AT_ONCE = 256
# Largest relative correction of a stage at the end of the iteration; beyond it no derivative is returned.
_LARGEST_RESIDUAL = 1e-6


class Direction(NamedTuple):
    """Derivatives of the inputs of a run by a parameter, relative to the parameter's size.

    Attributes
    ----------
    packed, signals : arrays
        Derivatives of the numbers of the packed system and of the signals, in the order of `dynamics.numbers_of`.
    q, v : (n,) arrays
        Derivatives of the initial state.
    stops, times : arrays
        Derivatives of the stops and of the sample times [s].
    gains : (2,) array
        Derivatives of Baumgarte's alpha and beta [1/s].
    """

    packed: Array
    signals: Array
    q: Array
    v: Array
    stops: Array
    times: Array
    gains: Array


class Motion(NamedTuple):
    """Samples of a run, (k, ...), or their derivatives by parameters, (parameters, k, ...).

    Attributes
    ----------
    q, v, a, multipliers : arrays
        Coordinates, velocities, accelerations and multipliers.
    work : array
        Work of motors and all other forces except weight, less the energy dissipated in dampers [J].
    """

    q: Array
    v: Array
    a: Array
    multipliers: Array
    work: Array


@dataclass(frozen=True)
class RunDerivatives:
    """Run solved to rounding with its own steps, and its derivatives by parameters.

    Attributes
    ----------
    t : (k,) array
        Sample times [s].
    motion : Motion
        Samples of the run.
    derivatives : Motion
        Derivatives of the samples by the parameters.
    residual : float
        Largest last correction of the equations of any stage, relative to the corrected values.
    """

    t: Array
    motion: Motion
    derivatives: Motion
    residual: float


def check_differentiable(options: IntegrationOptions) -> None:
    """Check that runs with these options can be differentiated.

    Raises
    ------
    InputError
        The method is not of the ESDIRK family, the treatment of constraints is not Baumgarte's, or there are events.
    """
    if options.method.family != Family.ESDIRK:
        able = [name for name, method in METHODS.items() if method.family == Family.ESDIRK]
        raise InputError(
            "derivatives need another method",
            field="method",
            value=options.method.name,
            remedy=f"choose from {', '.join(able)}",
        )
    if options.treatment != Treatment.BAUMGARTE:
        raise InputError(
            "derivatives need Baumgarte's treatment of the constraints",
            field="constraints",
            value=options.treatment.value,
            remedy='choose "baumgarte"',
        )
    if options.events:
        raise InputError("a run that an event ends has no derivatives", field="events", remedy="leave them out")


def run_derivatives(problem: Problem, options: IntegrationOptions, directions: Sequence[Direction]) -> RunDerivatives:
    """Compute derivatives of a run by parameters, with its steps kept.

    Steps keep their share of the interval between two stops: if a stop moves, the steps move with it.

    Parameters
    ----------
    problem : Problem
        Problem as returned by `make_problem`.
    options : IntegrationOptions
        Options of the run.
    directions : sequence of Direction
        Derivatives of the inputs, one direction per parameter.

    Raises
    ------
    InputError
        The options do not allow derivatives, see `check_differentiable`.
    SliderOffBeamError
        A point that slides along a beam is off it at a sample: a run that ends early has no derivatives.
    IntegrationError
        The run could not be finished, or the equations of a stage could not be solved to rounding; the error has the
        time.
    """
    check_differentiable(options)
    run = prepare(problem, options)
    varied = _Varied(problem, run, directions)
    for chunk in _chunks(run):
        varied.go_through(chunk)
    motion, names = varied.motion, ("sample_q", "sample_v", "sample_a", "sample_lam", "sample_work")
    _check_on_beams(problem, motion)
    derivatives = (
        np.reshape([getattr(y, name) for y in varied.variations], (len(directions), *part.shape))
        for name, part in zip(names, motion, strict=True)
    )
    return RunDerivatives(
        t=problem.times,
        motion=motion,
        derivatives=Motion(*derivatives),
        residual=varied.residual,
    )


def _check_on_beams(problem: Problem, motion: Motion) -> None:
    """Raise an error if a sliding point is off its beam at a sample of a run that would have ended there."""
    for function in BeamEnds(problem.system, problem.initial).functions:
        outside = np.nonzero(function.inside(motion.q) <= 0.0)[0]
        if outside.size and function.ends_run:
            first = int(outside[0])
            moment = Moment(float(problem.times[first]), first)
            raise SliderOffBeamError(function.reached(motion.q[first]), moment, remedy=STAY_ON_BEAM)


def energies(packed: PackedSystem, q: Array, v: Array, multipliers: Array) -> Array:
    """Return kinetic energy, strain energy including springs, and work of gravity at samples (k, 3) [J].

    The work of gravity is relative to all mass at the origin of the ground frame.
    """
    out = np.zeros((q.shape[0], 3))
    arrays = (np.ascontiguousarray(part) for part in (q, v, multipliers))
    sample_energies(packed, *arrays, make_scratch(packed), out)
    return out


@dataclass(frozen=True)
class _Chunk:
    """Successive accepted steps, under signals that do not jump."""

    history: History
    count: int
    signals: Signals


def _sizes(run: NativeRun) -> dict[str, int]:
    """Return the sizes of arrays for the steps in memory."""
    system = run.problem.system
    return {"steps": _STEPS_AT_ONCE, "stages": run.scheme.c.size, "n": system.n, "m": system.m}


def _chunks(run: NativeRun) -> Iterator[_Chunk]:
    """Yield the accepted steps of a run as it advances, in one history that is refilled."""
    problem, state, jumps = run.problem, run.state, run.problem.jumps
    history = allocated(History, _sizes(run))
    run.start()
    count, restart, code = 0, True, PAUSED
    signals = problem.signals_from(state.clock[at.TIME])
    while True:
        before, accepted = float(state.clock[at.TIME]), state.counts[at.STEPS]
        code = run.march(1)
        if code == FINISHED:
            break
        if code != PAUSED:
            cause, remedy = CAUSES[code]
            raise IntegrationError(cause, Moment(before, int(accepted)), remedy=remedy)
        if state.counts[at.STEPS] == accepted:
            # The first stage is solved again for the second shorter step.
            restart |= bool(state.counts[at.FAILURES] == 2)
            continue
        history.t[count], history.h[count], history.restart[count] = before, state.clock[at.LAST_STEP], restart
        history.a[count], history.lam[count] = state.stage_a[0], state.stage_lam[0]
        count, restart = count + 1, bool(np.any(jumps == state.clock[at.TIME]))
        if count == _STEPS_AT_ONCE or restart:
            yield _Chunk(history, count, signals)
            count, signals = 0, problem.signals_from(state.clock[at.TIME])
    if count:
        yield _Chunk(history, count, signals)


class _Varied:
    """Run solved to rounding and its derivatives, up to the current step."""

    def __init__(self, problem: Problem, run: NativeRun, directions: Sequence[Direction]) -> None:
        self.problem, self.run, self.directions, self.residual = problem, run, directions, 0.0
        system, initial, stages = problem.system, problem.initial, run.scheme.c.size
        self.march = make_march(system.n, system.m, stages, inputs_of(system.mechanism).acting)
        self.march.q[:], self.march.v[:] = initial.q, initial.v
        self.workspace = system.workspace()
        # The equations of motion are solved at the same samples as in the run.
        self.samples = empty_samples(problem.times, system)._replace(solved=run.samples.solved)
        self.workspace.redundant[:] = run.workspace.redundant
        self.tangent, self.space = make_tangent(system.packed), make_krylov(system.n, system.m)
        self.moved = [
            (_moved(system.packed, direction.packed), _moved(problem.signals, direction.signals))
            for direction in directions
        ]
        self.pieces = tuple(make_piece(problem.signals) for _ in PLACES)
        sizes = {**_sizes(run), "states": stages + 1, "times": problem.times.size}
        self.variations = [
            allocated(Sensitivity, sizes, times=problem.times, sample_times=np.ascontiguousarray(direction.times))
            for direction in directions
        ]
        gains = np.array([run.controls.alpha, run.controls.beta])
        for y, direction in zip(self.variations, directions, strict=True):
            y.q[0], y.v[0] = direction.q, direction.v
            y.gains[:] = gains + DIFFERENCE_STEP * np.outer(PLACES, direction.gains)

    @property
    def motion(self) -> Motion:
        """Samples of the run."""
        samples = self.samples
        # The work in the samples includes that of weight, relative to the origin of the ground frame.
        weight = energies(self.problem.system.packed, samples.q, samples.v, samples.lam)[:, 2]
        return Motion(samples.q, samples.v, samples.a, samples.lam, samples.energy[:, 2] - weight)

    def go_through(self, chunk: _Chunk) -> None:
        """Solve and differentiate the steps of a chunk."""
        run, system = self.run, self.problem.system
        arguments = (run.scheme, run.controls, chunk.count, chunk.history)
        room = (self.tangent, self.space)
        solve_steps_to_rounding(
            system.packed, chunk.signals, *arguments, self.march, *room, self.workspace, self.samples
        )
        self._check(chunk, chunk.history.left)
        torques = self.march.torques
        for y, direction, moved in zip(self.variations, self.directions, self.moved, strict=True):
            self._vary_times(chunk, y, direction)
            rest = (*arguments, y, *room, torques, self.workspace, self.samples)
            sensitivity_steps(system.packed, chunk.signals, *moved, self.pieces, *rest)
            self._check(chunk, y.left)

    def _vary_times(self, chunk: _Chunk, y: Sensitivity, direction: Direction) -> None:
        """Compute derivatives of the starts and sizes of steps, interpolated between those of the stops around them."""
        stops = np.concatenate([[self.problem.initial.time], self.problem.stops])
        change = np.concatenate([[0.0], direction.stops])
        t, h = chunk.history.t[: chunk.count], chunk.history.h[: chunk.count]
        interval = np.clip(np.searchsorted(stops, t, side="right") - 1, 0, stops.size - 2)
        slope = np.diff(change) / np.diff(stops)
        y.t[: chunk.count] = change[interval] + (t - stops[interval]) * slope[interval]
        y.h[: chunk.count] = h * slope[interval]

    def _check(self, chunk: _Chunk, left: Array) -> None:
        left = left[: chunk.count]
        self.residual = max(self.residual, float(left.max()))
        if not self.residual <= _LARGEST_RESIDUAL:
            worst = int(np.argmax(~(left <= _LARGEST_RESIDUAL)))
            raise IntegrationError(
                "the equations of a step cannot be solved to rounding, as derivatives need,",
                Moment(float(chunk.history.t[worst]), worst),
                remedy="choose a finer tolerance, or take derivatives by differences",
            )


def _moved(record, change: Array) -> tuple:
    """Return a packed system or signals at the points of the kernel's differences."""
    numbers = numbers_of(record)
    return tuple(with_numbers(record, numbers + place * DIFFERENCE_STEP * change) for place in PLACES)
