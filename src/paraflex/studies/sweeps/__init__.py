"""Sweeps: thousands of runs of a mechanism whose numbers vary, as one table."""

from paraflex.campaign import ENGINES, Engine, LostCluster, open_engine
from paraflex.designs.run import Outcome, Task, run_task
from paraflex.designs.samples import Varied
from paraflex.designs.session import SweepProgress, SweepResult, sweep
from paraflex.designs.setting import Setting
from paraflex.designs.study import SweepStudy, load_sweep
from paraflex.results.metrics import METRICS, Metric

__all__ = [
    "ENGINES",
    "METRICS",
    "Engine",
    "LostCluster",
    "Metric",
    "Outcome",
    "Setting",
    "SweepProgress",
    "SweepResult",
    "SweepStudy",
    "Task",
    "Varied",
    "load_sweep",
    "open_engine",
    "run_task",
    "sweep",
]
