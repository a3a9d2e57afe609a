"""Compiled code: packed system, body terms, joint terms, linear algebra, stage solver, time loop.

Functions are small, one equation each, and allocate nothing in the hot path. Every array that a kernel writes belongs
to a `Workspace`, which is made once; every constant that it reads belongs to a `PackedSystem`. NumPy versions of these
formulas are in the tests.

Arguments with the same name have the same meaning everywhere (n coordinates, m constraint rows):

    system, work            PackedSystem; its Workspace, of which `scratch` is a part
    q, v, a, f, x           (n,) coordinates, velocities, accelerations, generalised forces, a vector of that size
    lam, mu, rows           (m,) multipliers, increments of the multipliers, residuals of the constraint rows
    phi, dphi               (m,) values of the constraints, their time derivatives
    torques                 (acting,) motor torques or forces at the current time, then those of time-dependent loads
    weights                 three floats, the weights of Phi'', Phi' and Phi in the rows
    points                  sums over mass points, None for linear geometry
    signals, tableau, controls, march   time profiles, coefficients of the scheme, settings of the run, state of the run
    i, k, r                 indices of a body, of a member or signal, of a row
"""
