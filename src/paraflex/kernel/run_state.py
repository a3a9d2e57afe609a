"""Data of a run for the time loop: scheme, settings, state between calls, samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.arrays import apart
from paraflex.kernel.compiling import by_reference

# Largest number of singular positions recorded in a run.
MOST_PASSAGES = 1000
# Return codes of `march`.
PAUSED, FINISHED, NO_CONVERGENCE, NOT_FINITE, ERROR_TEST = range(5)
# Further return code of `attempt`: the step comes near a singular position, and its start is to be prepared.
ENTERS = 5
# Return code if the torques of a sampled controller are not finite.
LAW_FAILED = 6
# Indices of March.clock.
TIME, STEP, WORK, FACTOR_B, CONTRACTION, ENERGY_0 = range(6)
WEIGHT_0, BALANCE, PHI_MAX, DPHI_MAX, LAST_STEP, LAST_ERROR = range(6, 12)
# Fixed step in which Newton's iteration did not converge: its end, and the length of its parts.
PART_END, PART = range(15, 17)
# Row nearest to dependence: square root of its relative pivot, the rate of change of that root [1/s], and the largest
# relative pivot so far.
ROOT, ROOT_RATE, WIDEST = range(12, 15)
# Coefficient b of the iteration matrix to which ROOT and WIDEST belong.
ROOT_B = 17
# Size of the last step attempted.
TRIED = 18
# Coefficients g and b of the last stage.
STAGE_G, STAGE_B = 19, 20
# Time in which local errors may add up to the tolerance, largest rate of the motion so far [1/s], and assumed duration
# of a velocity error in the factor that filters it.
CYCLE, FASTEST, MEMORY = 21, 22, 23
# Change of forces at the last sample solved, as a part of the largest force.
SAMPLE_CHANGE = 24
# Rows of March.forces: the largest multipliers; their changes by local errors in the last step, in the last cycles, and
# the largest such change so far; vibrations lost in the last step.
PEAK, LOCAL, RECENT, UNRESOLVED, LOST = range(5)
# Indices of March.counts.
STEPS, REJECTED, ITERATIONS, FACTORS, SAMPLE, STOP, FAILURES, PASSAGES = range(8)
# Factor: iterations of a step while it was new, additional iterations since, steps since, and number of coming steps
# that get a new factor each.
FRESH, EXCESS, REUSED, IMPATIENT = range(8, 12)
# One plus the index of the row nearest to dependence at the start of a step near a singular position, else zero.
NEAR = 12
# Step at whose start ROOT was computed.
ROOT_STEP = 13
# Whether the start of such a step has been projected onto the constraints; -1 if that is impossible.
PREPARED = 14
# Whether rows were held at the end of the last step attempted, and of the last step accepted.
HELD_END, DRIFTED = 15, 16
# Whether an input jumps at the current time: the first stage is solved again before the next step.
JUMPED = 17


# Treatments of the constraints, as integers for kernels; index 3 is POSITION.
BAUMGARTE, PROJECTION, GGL, POSITION = range(4)
# Indices of Tableau.newmark.
ALPHA_M, ALPHA_F, BETA, GAMMA, THETA = range(5)


@by_reference
class Tableau(NamedTuple):
    """Coefficients of a scheme: a Runge-Kutta method for the ESDIRK family, or parameters of the Newmark family.

    A scheme of the Newmark family has A and c of the trapezoidal rule, by which energy is integrated.
    """

    A: NDArray[np.float64]
    c: NDArray[np.float64]
    error: NDArray[np.float64]  # b - b^ of the embedded formula; empty if the error is estimated from the last step
    dense: NDArray[np.int64]  # stages accurate enough to interpolate between, first and last among them
    nodes: NDArray[np.int64]  # stages through which multipliers are interpolated, ascending in time
    order: int  # order of the error estimate
    newmark: NDArray[np.float64]  # alpha_m, alpha_f, beta, gamma, theta; empty for ESDIRK


@by_reference
class Controls(NamedTuple):
    """Settings of a run.

    Local errors add up to at most the tolerance within March.clock[CYCLE] if each step's stays below tolerance h /
    cycle.
    """

    tolerance: float  # [m]
    span: float  # duration of the run [s]
    by_cycle: int  # whether the cycle is that of the motion if that is shorter than the run
    force_part: float  # error allowed in forces within a cycle, as a part of the largest; zero if not checked
    force_control: int  # whether the step size is controlled by that error, too
    force_cycles: float  # cycles in which errors of forces decay; infinite if vibrations are undamped
    long_from: float  # step size from which on a step is long compared with vibrations [s]
    newton_fraction: float  # part of the error allowed in a step that Newton's iteration may leave
    alpha: float
    beta: float
    gain: float  # if positive, alpha and beta are this divided by the step size
    treatment: int
    least_step: float  # smallest step size [s]; a run that needs a smaller one fails
    max_step: float
    fixed_step: float  # zero if the step size is controlled by the error
    near_error: float  # error allowed in a step near a singular position [m], if that is larger
    dependent_rows: int
    turning: NDArray[np.int64]  # coordinates that are angles of bodies whose orientation matters
    limit_t: NDArray[np.float64]  # times from which on the inputs limit the step size, ascending
    limit_h: NDArray[np.float64]  # largest step size from each of these times to the next
    turn_in_step: float  # largest rotation of these bodies within a step [rad]
    dependent_part: float  # relative pivot below which a row is dependent


@by_reference
class March(NamedTuple):
    """State of a run between calls, and its work arrays."""

    clock: NDArray[np.float64]
    counts: NDArray[np.int64]
    q: NDArray[np.float64]  # (n,)
    v: NDArray[np.float64]
    stage_t: NDArray[np.float64]  # (2, stages): times in the last accepted step and in this one
    stage_q: NDArray[np.float64]  # (stages, n)
    stage_v: NDArray[np.float64]
    stage_d: NDArray[np.float64]  # q' at the stages: stage_v itself, except in stabilised index 2
    shift: NDArray[np.float64]  # (n,) in stabilised index 2, else empty
    stage_a: NDArray[np.float64]  # (2, stages, n)
    stage_lam: NDArray[np.float64]  # (stages, m)
    power: NDArray[np.float64]  # (stages,)
    qs: NDArray[np.float64]  # (n,) explicit parts of a stage
    vs: NDArray[np.float64]
    eq: NDArray[np.float64]  # (n,) estimated error of q in a step
    ev: NDArray[np.float64]  # (n,) estimated error of v in a step
    forces: NDArray[np.float64]  # (5, m) sizes and errors of multipliers: see PEAK
    guess_lam: NDArray[np.float64]  # (m,) multipliers of a sample before the equations of motion are solved there
    torques: NDArray[np.float64]  # (acting,) motor torques or forces at a stage, then those of time-dependent loads
    algorithmic: NDArray[np.float64]  # (2, n) algorithmic accelerations of the Newmark family, last and this step
    passages: NDArray[np.float64]  # (2, MOST_PASSAGES) start and end of intervals around singular positions
    opening: NDArray[np.float64]  # (n,) direction that opens the row nearest to dependence, near a singular position
    guess_t: NDArray[np.float64]  # (3,) times of the stages a guess is extrapolated from
    guess_s: NDArray[np.int64]  # (3, 2) their indices in stage_a


@by_reference
class Samples(NamedTuple):
    """Dense output: requested times and the solution there."""

    times: NDArray[np.float64]
    stored: NDArray[np.bool_]  # (times,) whether a sample is kept; others serve to find the largest loads
    solved: NDArray[np.bool_]  # (times,) whether the equations of motion were solved, instead of interpolation
    q: NDArray[np.float64]  # (times, n)
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    lam: NDArray[np.float64]  # (times, m)
    energy: NDArray[np.float64]  # (times, 3): kinetic, strain, work done by motors and prescribed motion


def make_march(n: int, m: int, stages: int, acting: int, treatment: int = BAUMGARTE) -> March:
    """Allocate the state of a run with n coordinates and m constraint rows."""
    stage_v = apart((stages, n))
    return March(
        clock=apart(25),
        counts=apart(18, np.int64),
        q=apart(n),
        v=apart(n),
        stage_t=apart((2, stages)),
        stage_q=apart((stages, n)),
        stage_v=stage_v,
        stage_d=apart((stages, n)) if treatment == GGL else stage_v,
        shift=apart(n if treatment == GGL else 0),
        stage_a=apart((2, stages, n)),
        stage_lam=apart((stages, m)),
        power=apart(stages),
        qs=apart(n),
        vs=apart(n),
        eq=apart(n),
        ev=apart(n),
        forces=apart((5, m)),
        guess_lam=apart(m),
        torques=apart(acting),
        algorithmic=apart((2, n)),
        passages=apart((2, MOST_PASSAGES)),
        opening=apart(n),
        guess_t=apart(3),
        guess_s=apart((3, 2), np.int64),
    )
