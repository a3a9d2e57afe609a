"""Base classes of studies and their results, and their progress."""

from __future__ import annotations

import shutil
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import xarray as xr

from paraflex.arguments import CheckedFields
from paraflex.arrays import Brief
from paraflex.display import Shown
from paraflex.errors import InputError
from paraflex.folders import STUDY_OF_RUNS, ResultsFolder, hold_folder
from paraflex.formatting import number
from paraflex.results.storage import write_results
from paraflex.writing import GO_ON, write_json
from .folder import STUDY
from .tables import CSV, read_data, table_name
from .workers import THREADS, Engine, open_engine


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


def progress_bar(end: float | None = None) -> Callable[..., None]:
    """Return a function to give as `on_progress`, which draws a bar on stderr, in scripts and in notebooks.

    Parameters
    ----------
    end : float, optional
        End of a simulation [s], which reports the time only.
    """
    drawn = ""

    def draw(at: Any, total: float | None = end) -> None:
        nonlocal drawn
        done, total, doing = (at.done, at.total, at.doing) if isinstance(at, Progress) else (at, total, "")
        share = min(max(0.0, done / total), 1.0) if total else 0.0
        line = f"\r{'#' * round(40 * share):.<40} {f'{share:.0%}' if total else number(done, 3)} {doing:<30.30}"
        line += "\n" if share == 1.0 else ""
        if line != drawn:
            print(line, end="", file=sys.stderr, flush=True)
        drawn = line

    return draw


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


class Study(Brief, ABC, Generic[R_co]):
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
