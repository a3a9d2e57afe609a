"""What every study is, how far it is while it runs, and what every result offers."""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import xarray as xr

from paraflex.arguments import CheckedFields
from paraflex.campaign.folder import STUDY
from paraflex.campaign.tables import CSV, read_data, table_name
from paraflex.campaign.workers import THREADS, Engine, open_engine
from paraflex.display import Shown
from paraflex.errors import InputError
from paraflex.folders import STUDY_OF_RUNS, ResultsFolder, hold_folder
from paraflex.results.storage import write_results
from paraflex.writing import GO_ON, write_json


@dataclass(frozen=True)
class Progress:
    """How far a study is, in what it counts: runs, designs, seconds of a motion.

    Attributes
    ----------
    done, total : float
        Of all, those of earlier sessions among the done ones.
    fresh : float
        Of this session.
    seconds : float
        Since it began.
    doing : str
        What is being done now; empty where many things are.
    best : float or None
        Of a search the least objective, or root mean square residual, until now.
    """

    done: float
    total: float
    fresh: float = 0.0
    seconds: float = 0.0
    doing: str = ""
    best: float | None = None

    @property
    def rate(self) -> float:
        """How many a second in this session."""
        return self.fresh / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def left(self) -> float | None:
        """Time left [s]; None before it can be told."""
        return (self.total - self.done) / self.rate if self.rate > 0.0 else None


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True)
class Workers(CheckedFields):
    """Who computes; results do not depend on it, to the last bit.

    Attributes
    ----------
    engine : str or Engine
        "threads" of this process, "processes", or "dask".
    number : int or None
        As many as there are processors where None.
    cluster : str or None
        Address of a Dask scheduler.
    """

    engine: str | Engine = THREADS
    number: int | None = None
    cluster: str | None = None

    @classmethod
    def of(cls, given: Workers | int | None) -> Workers:
        """Workers as they are given; of a number so many threads."""
        return given if isinstance(given, Workers) else cls(number=given)

    def open(self) -> Engine:
        """The workers, started; see `open_engine` for the errors."""
        return open_engine(self.engine, self.number, self.cluster)


class Result(Shown, ABC):
    """What a study gives."""

    # The kind of results that a folder holds, and files that `save` writes: of the data, empty where the plain values
    # tell all, and of the plain values.
    kept_as: ClassVar[str]
    data_file: ClassVar[str] = ""
    values_file: ClassVar[str]

    @property
    @abstractmethod
    def data(self) -> xr.Dataset | None:
        """All numbers by name, with units and coordinates; None where there are none."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether all that the study asks for is there."""

    @property
    def begun(self) -> bool:
        """Whether there is anything that could be written."""
        return True

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """What was found in plain values, ready for JSON."""

    def save(self, folder: str | Path) -> Path:
        """Write data and plain values into a folder, in place of the results of this kind that it held; the folder.

        Raises
        ------
        InputError
            It holds results of another kind, or another process writes to it.
        OutputError
            It cannot be written; what it held is all there.
        """
        with hold_folder(Path(folder), self.kept_as) as held:
            self.save_in(held)
        return Path(folder)

    def save_in(self, folder: ResultsFolder) -> None:
        """Write what `save` writes into a folder that is held already."""
        with folder.replaced() as new:
            self.write_files(new)

    def write_files(self, folder: Path) -> None:
        """Write the files that `save` writes."""
        data = self.data if self.data_file else None
        if data is not None:
            write_results(data, folder / self.data_file)
        write_json(folder / self.values_file, self.to_dict())


class KeptResult(Result):
    """What a study of many runs gives: it stands in a folder, with the table of all runs."""

    kept_as = STUDY_OF_RUNS
    folder: Path

    @property
    def table(self) -> Path:
        """The one table, or that of the runs done while some are missing."""
        return self.folder / table_name(finished=self.complete)

    @property
    def data(self) -> xr.Dataset:
        """All runs, along the dimension `run`: parameters, metrics with their units, how each ended."""
        return read_data(self.table)

    def save(self, folder: str | Path) -> Path:
        """Copy the study, its tables and the plain values into another folder; see `Result.save`."""
        return Path(folder) if Path(folder).resolve() == self.folder.resolve() else super().save(folder)

    @contextmanager
    def added(self) -> Iterator[Path]:
        """A folder to write more files to, which become part of the study's results.

        Raises
        ------
        OutputError
            They cannot be written.
        """
        with hold_folder(self.folder, self.kept_as, remedy=GO_ON) as held, held.amended() as new:
            yield new

    def write_files(self, folder: Path) -> None:
        """Copy the files that `save` copies."""
        for name in dict.fromkeys((STUDY, self.table.name, CSV, self.values_file)):
            if (self.folder / name).is_file():
                shutil.copyfile(self.folder / name, folder / name)


R_co = TypeVar("R_co", bound=Result, covariant=True)


class Study(ABC, Generic[R_co]):
    """What can be run, read from a file or built in Python."""

    @abstractmethod
    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
    ) -> R_co:
        """Do the study, or what an earlier session left of it.

        Parameters
        ----------
        folder : str or Path, optional
            For the results. A study of many runs needs one: its journal keeps every run there, and a folder that
            another session left is gone on with.
        workers : Workers, optional
            As many threads as there are processors by default.
        on_progress : callable, optional
            Called with how far it is, from whichever thread.

        Returns
        -------
        Result
            A KeyboardInterrupt ends the session with what is there, marked so.

        Raises
        ------
        InputError
            The study cannot be, the folder is another's, or the workers cannot be had.
        OutputError
            The folder cannot be written any more; what was written stays, and the same call goes on from there.
        """


class WholeStudy(Study[R_co]):
    """A study whose result is written as one, as far as it came."""

    # The class of its result.
    gives: ClassVar[type[Result]]

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
    ) -> R_co:
        """Do the study, and write what came of it into the folder, if one is given; see `Study.run`."""
        do = self._ready(workers)
        with nullcontext() if folder is None else hold_folder(Path(folder), self.gives.kept_as) as held:
            result = do(on_progress)
            if held is not None and result.begun:
                result.save_in(held)
        return result

    @abstractmethod
    def _ready(self, workers: Workers | None) -> Callable[[OnProgress | None], R_co]:
        """Function that does the study, after all checks that need no run."""


def no_workers(workers: Workers | None, why: str) -> None:
    """None where no workers are given to a study that has no work for them.

    Raises
    ------
    InputError
        They are.
    """
    if workers is not None:
        raise InputError(why, field="workers", remedy="leave it out")


def kept_in(folder: str | Path | None) -> Path:
    """The folder of a study of many runs.

    Raises
    ------
    InputError
        None is given.
    """
    if folder is None:
        raise InputError("many runs are kept in a folder", field="folder", remedy='name one: run("out")')
    return Path(folder)
