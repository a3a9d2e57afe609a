"""Sweeps: thousands of runs of a mechanism whose numbers vary, as one table."""

from paraflex.campaign import ENGINES, Engine, LostCluster, open_engine
from paraflex.designs.run import Outcome, Task, run_task
from paraflex.designs.samples import Varied
from paraflex.designs.setting import Setting
from paraflex.designs.sweep import SweepResult, SweepStudy, load_sweep, sweep
from paraflex.results.metrics import METRICS, Metric

__all__ = [
    "ENGINES",
    "METRICS",
    "Engine",
    "LostCluster",
    "Metric",
    "Outcome",
    "Setting",
    "SweepResult",
    "SweepStudy",
    "Task",
    "Varied",
    "load_sweep",
    "open_engine",
    "run_task",
    "sweep",
]
