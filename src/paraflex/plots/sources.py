"""Recognition of results on disk by their content: kind of results, and data for figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from paraflex.campaign import tables_of
from paraflex.errors import InputError
from paraflex.figures.designs import DesignTable, read_designs
from paraflex.folders import DATA_FILES, RESULT_KINDS, STUDY_OF_RUNS, ResultKind, check_listed
from paraflex.seals import NETCDF, PARQUET, check_regular, unreadable
from paraflex.writing import read_values

_OURS = "name a folder or file that paraflex wrote"
_BEGINNINGS = {NETCDF: "netcdf", b"CDF\x01": "netcdf", b"CDF\x02": "netcdf", PARQUET: "parquet"}


@dataclass(frozen=True)
class Source:
    """Results from which figures can be drawn.

    Attributes
    ----------
    kind : str
        Kind of results, a key of `RESULT_KINDS`.
    data : xarray.Dataset, mapping, list or DesignTable
        Data in the form that the functions of `paraflex.plots` take.
    folder : Path
        Folder that holds the results.
    designs : DesignTable or None
        Table of all runs, for a study of many designs.
    """

    kind: str
    data: Any
    folder: Path
    designs: DesignTable | None = None


def open_source(path: str | Path) -> Source:
    """Open the results of any command from their folder or one of their files."""
    path = Path(path)
    if not path.exists():
        raise InputError("no such file or folder", field="RESULTS", value=str(path), remedy=_OURS)
    if path.is_dir():
        return _folder(path)
    kind = _format(path)
    if kind == "json":
        return _json(path)
    if kind == "parquet":
        table = read_designs([path])
        return Source("sweep", table, path.parent, table)
    from paraflex.results import kind_of, open_results

    data = open_results(path)
    return Source(kind_of(data), data, path.parent)


def _folder(folder: Path) -> Source:
    found = [folder / name for name in DATA_FILES if (folder / name).is_file()]
    if len(found) > 1:
        names = ", ".join(each.name for each in found)
        raise InputError(f"holds several results ({names})", field=str(folder), remedy="name one of the files")
    if found:
        return open_source(found[0])
    table = _designs(folder)
    if table is None:
        raise InputError("no results in this folder", field=str(folder), remedy=_OURS)
    return Source("sweep", table, folder, table)


def _format(file: Path) -> str:
    try:
        check_regular(file)
        with file.open("rb") as opened:
            beginning = opened.read(4)
    except OSError as error:
        raise unreadable(error, file, _OURS) from error
    kind = _BEGINNINGS.get(beginning, "json" if beginning.lstrip()[:1] in (b"{", b"[") else "")
    if not kind:
        raise InputError("not a file of results", field=str(file), remedy=_OURS)
    return kind


def _json(file: Path) -> Source:
    remedy = "make these results again"
    check_listed(file, remedy)
    found = read_values(file, remedy)
    kind = kind_of_numbers(found)
    if kind:
        searched = RESULT_KINDS[kind].folder == STUDY_OF_RUNS
        return Source(kind, found, file.parent, _designs(file.parent) if searched else None)
    beside = [name for name in DATA_FILES if (file.parent / name).is_file() and name != file.name]
    remedy = f"name {beside[0]} beside it" if beside else _OURS
    raise InputError("no figures are drawn from this file", field=str(file), remedy=remedy)


def kind_of_numbers(found: Any) -> str:
    """Return the kind of results with these plain numbers; empty if no figures can be drawn of them."""
    return next((kind.name for kind in RESULT_KINDS.values() if _recognised(kind, found)), "")


def _recognised(kind: ResultKind, found: Any) -> bool:
    """Return whether plain numbers have the marks of a kind."""
    rows = [found] if not kind.listed else found if isinstance(found, list) else []
    return bool(kind.marks and rows) and all(
        isinstance(row, Mapping) and all(key in row and value in (..., row[key]) for key, value in kind.marks.items())
        for row in rows
    )


def _designs(folder: Path) -> DesignTable | None:
    """Return the table of a folder's runs; None if there are none."""
    files = tables_of(folder)
    table = read_designs(files) if files else None
    return table if table is not None and table.complete.size else None
