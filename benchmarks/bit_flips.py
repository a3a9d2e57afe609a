"""One flipped bit in a file of results: is it noticed, harmless, or silently read as other numbers?

    python benchmarks/bit_flips.py [--cases N] [--seed N] [--write]

Folders of every kind are made, small ones: a run, a sweep with trajectories, one that is unfinished, an optimisation,
an identification, indices, a verification, a comparison of methods, sensitivities. Each case flips one bit of a file
that numbers are read from, in a copy of its folder, and reads that as users do: `open_results`, figures (what they are
drawn of), reports, the data of the study's result, the study gone on with. What comes of it is the worst of

- raw: an exception that is not paraflex's own;
- silent: other numbers, and nothing said;
- found: an error that names the file, or a warning that does, with the same numbers;
- harmless: the same numbers.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from common import command_line, table, write_json

import paraflex as pf
from paraflex.campaign import Workers, read_data
from paraflex.designs.reopen import open_study
from paraflex.errors import InputError
from paraflex.plots.sources import open_source
from paraflex.reports.kind_page import page_of
from paraflex.studies import (
    load_identification,
    load_indices,
    load_optimisation,
    load_sensitivities,
    load_sweep,
    tracking_case,
)
from paraflex.studies.compare import ComparisonOptions, ComparisonStudy
from paraflex.studies.tracking import TrackingStudy
from paraflex.studies.verification import VerificationOptions, VerificationStudy

CASES, SEED = 3000, 20
OUTCOMES = ("raw", "silent", "found", "harmless")
STUDY = """
mechanism = "five_bar"
paths = ["line"]
modes = ["++"]
duration = 0.02
samples = 5
metrics = ["tracking_rms", "peak_torque_max", "total_mass"]
MORE
[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.x]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.008

[vary.y]
fields = ["lump.tool.mass"]
low = 0.1
high = 1.0
scale = "log"
"""
LOOSE = pf.IntegrationOptions(tolerance=1e-3)
FEW = ComparisonOptions((1e-3,), repetitions=1)
SEARCH = "\n[search]\nevaluations = 5\n"
OBJECTIVE = "\n[objective]\nminimise = { tracking_rms = 1.0 }\n" + SEARCH
TARGET = '\n[[target]]\nmetric = "total_mass"\nvalue = 2.0\n' + SEARCH
SOBOL = '\n[sampling]\nkind = "sobol"\nnumber = 6\n'

Reader = Callable[[Path], Any]
Readers = Mapping[str, Sequence[Reader]]


class Kind(NamedTuple):
    """Results of a kind.

    Attributes
    ----------
    make : callable
        Writes them into a folder.
    readers : mapping of str to callables
        Files that numbers are read from, by a pattern, each with who reads them in a folder.
    """

    make: Reader
    readers: Readers


class Case(NamedTuple):
    """A flipped bit, and what came of it."""

    kind: str
    file: str
    bit: int
    outcome: str
    detail: str


def kinds(folder: Path) -> dict[str, Kind]:
    """All kinds of results; study files come into a folder."""
    return {
        "run": _of_one(TrackingStudy(_task(), ["++"], LOOSE)),
        "verify": _of_one(VerificationStudy(_task(), ["++"], ("rigid", "linear"), VerificationOptions(tolerance=1e-3))),
        "methods": _of_numbers(ComparisonStudy(tracking_case(_task(), "++"), ["esdirk5", "tr-bdf2"], FEW)),
        "sensitivity": _of_numbers(load_sensitivities(_file(folder, "sensitivity"))),
        **studies(folder),
    }


def studies(folder: Path) -> dict[str, Kind]:
    """Studies of many runs; their files come into a folder."""
    sweep = load_sweep(_file(folder, "sweep", SOBOL, more="trajectories = true"))
    whole = _of_many(sweep, "results.parquet")
    return {
        "sweep": whole._replace(readers={**whole.readers, "trajectories/*.nc": (_of("trajectories/*.nc"),)}),
        "unfinished": _of_many(sweep, "unfinished.parquet")._replace(make=partial(_first_runs, sweep)),
        "optimise": _of_many(load_optimisation(_file(folder, "optimise", OBJECTIVE)), "results.parquet", "result.json"),
        "identify": _of_many(
            load_identification(_file(folder, "identify", TARGET)), "results.parquet", "result.json"
        ),
        "indices": _of_many(
            load_indices(_file(folder, "indices"), ["tracking_rms"], 8), "results.parquet", "indices.json"
        ),
    }  # fmt: skip


def _task() -> Any:
    return pf.plan(pf.load("five_bar"), "line", duration=0.02, samples=5)


def _file(folder: Path, name: str, end: str = "", *, more: str = "") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(STUDY.replace("MORE", more) + end, encoding="utf-8")
    return file


def _of_one(study: Any) -> Kind:
    """Of runs that are in one dataset, with plain values beside it."""

    def page(folder: Path) -> Any:
        return page_of(pf.open_results(folder), folder)

    result = study.run()
    return Kind(result.save, {result.data_file: (pf.open_results, open_source, page), result.values_file: (page,)})


def _of_numbers(study: Any) -> Kind:
    """Of plain values alone."""
    result = study.run()
    return Kind(result.save, {result.values_file: (open_source,)})


def _of_many(study: Any, rows: str, values: str = "") -> Kind:
    """Of a study of many runs, whose table has a name; and its plain values, where they are read."""
    again = partial(_go_on, study)
    readers: dict[str, Sequence[Reader]] = {
        rows: (open_source, lambda folder: read_data(folder / rows), again),
        "journal.sqlite": (open_source, again),
        "study.json": (open_study, again),
    }
    return Kind(again, readers | ({values: (open_source, again)} if values else {}))


def _go_on(study: Any, folder: Path) -> Any:
    """What a study gives when its command is said again: plain values and data."""
    result = study.run(folder, workers=Workers(number=1))
    return result.to_dict(), result.data


def _first_runs(study: Any, folder: Path) -> None:
    study.run(folder, workers=Workers(number=1), limit=4)


def _of(pattern: str) -> Reader:
    """The first dataset of a folder by a pattern."""
    return lambda folder: pf.open_results(min(folder.glob(pattern)))


def flips(folder: Path, number: int, seed: int, of: Mapping[str, Kind]) -> Iterator[Case]:
    """So many cases, alike many of every file."""
    random, files = Random(seed), []
    for name, kind in of.items():
        kind.make(folder / name)
        for pattern, readers in kind.readers.items():
            file = min((folder / name).glob(pattern))
            expected = [_plain(_read(reader, folder / name, folder / "as it was")) for reader in readers]
            files.append((name, file.relative_to(folder / name), readers, expected))
    for k in range(number):
        name, file, readers, expected = files[k % len(files)]
        bit = random.randrange(8 * (folder / name / file).stat().st_size)
        yield _case(folder / name, file, bit, list(zip(readers, expected, strict=True)))


def _case(source: Path, file: Path, bit: int, readers: Sequence[tuple[Reader, str]]) -> Case:
    found = []
    for reader, expected in readers:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "results"
            shutil.copytree(source, folder)
            (folder / file).write_bytes(_flipped((folder / file).read_bytes(), bit))
            found.append(_outcome(reader, folder, file.name, expected))
    outcome, detail = min(found, key=lambda each: OUTCOMES.index(each[0]))
    shown = f"{file.parent}/*{file.suffix}" if file.parent.name else file.name
    return Case(source.name, shown, bit, outcome, detail)


def _flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def _outcome(reader: Reader, folder: Path, name: str, expected: str) -> tuple[str, str]:
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            got = _plain(reader(folder))
        except InputError as error:
            return ("found" if name in str(error) and error.remedy else "raw"), str(error)
        except Exception as error:
            return "raw", f"{type(error).__name__}: {error}"
    said = [str(each.message) for each in warned if name in str(each.message)]
    if got != expected:
        return "silent", " ".join(said)
    return ("found", said[0]) if said else ("harmless", "")


def _read(reader: Reader, source: Path, folder: Path) -> Any:
    """What a reader reads in a copy of a folder."""
    shutil.copytree(source, folder)
    try:
        return reader(folder)
    finally:
        shutil.rmtree(folder)


def _plain(found: Any) -> str:
    """What was read, to the last bit, without places and times."""
    return json.dumps(found, default=_part, sort_keys=True)


def _part(found: Any) -> Any:
    if isinstance(found, xr.Dataset):
        return [
            dict(found.attrs),
            {name: [each.dims, each.attrs, each.values] for name, each in found.variables.items()},
        ]
    if isinstance(found, np.ndarray):
        return [str(found.dtype), found.tolist() if found.dtype == object else found.tobytes().hex()]
    if is_dataclass(found):
        return {each.name: getattr(found, each.name) for each in fields(found) if each.name != "folder"}
    return "" if isinstance(found, Path) else found.item() if isinstance(found, np.generic) else str(found)


def main() -> None:
    """Make the folders, flip bits, print the table."""
    parser = command_line(__doc__)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "files").mkdir()
        cases = list(flips(Path(place), asked.cases, asked.seed, kinds(Path(place) / "files")))
    for case in cases:
        if case.outcome in OUTCOMES[:2]:
            print(*case, file=sys.stderr)
    counts = Counter((f"{case.kind}: {case.file}", case.outcome) for case in cases)
    names = sorted({name for name, _ in counts})
    lines = [[name, *(str(counts[name, outcome]) for outcome in OUTCOMES)] for name in names]
    totals = Counter(case.outcome for case in cases)
    lines.append(["all", *(str(totals[outcome]) for outcome in OUTCOMES)])
    print(table(["file", *OUTCOMES], lines))
    named = [dict(zip(("file", *OUTCOMES), line, strict=True)) for line in lines]
    write_json("bit_flips", {"cases": asked.cases, "seed": asked.seed, "files": named}, asked.folder)


if __name__ == "__main__":
    main()
