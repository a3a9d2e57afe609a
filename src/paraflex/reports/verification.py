"""Report of a verification: all models of one mechanism in common charts, and their distances."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.selection import names_of
from paraflex.figures.verification import distance_table, link_tables, model_table, path_extent, printed, runs_of_mode
from paraflex.findings import Finding
from paraflex.formatting import quantity
from paraflex.results.findings import finding_lines
from paraflex.results.following import SPAN_WORDS, ErrorSpan
from paraflex.results.kinds import check_kind
from .film import NO_SHAPES, animation
from .kind_page import kind_page
from .page import Page
from .provenance import asked, command_line, common_facts, summary_beside
from .text import sections

_ENGINES = ("exudyn", "mujoco")


def report_of_folder(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a verification with the summary in its folder."""
    return verification_page(data, summary_beside(folder / "verify.json"))


@checked_arguments()
def verification_page(data: xr.Dataset, summary: Mapping[str, Any]) -> Page:
    """Return the report of a verification.

    Parameters
    ----------
    data : xarray.Dataset
        Results from `studies.Verification.dataset`.
    summary : mapping
        Summary from `studies.agreement`, the content of `verify.json`.
    """
    check_kind(data, "verification")
    modes, models, run = names_of(data, "mode"), names_of(data, "model"), asked(data)
    names, reference = list(map(printed, models)), str(data.attrs["reference"])
    page, path, extent = kind_page(data), run.get("path"), path_extent(data)
    own = {mode: dict(zip(names, runs_of_mode(data, m), strict=True)) for m, mode in enumerate(modes)}
    tables = [model_table(summary, mode, extent, own.get(mode)) for mode in summary["modes"]]
    for mode in summary["modes"]:
        tables += [distance_table(summary, mode, extent), *link_tables(summary, mode)]
    several = len(modes) > 1
    return replace(
        page,
        subtitle=f"{len(models)} models of one mechanism, {f'path “{path}”, ' if path else ''}"
        f"reference: {printed(reference)}",
        verdict=summary.get("verdict", {}).get("level", page.verdict),
        facts=[(name, value) for name, value in common_facts(data) if name != "integration"],
        command=command_line(_request(run, data)),
        figures=_tiles(summary, reference),
        more=sections(tables),
        runs=[f"{mode}, {name}" if several else name for mode in modes for name in names],
        selecting="model",
        selected=models.index(reference),
        film=animation(data, ("mode", "model")),
        no_film=NO_SHAPES,
        notes=finding_lines(map(Finding.from_dict, summary.get("verdict", {}).get("findings", [])))
        + [
            f"Mode {name}, {printed(model)}: {one['message']}"
            for name, mode in summary["modes"].items()
            for model, one in mode["models"].items()
            if one["message"]
        ],
    )


def _request(run: Mapping[str, Any], data: xr.Dataset) -> dict[str, Any]:
    """Return the request of `paraflex verify` with the models, the duration and the samples of its results."""
    models, time = names_of(data, "model"), data["time"].values
    return {
        **run, "verify": True, "engines": [name for name in models if name in _ENGINES],
        "fidelities": [name for name in models if name not in _ENGINES], "duration": time[-1], "samples": time.size,
    }  # fmt: skip


def _tiles(summary: Mapping[str, Any], reference: str) -> list[tuple[str, str, str]]:
    """Return the tiles: nearest and farthest model and the error of the reference in the first mode, number of models.

    Distances are from the reference model.
    """
    name, mode = next(iter(summary["modes"].items()))
    apart = {
        model: one["distance_max"] for model, one in mode["models"].items()
        if model != reference and one.get("distance_max") is not None
    }  # fmt: skip
    error = mode["models"].get(reference, {}).get("tracking_error")
    tiles = []
    for title, pick in (("nearest to the reference", min), ("farthest from it", max)):
        if apart:
            model = pick(apart, key=apart.__getitem__)
            tiles.append((title, quantity(apart[model], "m"), f"{printed(model)}, mode {name}"))
    if error is not None:
        span = SPAN_WORDS[ErrorSpan(summary.get("error", ErrorSpan.WHOLE.value))]
        tiles.append((f"RMS error {span}", quantity(error, "m"), printed(reference)))
    whole = all(one["status"] == "complete" for by in summary["modes"].values() for one in by["models"].values())
    tiles.append(("models", str(len(mode["models"])), "all complete" if whole else "not all complete"))
    return tiles
