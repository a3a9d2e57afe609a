"""Thousands of runs of anything: workers that compute them, a journal that keeps them, tables made of it."""

from paraflex.campaign.folder import STUDY, TRAJECTORIES, open_campaign, read_study
from paraflex.campaign.journal import Journal, Row, held
from paraflex.campaign.tables import RESULTS, UNFINISHED, read_table, tables_of, write_table
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
    "LostCluster",
    "LostWorker",
    "Row",
    "held",
    "open_campaign",
    "open_engine",
    "outcomes",
    "read_study",
    "read_table",
    "tables_of",
    "write_table",
]
