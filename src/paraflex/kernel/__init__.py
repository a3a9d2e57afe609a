"""The compiled code: packed system, body terms, joint terms, linear algebra, stage solver, time loop.

Small functions with one equation each, no allocation in the hot path. Every array a kernel writes belongs to a
`Workspace` made once; every constant it reads to a `PackedSystem`. The NumPy twins of these formulas stand in the
tests.
"""
