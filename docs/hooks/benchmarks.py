"""Tables of measurements, from the JSON that `benchmarks` write: `benchmarks/measured` holds what is shown."""

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
        file, made = TABLES[found[1]]
        data = json.loads((MEASURED / f"{file}.json").read_text(encoding="utf-8"))
        return f"{_conditions(data, file)}\n\n{made(data)}"

    # cost-model.md has a section of this form that its script writes.
    return re.sub(r"<!-- measured: (?!begin|end)(\w+) -->", table, markdown)


def _conditions(data: dict[str, Any], file: str) -> str:
    """Command, day and versions; where times were measured, the machine and its load as well."""
    machine, names = data["machine"], {"numba": "Numba"}
    where = f"{machine['processor']}, {machine['processors']} processors, load {data['load'][0]:.1f}; "
    if file in ENGINES:
        names |= {"exudyn": "Exudyn", "mujoco": "MuJoCo"}
    versions = ", ".join(f"{title} {data['versions'][name]}" for name, title in names.items())
    return f"`{data['command']}`, {data['date']}: {where if file in TIMED else ''}{versions}."


def peers(data: dict[str, Any]) -> str:
    """One run by every engine, fastest first: like with like, then linear beams apart."""
    results = sorted(data["results"], key=lambda result: result["seconds"])
    linear = [result for result in results if ", linear" in result["name"]]
    like = [result for result in results if result not in linear]
    return (
        f"Second order beside exact beams and segments:\n\n{_times(like, data['duration'], like[0])}\n\n"
        f"Linear beams, on the same scale:\n\n{_times(linear, data['duration'], like[0])}"
    )


def _times(results: list[dict[str, Any]], duration: float, first: dict[str, Any]) -> str:
    headings = ("Engine", "Setting", "Off by [m]", "Time [s]", "fastest to slowest", "Real time", "Beside second order")
    return _table(
        headings,
        [
            (
                result["name"],
                result["setting"],
                f"{result['deviation']:.1e}",
                f"{result['seconds']:.3f}",
                f"{result['fastest']:.3f} to {result['slowest']:.3f}",
                f"{duration / result['seconds']:.1f} x",
                f"{result['seconds'] / first['seconds']:.1f}",
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


def history(data: dict[str, Any]) -> str:
    """Times, rates and sizes by commit."""
    columns = data["columns"]
    return _table(
        ("Commit", "Of", *(title for title, _ in columns.values())),
        [
            (
                f"`{line['commit'][:8]}`",
                line["committed"],
                *(
                    format(line["figures"][name], form) if name in line["figures"] else ""
                    for name, (_, form) in columns.items()
                ),
            )
            for line in reversed(data["lines"])
        ],
    )


def paths_and_modes(data: dict[str, Any]) -> str:
    """Tracking errors of all paths and modes, during the motion and over the whole run [mm]."""
    models = {"second_order": "Second order", "exact": "Exact beams", "linear": "The paper's linear beams"}
    headings = [f"{title}, {part}" for title in models.values() for part in ("motion", "whole run")]

    def cells(errors: dict[str, float] | None) -> tuple[str, ...]:
        return ("fails", "fails") if errors is None else (_millimetres(errors["motion"]), _millimetres(errors["run"]))

    return _table(
        ("Path, its time", "Mode", *headings),
        [
            (
                f"{row['path']}, {row['motion_end']:.2f} s",
                row["mode"],
                *(x for name in models for x in cells(row[name])),
            )
            for row in data["rows"]
        ],
    )


def table_3(data: dict[str, Any]) -> str:
    """The paper's Table 3 beside the same modes of ours, over the whole run [m]."""
    square = {row["mode"]: row for row in data["rows"] if row["path"] == "square"}
    rows = []
    for mode, paper in data["table_3"].items():
        linear, second, exact = (square[mode][model]["run"] for model in ("linear", "second_order", "exact"))
        parameters, theory = _percent(linear / paper - 1.0), _percent(linear / exact - 1.0)
        rows.append((mode, f"{paper:.2e}", f"{linear:.2e}", parameters, theory, f"{second:.2e}", f"{exact:.2e}"))
    ours = ("The paper's theory here", "from Table 3: parameters", "from exact beams: theory")
    return _table(("Mode", "Table 3", *ours, "Second order", "Exact beams"), rows)


def model_agreement(data: dict[str, Any]) -> str:
    """Tracking errors of every model [m], and how far from exact beams."""
    names = [name for name in data["rows"][0]["models"] if name not in ("exact beams", "56 segments, MuJoCo")]
    rows = []
    for row in data["rows"]:
        exact = row["models"]["exact beams"]["run"]
        errors = [row["models"][name]["run"] for name in names]
        rows.append(
            (row["mode"], f"{exact:.4e}", *(f"{error:.3e}, {_percent(error / exact - 1.0)}" for error in errors))
        )
    return _table(("Mode", "Exact beams", *(name[:1].upper() + name[1:] for name in names)), rows)


def library_agreement(data: dict[str, Any]) -> str:
    """Tracking errors of other mechanisms [m], how far from exact beams, and largest distances."""
    names = list(data["rows"][0]["models"])
    rows = []
    for row in data["rows"]:
        exact = row["exact"]["run"]
        errors = [row["models"][name]["run"] for name in names]
        apart = row["models"]["second order, pinned"]["apart"]
        rows.append(
            (
                f"{row['mechanism']}, {row['mode']}",
                f"{exact:.3e}",
                *(f"{error:.3e}, {_percent(error / exact - 1.0)}" for error in errors),
                f"{_millimetres(row['strays'])} mm",
                f"{1e6 * apart:.1f} µm",
            )
        )
    headings = (name[:1].upper() + name[1:] for name in names)
    return _table(("Mode", "Exact beams", *headings, "Strays by", "Apart"), rows)


def model_convergence(data: dict[str, Any]) -> str:
    """How far a finer step and a finer mesh move the path: the largest of all modes."""
    rows = []
    for name in data["rows"][0]["models"]:
        moved = []
        for change in ("step", "mesh"):
            by_mode = {row["mode"]: row["models"][name]["changes"][change] for row in data["rows"]}
            worst = max(by_mode, key=lambda mode: by_mode[mode] or 0.0)
            moved.append("" if by_mode[worst] is None else f"{by_mode[worst]:.1e} m in {worst}")
        rows.append((name, *moved))
    return _table(("Model", "By the step", "By the mesh"), rows)


def method_times(data: dict[str, Any]) -> str:
    """Every method: its run at 1e-4 m, and times to two errors."""
    headings = ("Error [m]", "Steps", "Newton iterations", "Imbalance of energy [J]", "Time [s]")
    rows = []
    for method in data["methods"].values():
        run = next(run for run in method["runs"] if run["tolerance"] == 1e-4)
        times = (method["time_to_reach"][level] for level in ("0.0001", "1e-05"))
        cells = ("", "", "", "", f"over {data['limit']:g}")
        if run["status"] == "complete":
            numbers = (str(run["steps"]), str(run["newton_iterations"]), f"{run['energy_balance_max']:.1e}")
            cells = (f"{run['error']:.1e}", *numbers, _seconds(run["wall_time"]))
        rows.append((method["title"], *cells, *("" if time is None else _seconds(time) for time in times)))
    return _table(("Method", *headings, "Time to 1e-4 m [s]", "to 1e-5 m [s]"), rows)


def agreement(data: dict[str, Any]) -> str:
    """Distance from a converged path and imbalance of energy of every method."""
    return _table(
        ("Method", "Tolerance [m]", "Distance [m]", "Energy [J]"),
        [
            (row["method"], f"{row['tolerance']:.0e}", f"{row['distance']:.1e}", f"{row['energy_imbalance']:.1e}")
            for row in data["methods"]
        ],
    )


def orders(data: dict[str, Any]) -> str:
    """Median orders in positions, velocities and multipliers."""
    names = next(iter(data["orders"].values()))

    def cell(values: list[float | None]) -> str:
        return ", ".join("rounding" if value is None else f"{value:.1f}" for value in values)

    return _table(
        ("Method", *data["orders"]),
        [(f"`{name}`", *(cell(part[name]) for part in data["orders"].values())) for name in names],
    )


def default_method(data: dict[str, Any]) -> str:
    """Errors and times of the ESDIRK methods over all cases."""
    headings = ("Error over tolerance, median", "largest", "Time over TR-BDF2's at 1e-4 m, median", "largest")
    numbers = ("error", "largest_error", "time", "largest_time")
    return _table(
        ("Method", "Tolerance [m]", "Failed", *headings),
        [
            (
                f"`{row['method']}`",
                f"{row['tolerance']:.0e}",
                str(row["failed"]),
                *(f"{row[name]:.2g}" for name in numbers),
            )
            for row in data["rows"]
        ],
    )


def convergence(data: dict[str, Any]) -> str:
    """Every mode of the paper's study at its tolerance."""
    distance = "Largest distance from the converged path, per tolerance"
    return _table(
        ("Mode", "Converged tracking error [m]", "Error of it", distance),
        [
            (row["mode"], f"{row['converged']:.4e}", f"{100 * row['error']:.2f} %", f"{row['distance']:.2f}")
            for row in data["shown"]
        ],
    )


def real_time(data: dict[str, Any]) -> str:
    """One run at several tolerances by two methods."""
    return _table(
        ("Method", "Tolerance [m]", "Error of the tracking error", "Time for 0.7 s [s]", "Real time"),
        [
            (
                f"`{row['method']}`",
                f"{row['tolerance']:.0e}",
                f"{100 * row['relative_error']:.2f} %",
                _seconds(row["wall_time"]),
                f"{row['times_real_time']:.1f} x",
            )
            for row in data["rows"]
        ],
    )


def scaling(data: dict[str, Any]) -> str:
    """Rows of four-bars and chains: times over n."""
    headings = ("n", "Build [s]", "Close and start [s]", "A step [ms]", "Twice the n", "Arrays [MB]")
    return _table(
        (*headings, "A step of a chain [ms]", "Twice the n"),
        [
            (
                str(row["n"]),
                _seconds(row["build"]),
                _seconds(row["start"]),
                *_step(row),
                f"{row['megabytes']:.1f}",
                *_step(chain),
            )
            for row, chain in zip(data["four_bars"], data["chains"], strict=True)
        ],
    )


def plans(data: dict[str, Any]) -> str:
    """Plans of rows and chains: times over n."""
    headings = ("n", "Plan of a row [s]", "An instant [ms]", "Memory [MB]")
    return _table(
        (*headings, "Plan of a chain [s]", "An instant [ms]", "Memory [MB]"),
        [
            (str(row["n"]), *_plan(row), *_plan(chain))
            for row, chain in zip(data["four_bars"], data["chains"], strict=True)
        ],
    )


def _plan(row: dict[str, Any]) -> tuple[str, str, str]:
    return _seconds(row["plan"]), f"{1e3 * row['instant']:.2g}", f"{row['megabytes']:.0f}"


def _step(row: dict[str, Any]) -> tuple[str, str]:
    return f"{1e3 * row['step']:.2g}", "" if row["ratio"] is None else f"{row['ratio']:.1f} x"


def singular_passages(data: dict[str, Any]) -> str:
    """Runs through singular positions by kernels of all processors: how many fail, errors over the tolerance."""
    numbers = ("median", "p90", "most")
    return _table(
        ("Method", "Runs", "Failed", "Median", "Nine in ten below", "Largest"),
        [
            (f"`{row['method']}`", str(row["runs"]), str(row["failed"]), *(f"{row[name]:.2g}" for name in numbers))
            for row in data["rows"]
            if row["target"] == "all"
        ],
    )


def _seconds(time: float) -> str:
    return f"{time:.2g}"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:#.3g}".rstrip(".")


def _percent(part: float) -> str:
    digits = 2 if abs(part) < 0.0095 else 1 if abs(part) < 0.095 else 0
    # Adding zero takes the sign from a zero.
    return f"{round(100.0 * part, digits) + 0.0:+.{digits}f} %"


def _table(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [headings, tuple("---" for _ in headings), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)


# Files of times; the others hold lengths, which do not depend on the machine.
TIMED = ("peers", "batch", "startup", "history", "method_times", "default_method", "real_time", "scaling", "plans")
# Files with runs by other engines.
ENGINES = ("peers", "batch", "paths_and_modes", "model_agreement", "library_agreement")
# What a page may ask for: the file of the measurements, and what makes the table of it.
TABLES: dict[str, tuple[str, Callable[[dict[str, Any]], str]]] = {
    "peers": ("peers", peers),
    "batch": ("batch", batch),
    "startup": ("startup", startup),
    "history": ("history", history),
    "paths_and_modes": ("paths_and_modes", paths_and_modes),
    "table_3": ("paths_and_modes", table_3),
    "model_agreement": ("model_agreement", model_agreement),
    "library_agreement": ("library_agreement", library_agreement),
    "model_convergence": ("model_agreement", model_convergence),
    "method_times": ("method_times", method_times),
    "agreement": ("agreement", agreement),
    "orders": ("orders", orders),
    "default_method": ("default_method", default_method),
    "convergence": ("convergence", convergence),
    "real_time": ("real_time", real_time),
    "scaling": ("scaling", scaling),
    "plans": ("plans", plans),
    "singular_passages": ("singular_passages", singular_passages),
}
