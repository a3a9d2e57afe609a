"""Tables of the benchmarks page, from the JSON that the scripts write: `benchmarks/measured` holds what is shown."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError

MEASURED = Path(__file__).parents[2] / "benchmarks" / "measured"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put a table where a page says `<!-- measured: NAME -->`."""

    def table(found: re.Match[str]) -> str:
        if found[1] not in TABLES:
            raise PluginError(f"{page.file.src_uri}: no table {found[1]!r}; there are {', '.join(TABLES)}")
        data = json.loads((MEASURED / f"{found[1]}.json").read_text(encoding="utf-8"))
        return f"{_conditions(data)}\n\n{TABLES[found[1]](data)}"

    # cost-model.md has a section of this form that its script writes.
    return re.sub(r"<!-- measured: (?!begin|end)(\w+) -->", table, markdown)


def _conditions(data: dict[str, Any]) -> str:
    machine, versions = data["machine"], data["versions"]
    return (
        f"`{data['command']}`, {data['date']}: {machine['processor']}, {machine['processors']} processors, load "
        f"{data['load'][0]:.1f}; Numba {versions['numba']}, Exudyn {versions['exudyn']}, MuJoCo {versions['mujoco']}."
    )


def peers(data: dict[str, Any]) -> str:
    """One run by every engine, fastest first."""
    results = sorted(data["results"], key=lambda result: result["seconds"])
    best = results[0]["seconds"]
    return _table(
        ("Engine", "Setting", "Off by [m]", "Time [s]", "fastest to slowest", "Real time", "Times the first"),
        [
            (
                result["name"],
                result["setting"],
                f"{result['deviation']:.1e}",
                f"{result['seconds']:.3f}",
                f"{result['fastest']:.3f} to {result['slowest']:.3f}",
                f"{data['duration'] / result['seconds']:.1f} x",
                f"{result['seconds'] / best:.1f}",
            )
            for result in results
        ],
    )


def batch(data: dict[str, Any]) -> str:
    """Many designs by every engine."""
    return _table(
        ("Way", "Off by [m]", "Designs run", f"Time for {data['designs']} [s]"),
        [
            (row["way"], f"{row['deviation']:.1e}", str(row["run"]), f"{row['seconds_of_all']:.0f}")
            for row in data["rows"]
        ],
    )


def startup(data: dict[str, Any]) -> str:
    """Commands and imports, and the first compilation."""
    return _table(
        ("What", "Least [s]", "Median [s]", "Processor time [s]"),
        [
            (start["name"], f"{start['least']:.2f}", f"{start['median']:.2f}", f"{start['processor']:.2f}")
            for start in data["starts"]
        ],
    )


def _table(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [headings, tuple("---" for _ in headings), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)


TABLES: dict[str, Callable[[dict[str, Any]], str]] = {"peers": peers, "batch": batch, "startup": startup}
