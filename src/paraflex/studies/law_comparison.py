"""Results of a comparison of control laws: one table with a cell for each law in each actuation mode."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.campaign import Result, Row
from paraflex.designs.run import STATUSES
from paraflex.figures.laws import metrics_of
from paraflex.folders import LAW_COMPARISON
from paraflex.results.export import export, result_tables
from paraflex.results.metrics import METRICS, MetricMembers, metric_name, metric_unit
from paraflex.results.numbers import finite_or_none

if TYPE_CHECKING:
    import pandas as pd

# Kind of the dataset, and name of the law without controllers.
KIND, OPEN_LOOP = "laws", "open loop"
# Status of a cell that was not run because of an interruption.
NOT_RUN = "not run"
CSV = "laws.csv"
_TOGETHER = ", "
_ROWS = ("law", "mode")
_OUTCOME = {
    "status": f"how the run ended: {', '.join(STATUSES)}, or {NOT_RUN}",
    "reason": "why it is not complete, or is doubtful",
}


@dataclass(frozen=True)
class LawComparison(Result):
    """Figures of merit of control laws in several actuation modes.

    Attributes
    ----------
    dataset : xarray.Dataset
        Dataset of dimensions law and mode: metrics with their units, `status` and `reason` of every cell,
        `time_reached` [s]. A law that cannot run in a mode has NaN there. `controllers` and `path` identify a law.
    interrupted : bool
        Whether the user stopped the comparison; cells that were not run have the status "not run".
    """

    kept_as = LAW_COMPARISON
    data_file = "laws.nc"
    values_file = "laws.json"
    dataset: xr.Dataset
    interrupted: bool = False

    @property
    def data(self) -> xr.Dataset:
        """Dataset of all metrics over law and mode."""
        return self.dataset

    @property
    def complete(self) -> bool:
        """Whether every law was run in every mode, successfully or not."""
        return not self.interrupted

    @property
    def begun(self) -> bool:
        """Whether any law was run in any mode."""
        return bool((self.dataset["status"] != NOT_RUN).any())

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the laws, the open loop first."""
        return tuple(map(str, self.dataset["law"].values))

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the modes."""
        return tuple(map(str, self.dataset["mode"].values))

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics, in the order of the columns."""
        return metrics_of(self.dataset)

    @property
    def table(self) -> pd.DataFrame:
        """Table with a row for each law in each mode; its `attrs` hold `units` and `meanings` of the columns."""
        return next(iter(result_tables(self.dataset).values()))

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values, the content of `laws.json`; None for values that are not finite.

        Returns
        -------
        dict
            `laws.<law>` with `controllers`, `path` and `modes.<mode>`: status, reason where there is one, time_reached
            and all metrics; `metrics.<metric>` with unit and meaning; mechanism, modes, error, parameters, version.
        """
        data = self.dataset
        return {
            "mechanism": data.attrs["mechanism"],
            "error": data.attrs["error"],
            "modes": list(self.modes),
            "metrics": {
                name: {"unit": data[name].attrs["units"], "meaning": data[name].attrs["long_name"]}
                for name in self.metrics
            },
            "laws": {law: self._of_law(data.sel(law=law)) for law in self.laws},
            "interrupted": self.interrupted,
            "parameters": json.loads(data.attrs["parameters"]),
            "version": data.attrs["paraflex_version"],
        }

    def write_files(self, folder: Path) -> None:
        """Write `laws.nc`, `laws.json` and the table as `laws.csv`; see `Result.save`."""
        super().write_files(folder)
        export(self.dataset, folder / CSV, "csv")

    def _of_law(self, row: xr.Dataset) -> dict[str, Any]:
        names = str(row["controllers"].item())
        return {
            "controllers": names.split(_TOGETHER) if names else [],
            "path": str(row["path"].item()),
            "modes": {mode: _plain_cell(row.sel(mode=mode), self.metrics) for mode in self.modes},
        }


def _plain_cell(cell: xr.Dataset, metrics: Sequence[str]) -> dict[str, Any]:
    reason = str(cell["reason"].item())
    words = {"status": str(cell["status"].item())} | ({"reason": reason} if reason else {})
    return words | {name: finite_or_none(float(cell[name].item())) for name in ("time_reached", *metrics)}


def law_dataset(
    laws: Mapping[str, tuple[Sequence[str], str]],
    modes: Sequence[str],
    cells: Mapping[tuple[str, str], Row],
    metrics: Sequence[str],
    members: MetricMembers,
    attrs: Mapping[str, Any],
) -> xr.Dataset:
    """Build the dataset of a comparison from its cells.

    Parameters
    ----------
    laws : mapping of str to (names, path)
        Names of the controllers, and path, of every law by its name.
    modes : sequence of str
        Names of the modes.
    cells : mapping of (law, mode) to dict
        Metrics and outcome of each run, by column; missing cells were not run.
    metrics : sequence of str
        Columns of the metrics.
    members : mapping
        Members of the mechanism; see there.
    attrs : mapping
        Attributes of the dataset, its provenance.
    """
    rows = [[cells.get((law, mode), {"status": NOT_RUN}) for mode in modes] for law in laws]

    def numbers(column: str) -> Any:
        given = [[row.get(column) for row in each] for each in rows]
        return np.array([[np.nan if x is None else x for x in each] for each in given], dtype=float)

    data = xr.Dataset(coords={"law": np.array(list(laws), dtype=str), "mode": np.array(list(modes), dtype=str)})
    for column in metrics:
        meaning = METRICS[metric_name(column)].meaning
        data[column] = (_ROWS, numbers(column), {"units": metric_unit(column, members), "long_name": meaning})
    for name, meaning in _OUTCOME.items():
        texts = np.array([[row.get(name, "") for row in each] for each in rows], dtype=str)
        data[name] = (_ROWS, texts, {"long_name": meaning})
    data["time_reached"] = (_ROWS, numbers("time_reached"), {"units": "s", "long_name": "time that the run reached"})
    data["controllers"] = ("law", np.array([_TOGETHER.join(names) for names, _ in laws.values()], dtype=str))
    data["controllers"].attrs["long_name"] = "controllers that act, beside the planned torques"
    data["path"] = ("law", np.array([path for _, path in laws.values()], dtype=str), {"long_name": "path followed"})
    return data.assign_attrs(dict(attrs) | {"kind": KIND})
