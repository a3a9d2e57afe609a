"""The compiled code: packed system, body terms, joint terms, linear algebra, stage solver, time loop.

Small functions with one equation each, no allocation in the hot path. Every array a kernel writes belongs to a
`Workspace` made once; every constant it reads to a `PackedSystem`. The NumPy twins of these formulas stand in the
tests.

Arguments of one name are the same everywhere, n coordinates and m constraint rows:

    system, work            PackedSystem; its Workspace, of which `scratch` is a part
    q, v, a, f, x           (n,) coordinates, their derivatives, generalised forces, a vector of that kind
    lam, mu, rows           (m,) multipliers, changes of them, residuals of the constraint rows
    phi, dphi               (m,) values of the constraints, their derivatives in time
    torques                 (acting,) torques or forces of the motors at the instant, then of loads given in time
    weights                 three floats, of Phi'', Phi' and Phi in the rows
    points                  sums over mass points, None for linear geometry
    signals, tableau, controls, march   functions of time, the scheme, what the user chooses, the state of a run
    i, k, r                 of a body, of a member or signal, of a row
"""
