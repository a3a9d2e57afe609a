"""Sweeps of benchmarks: a study given as text, run in a folder that is deleted."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from paraflex.campaign import Workers
from paraflex.studies import SweepStudy, load_sweep, sweep


@dataclass(frozen=True)
class Swept:
    """The table of a sweep, the moments at which its rows were there, and how long it took in all [s]."""

    table: pd.DataFrame
    moments: list[float]
    seconds: float


def study_of(text: str) -> SweepStudy:
    """The study of a file's text."""
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "study.toml"
        file.write_text(text, encoding="utf-8")
        return load_sweep(file)


def swept(text: str, engine: str, workers: int) -> Swept:
    """A study's sweep, from the start of its workers to its table."""
    study, moments = study_of(text), list[float]()
    with tempfile.TemporaryDirectory() as name:
        began = time.perf_counter()
        result = sweep(
            study,
            Path(name) / "out",
            workers=Workers(engine, workers),
            on_progress=lambda _: moments.append(time.perf_counter()),
        )
        seconds = time.perf_counter() - began
        return Swept(pd.read_parquet(result.table), moments, seconds)
