"""What every study is; and of many runs the workers that compute them, the journal that keeps them, their tables."""

from paraflex.campaign.folder import STUDY, TRAJECTORIES, not_ours, of_another_study, open_campaign, read_study
from paraflex.campaign.journal import Journal, Row, held
from paraflex.campaign.study import KeptResult, OnProgress, Progress, Result, Study, Workers, kept_in, no_workers
from paraflex.campaign.tables import CSV, RESULTS, UNFINISHED, read_data, read_table, tables_of, write_table
from paraflex.campaign.workers import (
    DASK,
    ENGINES,
    PROCESSES,
    THREADS,
    Engine,
    LostCluster,
    LostWorker,
    open_engine,
    outcomes,
)

__all__ = [
    "CSV",
    "DASK",
    "ENGINES",
    "PROCESSES",
    "RESULTS",
    "STUDY",
    "THREADS",
    "TRAJECTORIES",
    "UNFINISHED",
    "Engine",
    "Journal",
    "KeptResult",
    "LostCluster",
    "LostWorker",
    "OnProgress",
    "Progress",
    "Result",
    "Row",
    "Study",
    "Workers",
    "held",
    "kept_in",
    "no_workers",
    "not_ours",
    "of_another_study",
    "open_campaign",
    "open_engine",
    "outcomes",
    "read_data",
    "read_study",
    "read_table",
    "tables_of",
    "write_table",
]
