"""Report of a tracking study: comparison of all actuation modes, and details of each mode."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Mask
from paraflex.figures.reduction import reduced_runs
from paraflex.figures.run_motion import deflections_of, effort_axis
from paraflex.figures.selection import default_mode, names_of, samples
from paraflex.figures.tracking import Runs, after_table, beside_table, beside_words, result_table, solver_table
from paraflex.findings import DONE_STATUSES
from paraflex.formatting import number, peak, quantity
from paraflex.results.beside import Beside, beside_of
from paraflex.results.findings import finding_lines, finished, validity_line, validity_summary, verdict_of
from paraflex.results.following import headline
from paraflex.results.kinds import check_kind
from .film import NO_SHAPES, animation
from .kind_page import kind_page
from .loads import load_tables, load_tiles, loads_of_runs
from .page import Page, paragraphs
from .provenance import asked, common_facts, model_words, summary_beside, verdict_word
from .text import sections


def report_of_folder(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a tracking study; modes that could not start are in the summary of its folder only."""
    summary = folder / "summary.json"
    modes = summary_beside(summary)["modes"] if summary.is_file() else {}
    return tracking_page(
        data, {name: mode.get("message", "") for name, mode in modes.items() if name not in data["mode"].values}
    )


@checked_arguments()
def tracking_page(data: xr.Dataset, failed: Mapping[str, str] | None = None) -> Page:
    """Return the report of a tracking study.

    Parameters
    ----------
    data : xarray.Dataset
        Results from `results.tracking_dataset`.
    failed : mapping of str to str, optional
        Modes that could not start, each with its reason.
    """
    check_kind(data, "tracking")
    data = data.transpose("mode", "time", ...)
    runs, rows = names_of(data, "mode"), Runs({"": data}, {"": list(failed or {})})
    page, run, loads = kind_page(data), asked(data), loads_of_runs(data)
    path = run.get("path")
    modes = f"{len(runs)} actuation modes" if len(runs) > 1 else f"actuation mode {runs[0]}"
    # The validity is that of complete runs only.
    whole = data.isel(mode=finished(data))
    valid = validity_line({name: validity_summary(whole.sel(mode=name)) for name in names_of(whole, "mode")})
    page = replace(
        page,
        kind="run",
        subtitle=", ".join([f"path “{path}”", modes] if path else [modes]),
        verdict=verdict_word(data, failed or {}),
        facts=[*([("model", model_words(run))] if run else []), *_after(data), *common_facts(data)],
        figures=[*_figures(data), *load_tiles(loads)],
        more=[
            *sections([result_table(rows), after_table(rows)]),
            *load_tables(data, loads, default_mode(data)),
            *sections(reduced_runs(data)),
            *sections([solver_table(rows)]),
        ],
        runs=runs,
        selected=runs.index(default_mode(data)),
        film=animation(data),
        no_film=NO_SHAPES,
        notes=[*_unfinished(data, failed or {}), *page.notes],
        remarks=[valid] if valid else [],
    )
    return _with_beside(page, data, beside_of(data))


def _with_beside(page: Page, data: xr.Dataset, beside: Beside | None) -> Page:
    """Return the page with the errors in another geometry first, and the doubts about that of its runs below them."""
    if beside is None:
        return page
    findings, errors = verdict_of(data), {mode: error for mode, error in beside.errors.items() if error is not None}
    doubts = finding_lines(one for one in findings if one.code == "validity")
    why = f"<summary>Why {beside.geometry} geometry does not hold</summary>{paragraphs(doubts, 'notice')}"
    [(heading, table)] = sections([beside_table(data)])
    best = min(errors, key=errors.__getitem__, default="")
    figures = list(page.figures)
    if best and page.verdict in ("sound", "doubtful"):
        name, value, mode = figures[0]
        of = f"mode {best}, {beside.other} geometry; {beside.geometry}: {value}, {mode}"
        figures[0] = (name, quantity(errors[best], "m"), of)
    return replace(
        page,
        subtitle=f"{page.subtitle}, {beside.geometry} geometry",
        verdict=beside.verdict.level.value if page.verdict in ("sound", "doubtful") else page.verdict,
        judged=f"{beside.other} geometry" if page.verdict in ("sound", "doubtful") else "",
        words=beside_words(data),
        figures=figures,
        summary=[(heading, table + (f"<details>{why}</details>" if doubts else ""))],
        notes=[line for line in page.notes if line not in finding_lines(findings)]
        + finding_lines(one for one in findings if one.code != "validity")
        + [
            f"{beside.other} geometry: {line}"
            for line in finding_lines(one for one in beside.verdict if one not in findings)
        ],
    )


def _after(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return a fact on the motors after the motion, if runs continue after it."""
    if data["time"].values[-1] <= data.attrs.get("motion_end", np.inf) or "after" not in data.attrs:
        return []
    if asked(data).get("ked"):
        return [("after the motion", "motors held, as all the time")]
    return [("after the motion", "motors held by brakes" if data.attrs["after"] == "hold" else "motors free")]


def _figures(data: xr.Dataset) -> list[tuple[str, str, str]]:
    """Return the tiles of the main numbers; failed modes come first, and numbers are those of complete modes."""
    rms, words = headline(data)
    whole = finished(data)
    least, effort = "least " if data.sizes["mode"] > 1 else "", effort_axis(data)
    tiles = [] if whole.all() else [_broken_off(data, whole)]
    for name, values, unit, choose in (
        (f"{least}RMS error {words}", rms.values, "m", np.nanargmin),
        (f"{least}peak {effort.name}", [peak(one) for one in data["torque"].values], effort.unit, np.nanargmin),
        ("largest deflection", [peak(one) or np.nan for one in deflections_of(data)], "m", np.nanargmax),
    ):
        known = np.where(whole, values, np.nan)
        if np.isfinite(known).any():
            run = int(choose(known))
            tiles.append((name, quantity(known[run], unit), f"mode {data['mode'].values[run]}"))
    return tiles


def _broken_off(data: xr.Dataset, whole: Mask) -> tuple[str, str, str]:
    """Return the tile of incomplete runs: their number and the times at which they ended."""
    first = np.flatnonzero(~whole)
    ends = [float(data["time"].values[max(samples(data.isel(mode=r)) - 1, 0)]) for r in first]
    word = str(data["status"].values[first[0]])
    value = f"{first.size} of {whole.size} modes" if whole.size > 1 else f"at {number(ends[0], 3)} s"
    of = f"from t = {number(min(ends), 3)} s on" if whole.size > 1 else f"mode {data['mode'].values[first[0]]}"
    return word, value, f"{of}, of {number(data['time'].values[-1])} s"


def _unfinished(data: xr.Dataset, failed: Mapping[str, str]) -> list[str]:
    """Return the reasons why modes failed or ended early."""
    out = [f"Mode {name} could not be run: {reason}" for name, reason in failed.items()]
    for r, name in enumerate(data["mode"].values):
        status = str(data["status"].values[r])
        if status != "complete":
            part = "" if status in DONE_STATUSES else ". Its curves and numbers are of the part before"
            out.append(f"Mode {name}: {status}. {data['message'].values[r]}{part}".rstrip())
    return out
