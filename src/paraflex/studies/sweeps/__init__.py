"""Sweeps: thousands of runs of a mechanism with varied parameters, collected in one table."""

from paraflex.designs.derivatives.gradient import metric_gradients as metric_gradients
from paraflex.designs.sweep import (
    SweepResult as SweepResult,
    SweepStudy as SweepStudy,
    load_sweep as load_sweep,
    sweep as sweep,
)
