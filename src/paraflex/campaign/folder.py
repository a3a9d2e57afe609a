"""Folder of a study of many runs: opened, checked and locked, with journal and table, and joined from its shards."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.errors import InputError, ResultWarning, warn_user
from paraflex.folders import STUDY_OF_RUNS, ResultsFolder, check_listed, files_of, foreign_files, hold_folder
from paraflex.folders.changes import check_inside
from paraflex.results.tables import read_parquet
from paraflex.seals import check_seal, damaged
from paraflex.writing import GO_ON, read_values, whole_file, write_json
from .journal import JOURNAL, Journal, Row, write_journal
from .tables import EARLIER, RESULTS, SCHEMA_KEY, UNFINISHED, read_table, tables_of, write_table

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
