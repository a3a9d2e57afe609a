"""Base classes of studies and results, and for studies of many runs the workers, the journal and the tables."""

from .folder import (
    STUDY as STUDY,
    TRAJECTORIES as TRAJECTORIES,
    Campaign as Campaign,
    check_shared as check_shared,
    open_campaign as open_campaign,
    read_study as read_study,
    shard_folder as shard_folder,
)
from .journal import Journal as Journal, Row as Row
from .study import (
    KeptResult as KeptResult,
    OnProgress as OnProgress,
    Progress as Progress,
    Result as Result,
    Study as Study,
    WholeStudy as WholeStudy,
    Workers as Workers,
    kept_in as kept_in,
    no_workers as no_workers,
    progress_bar as progress_bar,
)
from .tables import (
    checked_rows as checked_rows,
    read_data as read_data,
    read_table as read_table,
    read_tables as read_tables,
    table_name as table_name,
    tables_of as tables_of,
)
from .workers import (
    THREADS as THREADS,
    Engine as Engine,
    LostCluster as LostCluster,
    LostWorker as LostWorker,
    open_engine as open_engine,
    outcomes as outcomes,
)
