"""Indices of the state of a run: March.clock, March.counts, rows of March.forces, and Tableau.newmark."""

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
# the largest such change so far; vibrations lost in the last step. March.errors has those of coordinates.
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
# Indices of Tableau.newmark.
ALPHA_M, ALPHA_F, BETA, GAMMA, THETA = range(5)
