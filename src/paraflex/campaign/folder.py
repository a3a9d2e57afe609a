"""The folder of a study: whose results it holds, its journal, and the table that is made of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.campaign.journal import JOURNAL, LOCK, Journal, held, no_folder, write_journal
from paraflex.campaign.tables import EARLIER, RESULTS, SCHEMA_KEY, UNFINISHED, read_table
from paraflex.errors import InputError, OutputError
from paraflex.writing import GO_ON, read_json, write_json

if TYPE_CHECKING:
    import pyarrow as pa

STUDY = "study.json"
TRAJECTORIES = "trajectories"


@contextmanager
def open_campaign(folder: Path, study: Mapping[str, Any], schema: pa.Schema) -> Iterator[Journal]:
    """A folder, made that of a study or seen to be; rows that are added to its journal stay, whatever happens.

    Parameters
    ----------
    folder : Path
    study : mapping
        What `study.json` says: `content`, a digest of all that results depend on, `versions` of packages, and more.
    schema : pyarrow.Schema
        Columns of the table.

    Raises
    ------
    InputError
        It holds results of another study, of other versions, or something else; or another process writes to it.
    OutputError
        It cannot be written, or is damaged.
    """
    with held(folder) as locks:
        _check_ours(folder)
        for left in [*folder.glob("*.part"), *folder.glob(f"{TRAJECTORIES}/*.part")]:
            left.unlink(missing_ok=True)
        said = read_study(folder / STUDY) if (folder / STUDY).exists() else study
        _check_same(folder, said, study)
        with write_journal(folder, locks=locks) as journal:
            noted = journal.noted("study")
            _check_same(folder, study if noted is None else json.loads(noted), study)
            if noted is None:
                _take_over(folder, journal)
                journal.note(SCHEMA_KEY, schema.serialize().to_pybytes())
                journal.note("study", json.dumps(study, default=str).encode())
            if not (folder / STUDY).exists():
                write_json(folder / STUDY, study, remedy=GO_ON)
            yield journal


def read_study(file: Path) -> dict[str, Any]:
    """What a `study.json` says.

    Raises
    ------
    InputError
        It cannot be read, or is none of ours.
    """
    found = read_json(file)
    if "content" not in found:
        raise InputError("not the study of a campaign", field=str(file), remedy="name a new folder")
    return found


def not_ours(folder: Path, names: Collection[str]) -> InputError:
    """The error of a folder with files that no study wrote."""
    problem = f"the folder holds other files ({', '.join(sorted(names)[:3])})"
    return InputError(problem, field="--output", value=str(folder), remedy="name a new folder")


def of_another_study(folder: Path) -> InputError:
    """The error of a folder whose results are not those of the study that is to go on there."""
    problem = "the folder holds results of another study, or of this one before it was changed"
    return InputError(problem, field="--output", value=str(folder), remedy="name a new folder")


def _check_ours(folder: Path) -> None:
    """Refuse a folder that holds files and no study."""
    try:
        names = {each.name for each in folder.iterdir()} - {LOCK}
    except OSError as error:
        raise no_folder(folder, error) from error
    if names and not names & {STUDY, JOURNAL}:
        raise not_ours(folder, names)


def _check_same(folder: Path, found: Mapping[str, Any], study: Mapping[str, Any]) -> None:
    if found.get("content") != study["content"]:
        raise of_another_study(folder)
    for name, wanted in study["versions"].items():
        had = found.get("versions", {}).get(name)
        if had != wanted:
            raise InputError(
                f"the folder's results were begun with {name} {had}, this is {wanted}: they would not be comparable",
                field="--output", value=str(folder), remedy=f"name a new folder, or install {name} {had}",
            )  # fmt: skip


def _take_over(folder: Path, journal: Journal) -> None:
    """Give a new journal the rows of tables beside it: of an earlier release, or of a journal that was deleted."""
    import pyarrow as pa

    files = [folder / name for name in (RESULTS, UNFINISHED) if (folder / name).is_file()]
    for file in [*files, *sorted(folder.glob(EARLIER))]:
        try:
            journal.add(read_table(file).to_pylist())
        except (OSError, pa.ArrowException) as error:
            raise OutputError(
                f"cannot be read ({str(error).splitlines()[0]})", field=str(file),
                remedy="delete this file and run the same command again: its runs are made again",
            ) from error  # fmt: skip
    journal.commit()
    shutil.rmtree(folder / Path(EARLIER).parent, ignore_errors=True)
