"""Sweeps: thousands of runs of a mechanism whose numbers vary, as one table."""

from paraflex.studies.sweeps.engines import ENGINES, Engine, LostCluster, open_engine
from paraflex.studies.sweeps.metrics import METRICS, Metric
from paraflex.studies.sweeps.run import Outcome, Task, run_task
from paraflex.studies.sweeps.samples import Varied
from paraflex.studies.sweeps.session import SweepProgress, SweepResult, sweep
from paraflex.studies.sweeps.study import Setting, SweepStudy, load_sweep

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
