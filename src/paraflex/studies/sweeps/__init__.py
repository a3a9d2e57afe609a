"""Sweeps: thousands of runs of a mechanism whose numbers vary, as one table."""

from paraflex.campaign import (
    ENGINES as ENGINES,
    Engine as Engine,
    LostCluster as LostCluster,
    open_engine as open_engine,
)
from paraflex.designs.run import Outcome as Outcome, Task as Task, run_task as run_task
from paraflex.designs.samples import Varied as Varied
from paraflex.designs.setting import Setting as Setting
from paraflex.designs.sweep import (
    SweepResult as SweepResult,
    SweepStudy as SweepStudy,
    load_sweep as load_sweep,
    sweep as sweep,
)
from paraflex.results.metrics import METRICS as METRICS, Metric as Metric
