"""Global sensitivity analysis: Sobol indices, the shares of a metric's variance explained by the parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Mask
from paraflex.campaign import OnProgress, Study, Workers
from paraflex.designs.run import STATUS_COMPLETE, RunTask, run_task
from paraflex.designs.samples import RANDOM
from paraflex.designs.schema import SamplingTable, StudyFile, study_table
from paraflex.designs.sweep import SweepStudy, SweptResult, make_study
from paraflex.errors import InputError, optional_package, suggestion
from paraflex.limits import DESIGNS, at_most
from paraflex.results.metrics import METRICS
from paraflex.results.numbers import plain
from paraflex.results.tables import read_parquet, write_parquet
from paraflex.writing import GO_ON, write_json
from .schema import StudyTable

TABLE = "indices.parquet"
# Names of the indices in SALib, and columns of a row.
_SHARES = {"first": "S1", "first_confidence": "S1_conf", "total": "ST", "total_confidence": "ST_conf"}
_ROW_COLUMNS = ("path", "mode", "metric", "parameter", *_SHARES, "samples", "dropped")
# Default number of base samples, and the smallest number that gives an estimate.
_BASE_SAMPLES, _FEWEST_BASE_SAMPLES = 128, 8


@dataclass(frozen=True)
class IndicesResult(SweptResult):
    """State of a study of Sobol indices after a session; see `SweptResult`.

    Attributes
    ----------
    indices : xarray.Dataset
        Sobol indices; the dimension `index` runs over metric, path and mode, which are coordinates. It is empty before
        all runs are done. Variables: `first` and `total` (index, parameter), the first-order and total indices, NaN for
        a metric that does not vary; `first_confidence` and `total_confidence`, half-widths of their 95 % intervals from
        resampling; `mean` and `deviation` (index,), mean and standard deviation of the metric over the ranges, in its
        unit; `samples` and `dropped`, numbers of base samples used and of those omitted because of incomplete runs.
    """

    values_file = "indices.json"
    indices: xr.Dataset

    @property
    def table(self) -> Path:
        """Path of the table of indices."""
        return self.folder / TABLE

    @property
    def data(self) -> xr.Dataset:
        """Dataset of the indices."""
        return self.indices

    def to_dict(self) -> dict[str, Any]:
        """Return the indices as plain values: one row per index and parameter."""
        table = (
            self.indices.to_dataframe(dim_order=["index", "parameter"])
            .reset_index()
            .reindex(columns=list(_ROW_COLUMNS))
        )
        rows = [{name: plain(value) for name, value in row.items()} for row in table.to_dict("records")]
        return {"kind": "indices", "name": self.sweep.name, "indices": rows}


@dataclass(frozen=True)
class IndicesStudy(Study[IndicesResult]):
    """Study of Sobol indices: a sweep over Saltelli's samples.

    Attributes
    ----------
    sweep : SweepStudy
        Sweep whose designs are ordered in blocks, one block per base sample.
    columns : tuple of str
        Metrics whose variance is analysed.
    samples : int
        Number of base samples.
    seed : int
        Seed of the samples and of the resampling.
    """

    sweep: SweepStudy
    columns: tuple[str, ...]
    samples: int
    seed: int

    def run(
        self,
        folder: str | Path | None = None,
        *,
        workers: Workers | None = None,
        on_progress: OnProgress | None = None,
        run: RunTask = run_task,
    ) -> IndicesResult:
        """Run the sweep, and compute the indices when all runs are done; see `SweepStudy.run`.

        The table of the sweep, `indices.parquet` and `indices.json` are written into the folder.

        Raises
        ------
        InputError
            Too few complete base samples; see `Study.run` for other reasons.
        """
        import pyarrow as pa

        done = self.sweep.run(folder, workers=workers, on_progress=on_progress, run=run)
        result = IndicesResult(done, _dataset(self, _indices(self, done.table) if done.complete else []))
        if done.complete:
            with result.added() as new:
                write_json(new / result.values_file, result.to_dict(), remedy=GO_ON)
                write_parquet(pa.Table.from_pylist(result.to_dict()["indices"]), new / result.table.name, remedy=GO_ON)
        return result


@checked_arguments()
def load_indices(
    file: StudyFile, metrics: list[str] | None = None, samples: int | None = None, seed: int | None = None
) -> IndicesStudy:
    """Read a study of Sobol indices from the file of a sweep or an optimisation with ranges for all parameters.

    Parameters
    ----------
    file : str, Path or mapping
        Study file, TOML.
    metrics : list of str, optional
        Metrics whose variance is analysed; by default those of the file.
    samples : int, optional
        Number of base samples, a power of two; by default `number` of [sampling], else 128. The number of designs is
        larger by the factor (parameters + 2).
    seed : int, optional
        Seed of the samples; by default that of [sampling].

    Raises
    ------
    InputError
        Invalid file as described in `load_optimisation`, invalid number of samples, or SALib not installed.
    """
    with study_table(StudyTable, file) as (table, folder):
        chosen = table.sampling.seed if seed is None else seed
        sampling = SamplingTable(kind=RANDOM, number=1, seed=chosen)
        base = make_study(table.model_copy(update={"sampling": sampling}), folder)
    number = samples if samples is not None else table.sampling.number or _BASE_SAMPLES
    if number < _FEWEST_BASE_SAMPLES or number & (number - 1):
        raise InputError(
            f"Sobol's sequence needs a power of two, {_FEWEST_BASE_SAMPLES} at least", field="--samples", value=number,
            remedy=f"give {max(_FEWEST_BASE_SAMPLES, 1 << max(number, 1).bit_length())}",
        )  # fmt: skip
    at_most(number * (len(base.parameters) + 2), DESIGNS, "--samples", "too many designs")
    metric_names = metrics or [name for name in base.setting.metrics if not METRICS[name].each]
    columns = _columns(metric_names, base)
    problem = _problem(base.setting.names)
    points = _salib().sample.sobol.sample(problem, number, calc_second_order=False, seed=chosen)
    designs = np.stack([p.spread(column) for p, column in zip(base.parameters, points.T, strict=True)], axis=1)
    study = SweepStudy(base.name, base.setting, base.parameters, "saltelli", designs, base.members)
    return IndicesStudy(study, columns, number, chosen)


@checked_arguments()
def indices(
    study: IndicesStudy | StudyFile,
    folder: str | Path,
    *,
    workers: Workers | int | None = None,
    on_progress: OnProgress | None = None,
    run: RunTask = run_task,
    **read: Any,
) -> IndicesResult:
    """Compute first-order and total Sobol indices of metrics from Saltelli's samples, run as a sweep.

    Parameters
    ----------
    study : IndicesStudy, str, Path or mapping
        Study, its file, or the contents of one.
    folder, workers, on_progress
        See `Study.run`; an integer number of workers is a number of threads.
    run : callable, optional
        Function that runs a task; `run_task` by default.
    **read
        Arguments `metrics`, `samples` and `seed` of `load_indices`, used with a file only.
    """
    study = study if isinstance(study, IndicesStudy) else load_indices(study, **read)
    return study.run(folder, workers=Workers.of(workers), on_progress=on_progress, run=run)


def _indices(study: IndicesStudy, table: Path) -> list[dict[str, Any]]:
    setting = study.sweep.setting
    shape = (len(study.sweep.designs), len(setting.paths), len(setting.modes))
    read = read_parquet(table, ["status", *study.columns])
    # Rows are ordered by design, then by path, then by mode.
    complete = (read["status"].to_numpy() == STATUS_COMPLETE).reshape(shape)
    out = []
    for column in study.columns:
        values = read[column].to_numpy().astype(float).reshape(shape)
        for p, path in enumerate(setting.paths):
            for m, mode in enumerate(setting.modes):
                usable = complete[:, p, m] & np.isfinite(values[:, p, m])
                out.append(_analysed(study, (path, mode, column), values[:, p, m], usable))
    return out


def _analysed(study: IndicesStudy, names: tuple[str, str, str], values: Array, usable: Mask) -> dict[str, Any]:
    """Compute the indices from the base samples whose runs are all complete."""
    kept = usable.reshape(study.samples, -1).all(axis=1)
    count = int(np.count_nonzero(kept))
    if count < _FEWEST_BASE_SAMPLES:
        raise InputError(
            f"only {count} of {study.samples} base samples are complete{names[1] and f' in {names[1]}'}", field="vary",
            remedy="narrow the ranges: the table gives the reasons",
        )  # fmt: skip
    values = values.reshape(study.samples, -1)[kept].ravel()
    mean, deviation = float(np.mean(values)), float(np.std(values))
    found, parameters = {}, study.sweep.setting.names
    if deviation > 1e-12 * abs(mean):
        # SALib treats a seed of 0 as no seed.
        analyse, seed = _salib().analyze.sobol.analyze, study.seed + 1
        found = analyse(_problem(parameters), values, calc_second_order=False, seed=seed)
    none = np.full(len(parameters), np.nan)
    shares = {name: np.asarray(found.get(key, none)) for name, key in _SHARES.items()}
    rest = {"mean": mean, "deviation": deviation, "samples": count, "dropped": study.samples - count}
    return dict(zip(("path", "mode", "metric"), names, strict=True)) | shares | rest


def _dataset(study: IndicesStudy, found: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    names = study.sweep.setting.names
    shares = {
        name: (("index", "parameter"), np.array([each[name] for each in found]).reshape(-1, len(names)))
        for name in _SHARES
    }
    rest = {name: ("index", [each[name] for each in found]) for name in ("mean", "deviation", "samples", "dropped")}
    of = {name: ("index", [each[name] for each in found]) for name in ("metric", "path", "mode")}
    return xr.Dataset(shares | rest, of | {"parameter": list(names)})


def _columns(names: list[str], base: SweepStudy) -> tuple[str, ...]:
    known = [column for name in base.setting.metrics for column in METRICS[name].columns(base.members)]
    for name in names:
        if name not in known:
            raise InputError("not a metric of the study", field="--metric", value=name, remedy=suggestion(name, known))
    return tuple(dict.fromkeys(names))


def _problem(names: tuple[str, ...]) -> dict[str, Any]:
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def _salib() -> Any:
    remedy = "pip install 'paraflex[indices]'"
    with optional_package("global indices need SALib", field="indices", remedy=remedy):
        import SALib.analyze.sobol
        import SALib.sample.sobol
    return SALib
