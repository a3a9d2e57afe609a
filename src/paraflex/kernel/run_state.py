"""Data of a run for the time loop: its scheme, the user's controls, its state between calls, its samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.kernel.arrays import apart
from paraflex.kernel.compiling import by_reference

# Singular positions kept of a run.
MOST_PASSAGES = 1000
# Why `march` returned.
PAUSED, FINISHED, NO_CONVERGENCE, NOT_FINITE, ERROR_TEST = range(5)
# Why `attempt` did so besides: the step comes near a singular position, and its start is to be prepared.
ENTERS = 5
# A sampled law gives torques that are not finite.
LAW_FAILED = 6
# March.clock
TIME, STEP, WORK, FACTOR_B, CONTRACTION, ENERGY_0 = range(6)
WEIGHT_0, BALANCE, PHI_MAX, DPHI_MAX, LAST_STEP, LAST_ERROR = range(6, 12)
# and of a fixed step in which Newton's iteration did not converge: when it ends, and how long its parts are.
PART_END, PART = range(15, 17)
# and of the row nearest to dependence: the root of the part of its square left, how fast that changes [1/s], and the
# largest part so far.
ROOT, ROOT_RATE, WIDEST = range(12, 15)
# and the b of the iteration matrix that root and the largest part are in.
ROOT_B = 17
# The length of the last step attempted.
TRIED = 18
# g and b of the last stage.
STAGE_G, STAGE_B = 19, 20
# The time in which local errors may add up to the tolerance, the largest rate of the motion until now [1/s], and how
# long a velocity error is taken to last in the factor that filters it.
CYCLE, FASTEST, MEMORY = 21, 22, 23
# What the last sample solved has changed forces by, as a part of the largest.
SAMPLE_CHANGE = 24
# Rows of March.forces: the largest multipliers, and what local errors have changed them by: in the last step, in the
# last cycles, and in those that had most; vibrations that the last step has lost.
PEAK, LOCAL, RECENT, UNRESOLVED, LOST = range(5)
# March.counts
STEPS, REJECTED, ITERATIONS, FACTORS, SAMPLE, STOP, FAILURES, PASSAGES = range(8)
# and of the factor: iterations of a step while it was new, those beyond them since, steps since, steps to come with a
# new one each.
FRESH, EXCESS, REUSED, IMPATIENT = range(8, 12)
# Near a singular position: one more than the row nearest to dependence at the start of the step.
NEAR = 12
# The step at whose start ROOT was taken.
ROOT_STEP = 13
# Whether the start of a step has been brought back to the constraints for that; -1 where it cannot be.
PREPARED = 14
# Whether rows were not trusted at the end of the last step attempted, and of the last one taken.
HELD_END, DRIFTED = 15, 16
# Whether something given jumps at the time reached: first stages are found once more before the next step.
JUMPED = 17


# What keeps the constraints, as integers for kernels; index 3 is POSITION.
BAUMGARTE, PROJECTION, GGL, POSITION = range(4)
# Entries of Tableau.newmark.
ALPHA_M, ALPHA_F, BETA, GAMMA, THETA = range(5)


@by_reference
class Tableau(NamedTuple):
    """A scheme: data of a Runge-Kutta method for the ESDIRK family, coefficients for the Newmark family.

    A scheme of the Newmark family has the A and c of the trapezoidal rule, by which energy is counted.
    """

    A: NDArray[np.float64]
    c: NDArray[np.float64]
    error: NDArray[np.float64]  # b - b^ of the embedded formula; empty where the error is estimated from the last step
    dense: NDArray[np.int64]  # stages accurate enough to interpolate between, first and last among them
    nodes: NDArray[np.int64]  # stages through which multipliers are interpolated, ascending in time
    order: int  # of the error estimate
    newmark: NDArray[np.float64]  # alpha_m, alpha_f, beta, gamma, theta; empty for ESDIRK


@by_reference
class Controls(NamedTuple):
    """Settings of a run by the user.

    Local errors add up to the tolerance within March.clock[CYCLE] when each step's stays below tolerance h / cycle.
    """

    tolerance: float  # [m]
    span: float  # duration of the run [s]
    by_cycle: int  # whether the cycle is that of the motion where that is shorter than the run
    force_part: float  # error allowed in forces within a cycle, as a part of the largest; zero where none are looked at
    force_control: int  # whether steps are chosen by that, too
    force_cycles: float  # cycles in which a motion forgets errors of forces; infinite where vibrations do not die out
    long_from: float  # length of steps from which on they are long beside vibrations [s]
    newton_fraction: float  # of the error allowed in a step, the part left to Newton
    alpha: float
    beta: float
    gain: float  # where positive alpha and beta are this over the step
    treatment: int
    least_step: float  # a run that needs shorter ones is given up [s]
    max_step: float
    fixed_step: float  # zero where steps are chosen by their errors
    near_error: float  # error allowed in a step near a singular position, where that is more [m]
    dependent_rows: int
    turning: NDArray[np.int64]  # coordinates that are angles of bodies of which it matters how they stand
    limit_t: NDArray[np.float64]  # times from which on steps are limited by what is given in time, ascending
    limit_h: NDArray[np.float64]  # and the longest step from each to the next
    turn_in_step: float  # by how much bodies turn within a step at most [rad]
    dependent_part: float  # a row with less than this of its diagonal left when others are eliminated depends on them


@by_reference
class March(NamedTuple):
    """The state of a run between calls, and its work arrays."""

    clock: NDArray[np.float64]
    counts: NDArray[np.int64]
    q: NDArray[np.float64]  # (n,)
    v: NDArray[np.float64]
    stage_t: NDArray[np.float64]  # (2, stages): of the last accepted step and of this one
    stage_q: NDArray[np.float64]  # (stages, n)
    stage_v: NDArray[np.float64]
    stage_d: NDArray[np.float64]  # q' at the stages: stage_v itself, but for stabilised index 2
    shift: NDArray[np.float64]  # (n,) of stabilised index 2, else empty
    stage_a: NDArray[np.float64]  # (2, stages, n)
    stage_lam: NDArray[np.float64]  # (stages, m)
    power: NDArray[np.float64]  # (stages,)
    qs: NDArray[np.float64]  # (n,) explicit parts of a stage
    vs: NDArray[np.float64]
    eq: NDArray[np.float64]  # (n,) estimated errors of a step
    ev: NDArray[np.float64]
    forces: NDArray[np.float64]  # (5, m) of multipliers: see PEAK
    guess_lam: NDArray[np.float64]  # (m,) multipliers of a sample before the equations of motion are solved there
    torques: NDArray[np.float64]  # (acting,) of the motors at a stage, or forces, then of loads given in time
    algorithmic: NDArray[np.float64]  # (2, n) accelerations that the Newmark family carries, of the last step and this
    passages: NDArray[np.float64]  # (2, MOST_PASSAGES) from when to when more rows were dependent than at the start
    opening: NDArray[np.float64]  # (n,) near a singular position: what opens the row nearest to dependence by one unit
    guess_t: NDArray[np.float64]  # (3,) times of the stages a guess is extrapolated from
    guess_s: NDArray[np.int64]  # (3, 2) and where they stand in stage_a


@by_reference
class Samples(NamedTuple):
    """Dense output: requested times and the solution there."""

    times: NDArray[np.float64]
    asked: NDArray[np.bool_]  # (times,) those that are kept; others serve to find the largest loads
    solved: NDArray[np.bool_]  # (times,) those where the equations of motion were solved, and no curve is
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
