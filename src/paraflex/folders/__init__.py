"""Folders of results: a manifest lists the files that belong together, and changes of a folder are atomic.

If the writer is killed, the next process that opens the folder completes the change.
"""

from .changes import MANIFEST as MANIFEST, check_inside as check_inside
from .held import (
    Manifest as Manifest,
    ResultsFolder as ResultsFolder,
    added_to as added_to,
    check_listed as check_listed,
    files_of as files_of,
    foreign_files as foreign_files,
    hold_folder as hold_folder,
    kind_of_folder as kind_of_folder,
    read_manifest as read_manifest,
)
from .kinds import (
    COMPARISON as COMPARISON,
    DATA_FILES as DATA_FILES,
    FOLDER_FILES as FOLDER_FILES,
    LAW_COMPARISON as LAW_COMPARISON,
    RESULT_KINDS as RESULT_KINDS,
    RUN as RUN,
    RUN_COMPARISON as RUN_COMPARISON,
    SENSITIVITY as SENSITIVITY,
    STUDY_OF_RUNS as STUDY_OF_RUNS,
    VERIFICATION as VERIFICATION,
    ResultKind as ResultKind,
)
from .lock import FolderInUseError as FolderInUseError, finish_change as finish_change, lock_folder as lock_folder
