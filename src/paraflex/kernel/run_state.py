"""Data of a run for the time loop: scheme, settings, state between calls, samples."""

from typing import Annotated, NamedTuple

from paraflex.arrays import Array, Indices, Mask
from .arrays import Floats, Ints, allocated
from .compiling import by_reference
from .vectors import LANES

# Largest number of singular positions recorded in a run.
MOST_PASSAGES = 1000
# Largest number of stages that the guess of the next stage is made of; `guesses.learn` has a sum for each.
GUESS_FROM = 6
# Return codes of `march`.
PAUSED, FINISHED, NO_CONVERGENCE, NOT_FINITE, ERROR_TEST = range(5)
# Further return code of `attempt`: the step comes near a singular position, and its start is to be prepared.
ENTERS = 5
# Return code if the torques of a sampled controller are not finite.
LAW_FAILED = 6
# Treatments of the constraints, as integers for kernels; index 3 is POSITION.
BAUMGARTE, PROJECTION, GGL, POSITION = range(4)


@by_reference
class Tableau(NamedTuple):
    """Coefficients of a scheme: a Runge-Kutta method for the ESDIRK family, or parameters of the Newmark family.

    A scheme of the Newmark family has A and c of the trapezoidal rule, by which energy is integrated.
    """

    A: Array
    c: Array
    error: Array  # b - b^ of the embedded formula; empty if the error is estimated from the last step
    dense: Indices  # stages accurate enough to interpolate between, first and last among them
    nodes: Indices  # stages through which multipliers are interpolated, ascending in time
    order: int  # order of the error estimate
    newmark: Array  # alpha_m, alpha_f, beta, gamma, theta; empty for ESDIRK


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
    turning: Indices  # coordinates that are angles of bodies whose orientation matters
    limit_t: Array  # times from which on the inputs limit the step size, ascending
    limit_h: Array  # largest step size from each of these times to the next
    turn_in_step: float  # largest rotation of these bodies within a step [rad]
    dependent_part: float  # relative pivot below which a row is dependent


@by_reference
class March(NamedTuple):
    """State of a run between calls, and its work arrays."""

    clock: Annotated[Floats, 25]  # see `kernel.indices`
    counts: Annotated[Ints, 18]
    q: Annotated[Floats, "n"]
    v: Annotated[Floats, "n"]
    stage_t: Annotated[Floats, 2, "stages"]  # times in the last accepted step and in this one
    stage_q: Annotated[Floats, "stages", "n"]
    stage_v: Annotated[Floats, "stages", "n"]
    stage_d: Annotated[Floats, "stages", "n"]  # q' at the stages: stage_v itself, except in stabilised index 2
    shift: Annotated[Floats, "shifted"]  # in stabilised index 2, else empty
    stage_a: Annotated[Floats, 2, "stages", "n"]  # in the last accepted step and in this one
    stage_lam: Annotated[Floats, 2, "stages", "m"]
    power: Annotated[Floats, "stages"]
    qs: Annotated[Floats, "n"]  # explicit parts of a stage
    vs: Annotated[Floats, "n"]
    eq: Annotated[Floats, "n"]  # estimated error of q in a step
    ev: Annotated[Floats, "n"]  # estimated error of v in a step
    forces: Annotated[Floats, 5, "m"]  # sizes and errors of multipliers, see `kernel.indices`
    errors: Annotated[Floats, 5, "n"]  # errors of coordinates, rows as in `forces`
    guess_lam: Annotated[Floats, "m"]  # multipliers of a sample before the equations of motion are solved there
    torques: Annotated[Floats, "acting"]  # motor torques or forces at a stage, then those of time-dependent loads
    algorithmic: Annotated[Floats, 2, "n"]  # algorithmic accelerations of the Newmark family, last and this step
    passages: Annotated[Floats, 2, MOST_PASSAGES]  # start and end of intervals around singular positions
    opening: Annotated[Floats, "n"]  # direction that opens the row nearest to dependence, near a singular position
    guess_t: Annotated[Floats, GUESS_FROM]  # times of the stages that a guess is made of, see `kernel.guesses`
    guess_s: Annotated[Ints, GUESS_FROM, 2]  # their indices in stage_a
    guess_w: Annotated[Floats, GUESS_FROM]  # their weights
    guess_d: Annotated[Floats, "differences"]  # accelerations at these stages, then the solution's, less the nearest
    guess_sums: Annotated[Floats, "sums"]  # products of these for each stage, of which weights are learned
    guess_factor: Annotated[Floats, GUESS_FROM, GUESS_FROM]
    inertias: Annotated[Floats, "n"]


@by_reference
class Samples(NamedTuple):
    """Dense output: requested times and the solution there."""

    times: Array
    stored: Mask  # (times,) whether a sample is kept; others serve to find the largest loads
    solved: Mask  # (times,) whether the equations of motion were solved, instead of interpolation
    q: Annotated[Floats, "times", "n"]
    v: Annotated[Floats, "times", "n"]
    a: Annotated[Floats, "times", "n"]
    lam: Annotated[Floats, "times", "m"]
    energy: Annotated[Floats, "times", 3]  # kinetic, strain, work done by motors and prescribed motion


def make_march(n: int, m: int, stages: int, acting: int, treatment: int = BAUMGARTE) -> March:
    """Allocate the state of a run with n coordinates and m constraint rows."""
    sizes = {"n": n, "m": m, "stages": stages, "acting": acting, "shifted": n if treatment == GGL else 0}
    sizes |= {"differences": LANES * n, "sums": stages * GUESS_FROM * LANES}
    march = allocated(March, sizes)
    return march if treatment == GGL else march._replace(stage_d=march.stage_v)
