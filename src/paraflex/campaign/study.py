"""Base classes of studies of many runs and their results, their folder with journal and table, and their progress."""

from __future__ import annotations

import json
import re
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import xarray as xr

from paraflex.arguments import CheckedFields
from paraflex.display import Shown
from paraflex.errors import InputError, ResultWarning, warn_user
from paraflex.folders import STUDY_OF_RUNS, ResultsFolder, check_listed, files_of, foreign_files, hold_folder
from paraflex.folders.changes import check_inside
from paraflex.results.storage import write_results
from paraflex.results.tables import read_parquet
from paraflex.seals import check_seal, damaged
from paraflex.writing import GO_ON, read_values, whole_file, write_json
from .journal import JOURNAL, Journal, Row, write_journal
from .tables import (
    CSV,
    EARLIER,
    RESULTS,
    SCHEMA_KEY,
    UNFINISHED,
    read_data,
    read_table,
    table_name,
    tables_of,
    write_table,
)
from .workers import THREADS, Engine, open_engine

if TYPE_CHECKING:
    import pyarrow as pa

STUDY = "study.json"
TRAJECTORIES = "trajectories"
# Names of the folders of the parts of a study that separate processes compute.
_SHARD = re.compile(r"shard-(\d+)-of-(\d+)", re.ASCII)


@dataclass(frozen=True)
class Campaign:
    """Folder to which a study of many runs writes.

    Attributes
    ----------
    folder : ResultsFolder
        Folder, locked for writing.
    journal : Journal
        Journal of the rows; rows added to it are kept however the study ends.
    """

    folder: ResultsFolder
    journal: Journal

    @contextmanager
    def published(self, *, finished: bool) -> Iterator[Path]:
        """Yield a temporary folder with the table of all rows, for further results; they replace the previous results.

        Parameters
        ----------
        finished : bool
            Whether all runs are done.

        Raises
        ------
        OutputError
            Disk that is full, or cannot be written for another reason.
        """
        with self.folder.replaced(but=(STUDY, f"{JOURNAL}*", f"{TRAJECTORIES}/*")) as new:
            write_table(new, self.journal, finished=finished)
            yield new


@contextmanager
def open_campaign(
    folder: Path, study: Mapping[str, Any], schema: pa.Schema, belongs: Callable[[Row], bool] = lambda _: True
) -> Iterator[Campaign]:
    """Open the folder of a study for writing, or create it; rows added to its journal are kept however the study ends.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    study : mapping
        Content of `study.json`: `content`, a digest of everything that results depend on, `versions` of packages, and
        further entries.
    schema : pyarrow.Schema
        Columns of the table.
    belongs : callable
        Function that checks by its identity whether a row belongs to the study; applied to rows in tables that are
        taken over into a new journal.

    Raises
    ------
    InputError
        Folder with results of another study, of other versions, or with other files, or to which another process
        writes.
    OutputError
        Folder that cannot be written, or is damaged.
    """
    with hold_folder(folder, STUDY_OF_RUNS, field="--output", remedy=GO_ON) as held:
        # This is the only file that an earlier release left if it was killed at its first write.
        (folder / f"{STUDY}.part").unlink(missing_ok=True)
        _check_ours(folder)
        for left in [*folder.glob("*.part"), *folder.glob(f"{TRAJECTORIES}/*.part")]:
            check_inside(folder, left.relative_to(folder))
            left.unlink(missing_ok=True)
        stored = read_study(folder / STUDY) if (folder / STUDY).exists() else study
        _check_same(folder, stored, study)
        with write_journal(folder, locks=held.locks) as journal:
            noted = journal.noted("study")
            _check_same(folder, study if noted is None else _noted(noted), study)
            if noted is None:
                _take_over(folder, journal, schema, belongs)
                journal.note("study", json.dumps(study, default=str).encode())
            if journal.noted(SCHEMA_KEY) is None:
                journal.note(SCHEMA_KEY, schema.serialize().to_pybytes())
            if not (folder / STUDY).exists():
                with held.added_files() as new:
                    write_json(new / STUDY, study, remedy=GO_ON)
            _join_shards(folder, journal, study, schema, belongs)
            yield Campaign(held, journal)


def read_study(file: Path) -> dict[str, Any]:
    """Read the content of a `study.json`.

    Raises
    ------
    InputError
        File that is damaged, cannot be read, or is not that of a study of paraflex.
    """
    remedy = "delete it and run the same command again: it is written again"
    found = read_values(file, remedy)
    check_listed(file, remedy)
    if not isinstance(found, dict) or "content" not in found:
        raise InputError("not the study of a campaign", field=str(file), remedy="name a new folder")
    return found


def _check_ours(folder: Path) -> None:
    """Check that a folder holds a study or is empty."""
    if not any((folder / name).is_file() for name in (STUDY, JOURNAL)):
        names = [*files_of(folder), *foreign_files(folder)]
        names = [name for name in names if not _is_shard(folder / name.partition("/")[0])]
        if names:
            problem = f"the folder holds other files ({', '.join(sorted(names)[:3])})"
            raise InputError(problem, field="--output", value=str(folder), remedy="name a new folder")


def _noted(study: bytes) -> Any:
    """Return the description of a study stored in a journal; None if it is not JSON."""
    with suppress(ValueError, RecursionError):
        return json.loads(study)


def _check_same(folder: Path, found: Any, study: Mapping[str, Any]) -> None:
    had_versions = found.get("versions", {}) if isinstance(found, Mapping) else None
    if not isinstance(had_versions, Mapping) or found.get("content") != study["content"]:
        problem = "the folder holds results of another study, or of this one before it was changed"
        raise InputError(problem, field="--output", value=str(folder), remedy="name a new folder")
    for name, version in study["versions"].items():
        had = had_versions.get(name)
        if had != version:
            raise InputError(
                f"the folder's results were begun with {name} {had}, this is {version}: they would not be comparable",
                field="--output", value=str(folder), remedy=f"name a new folder, or install {name} {had}",
            )  # fmt: skip


def _take_over(folder: Path, journal: Journal, schema: pa.Schema, belongs: Callable[[Row], bool]) -> None:
    """Add the rows of existing tables to a new journal, from an earlier release or after the journal was deleted."""
    files = [folder / name for name in (RESULTS, UNFINISHED) if (folder / name).is_file()]
    for file in [*files, *sorted(folder.glob(EARLIER))]:
        rows = _typed(file, read_parquet(file), schema).to_pylist()
        ours = [row for row in rows if belongs(row)]
        if len(ours) < len(rows):
            text = f"{file}: {len(rows) - len(ours)} of its {len(rows)} rows are of another study, and are left out"
            warn_user(ResultWarning(text))
        journal.add(ours)
    journal.commit()
    shutil.rmtree(folder / Path(EARLIER).parent, ignore_errors=True)


def check_shared(folder: Path, study: Mapping[str, Any]) -> None:
    """Check that the folder of a study may hold shards of this one; see `open_campaign` for the errors."""
    if (folder / STUDY).is_file():
        _check_same(folder, read_study(folder / STUDY), study)
    elif folder.is_dir():
        _check_ours(folder)


def shard_folder(folder: Path, part: int, parts: int) -> Path:
    """Return the folder of a part of a study within that of the study."""
    return folder / f"shard-{part}-of-{parts}"


def _is_shard(place: Path) -> bool:
    return bool(_SHARD.fullmatch(place.name)) and place.is_dir() and not place.is_symlink()


def _join_shards(
    folder: Path, journal: Journal, study: Mapping[str, Any], schema: pa.Schema, belongs: Callable[[Row], bool]
) -> None:
    """Add the rows and trajectories of the shards in a folder that it does not have yet.

    Raises
    ------
    InputError
        Shard that is damaged, or of other versions.
    """
    shards = sorted(filter(_is_shard, folder.iterdir()))
    known = set(journal.runs()) if shards else set()
    for shard in shards:
        # A process that ended at once has left nothing.
        if not (shard / STUDY).is_file():
            continue
        part, parts = _SHARD.findall(shard.name)[0]
        again = f"run it again with --shard {part}/{parts}, or delete {shard}"
        try:
            stored = read_study(shard / STUDY)
            if stored["content"] != study["content"]:
                text = f"{shard}: of another study, or of this one before it was changed: it is left out"
                warn_user(ResultWarning(text))
                continue
            _check_same(shard, stored, study)
            rows = [row for file in tables_of(shard) for row in _typed(file, read_table(file), schema).to_pylist()]
            new = [row for row in rows if row["run"] not in known and belongs(row)]
            for row in new:
                _copy_trajectory(shard / TRAJECTORIES / f"{row['id']}.nc", folder, again)
        except InputError as error:
            raise error.advising(again) from None
        journal.add(new)
        known.update(row["run"] for row in new)
    journal.commit()


def _copy_trajectory(file: Path, folder: Path, remedy: str) -> None:
    name = f"{TRAJECTORIES}/{file.name}"
    if file.is_file() and not file.is_symlink() and not (folder / name).exists():
        check_seal(file, remedy)
        check_inside(folder, name)
        with whole_file(folder / name, remedy=GO_ON) as new:
            shutil.copyfile(file, new)


def _typed(file: Path, found: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return the table of a file after a check that its columns have the types of the study's columns."""
    if not {"run", "id", "status"} <= set(found.column_names):
        raise damaged(file, "not a table of runs", "delete it and run the same command again")
    for column in found.schema:
        if column.name in schema.names and column.type != schema.field(column.name).type:
            raise damaged(file, f"{column.name} holds {column.type}", "delete it and run the same command again")
    return found


@dataclass(frozen=True)
class Progress:
    """Progress of a study, in the units that it counts: runs, designs, or simulated seconds.

    Attributes
    ----------
    done, total : float
        Number of units done, including those of earlier sessions, and total number of units.
    fresh : float
        Number of units done in this session.
    seconds : float
        Wall time since the start of the session [s].
    doing : str
        Description of the current activity; empty if there are several.
    best : float or None
        Least objective or RMS residual of a search so far; None for other studies.
    """

    done: float
    total: float
    fresh: float = 0.0
    seconds: float = 0.0
    doing: str = ""
    best: float | None = None

    @property
    def rate(self) -> float:
        """Number of units per second in this session [1/s]."""
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def left(self) -> float | None:
        """Estimated time left [s]; None before it can be estimated."""
        return (self.total - self.done) / self.rate if self.rate > 0.0 else None


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True)
class Workers(CheckedFields):
    """Workers that compute the runs of a study; results do not depend on them, to the last bit.

    Attributes
    ----------
    engine : str, Engine or concurrent.futures.Executor
        Kind of workers: "threads" of this process, "processes", or "dask"; or an engine; or an executor, which is not
        shut down, for example that of mpi4py or of a batch system.
    number : int or None
        Number of workers; None for the number of processors, or that of the executor.
    cluster : str or None
        Address of a Dask scheduler; None for a cluster on this machine.
    """

    engine: str | Engine | Executor = THREADS
    number: int | None = None
    cluster: str | None = None

    @classmethod
    def of(cls, given: Workers | int | None) -> Workers:
        """Return the given workers, or that number of threads."""
        return given if isinstance(given, Workers) else cls(number=given)

    def open(self) -> Engine:
        """Start the workers; see `open_engine` for the errors."""
        return open_engine(self.engine, self.number, self.cluster)


class Result(Shown, ABC):
    """Base class of the results of studies."""

    # Kind of results of a folder, and the files that `save` writes: that of the data, empty if the plain values are
    # complete, and that of the plain values.
    kept_as: ClassVar[str]
    data_file: ClassVar[str] = ""
    values_file: ClassVar[str]

    @property
    @abstractmethod
    def data(self) -> xr.Dataset | None:
        """Dataset of all numbers, with units and coordinates; None if there are none."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether the results contain everything that the study asks for."""

    @property
    def begun(self) -> bool:
        """Whether there are any results that could be written."""
        return True

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the results as plain values, ready for JSON."""

    def save(self, folder: str | Path) -> Path:
        """Write data and plain values into a folder, replacing results of the same kind, and return its path.

        Raises
        ------
        InputError
            Folder that holds results of another kind, or to which another process writes.
        OutputError
            Folder that cannot be written; its content is unchanged.
        """
        with hold_folder(Path(folder), self.kept_as) as held:
            self.save_in(held)
        return Path(folder)

    def save_in(self, folder: ResultsFolder) -> None:
        """Write the results into a folder that is already held."""
        with folder.replaced() as new:
            self.write_files(new)

    def write_files(self, folder: Path) -> None:
        """Write the files that `save` writes."""
        data = self.data if self.data_file else None
        if data is not None:
            write_results(data, folder / self.data_file)
        write_json(folder / self.values_file, self.to_dict())


class KeptResult(Result):
    """Base class of the results of studies of many runs, which are kept in a folder with the table of all runs."""

    kept_as = STUDY_OF_RUNS
    folder: Path

    @property
    def table(self) -> Path:
        """Path of the table of all runs, or of the runs done so far while some are missing."""
        return self.folder / table_name(finished=self.complete)

    @property
    def data(self) -> xr.Dataset:
        """Dataset of all runs along the dimension `run`: parameters, metrics with units, and status."""
        return read_data(self.table)

    def save(self, folder: str | Path) -> Path:
        """Copy the study, its tables and the plain values into another folder; see `Result.save`."""
        return Path(folder) if Path(folder).resolve() == self.folder.resolve() else super().save(folder)

    @contextmanager
    def added(self) -> Iterator[Path]:
        """Yield a temporary folder for further files, which become part of the study's results.

        Raises
        ------
        OutputError
            Files that cannot be written.
        """
        with hold_folder(self.folder, self.kept_as, remedy=GO_ON) as held, held.added_files() as new:
            yield new

    def write_files(self, folder: Path) -> None:
        """Copy the files that `save` copies."""
        for name in dict.fromkeys((STUDY, self.table.name, CSV, self.values_file)):
            if (self.folder / name).is_file():
                shutil.copyfile(self.folder / name, folder / name)


R_co = TypeVar("R_co", bound=Result, covariant=True)


class Study(ABC, Generic[R_co]):
    """Base class of studies, which are read from a file or built in Python."""

    @abstractmethod
    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
    ) -> R_co:
        """Run the study, or the part of it that an earlier session left undone.

        Parameters
        ----------
        folder : str or Path, optional
            Folder of the results. A study of many runs requires one: its journal records every run, and a study left
            unfinished by an earlier session is continued.
        workers : Workers, optional
            Workers that compute the runs; by default one thread per processor.
        on_progress : callable, optional
            Function called with the `Progress` of the study, from any thread.

        Returns
        -------
        Result
            Results of the study. A KeyboardInterrupt ends the session with the partial results, marked as interrupted.

        Raises
        ------
        InputError
            Invalid study, folder of another study, or workers that are not available.
        OutputError
            Folder that can no longer be written. Results written before are kept, and the same call continues from
            them.
        """


class WholeStudy(Study[R_co]):
    """Base class of studies whose results are written at the end, complete or partial."""

    # Class of the results.
    gives: ClassVar[type[Result]]

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
    ) -> R_co:
        """Run the study, and write the results into the folder, if one is given; see `Study.run`."""
        do = self._prepare(workers)
        with nullcontext() if folder is None else hold_folder(Path(folder), self.gives.kept_as) as held:
            result = do(on_progress)
            if held is not None and result.begun:
                result.save_in(held)
        return result

    @abstractmethod
    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], R_co]:
        """Check everything that needs no run, and return the function that runs the study."""


def no_workers(workers: Workers | None, why: str) -> None:
    """Check that no workers are given to a study that does not use them.

    Raises
    ------
    InputError
        Workers given, with the reason why they are not used.
    """
    if workers is not None:
        raise InputError(why, field="workers", remedy="leave it out")


def kept_in(folder: str | Path | None) -> Path:
    """Return the path of the folder of a study of many runs.

    Raises
    ------
    InputError
        No folder given.
    """
    if folder is None:
        raise InputError("many runs are kept in a folder", field="folder", remedy='name one: run("out")')
    return Path(folder)
