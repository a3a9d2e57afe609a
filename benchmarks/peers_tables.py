"""What `peers.py` prints and what the README shows of it: second order beside exact beams, then linear beams."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from common import table

# A result of `peers.py`: its name, setting, deviation [m] and times [s].
Row = dict[str, Any]
ENGINES = ("Exudyn", "MuJoCo")


def is_linear(name: str) -> bool:
    """Whether a result is of linear beams, which are not what other engines compute."""
    return ", linear" in name


def leads(results: Sequence[Row]) -> dict[str, Any]:
    """How many times as long as ours the best of every other engine takes: like with like, and beside linear beams."""
    times = {result["name"]: result["seconds"] for result in results}
    ours = {name: seconds for name, seconds in times.items() if name.startswith("paraflex")}
    out: dict[str, Any] = {}
    for engine in ENGINES:
        theirs = [seconds for name, seconds in times.items() if name.startswith(engine)]
        if theirs and ours:
            ratios = {name: min(theirs) / seconds for name, seconds in ours.items()}
            like = {name: ratio for name, ratio in ratios.items() if not is_linear(name)}
            linear = {name: ratio for name, ratio in ratios.items() if is_linear(name)}
            out[engine] = {"seconds": min(theirs), "like": like, "linear": linear}
    return out


def print_results(results: Sequence[Row]) -> None:
    """The table, like with like first."""
    ordered = sorted(results, key=lambda result: (is_linear(result["name"]), result["seconds"]))
    first = ordered[0]["seconds"]
    rows = [
        [r["name"], r["setting"], f"{r['deviation']:.1e}", f"{r['seconds']:.3f}", f"{r['without_python']:.3f}",
         f"{r['fastest']:.3f}-{r['slowest']:.3f}", f"{r['setup']:.3f}", f"{r['seconds'] / first:.1f}"]
        for r in ordered
    ]  # fmt: skip
    print(table(["", "setting", "off by [m]", "time [s]", "less Python", "from-to", "set-up", "ratio"], rows))


def readme_table(results: Sequence[Row], duration: float) -> str:
    """What the README shows: the best of every engine, second order first, and by what factor others take longer."""
    times = {result["name"]: result["seconds"] for result in results}

    def best(*parts: str, fixed: bool) -> float:
        """Least time of results whose names have these parts, with fixed steps or with error control [s]."""
        of_kind = [
            seconds
            for name, seconds in times.items()
            if all(re.search(part, name) for part in parts) and ("fixed steps" in name) == fixed
        ]
        return min(of_kind, default=math.nan)

    like = [best("paraflex", "second.order", fixed=fixed) for fixed in (True, False)]
    linear = [best("paraflex", "linear", fixed=fixed) for fixed in (True, False)]
    few = [best("paraflex", "few coordinates", fixed=fixed) for fixed in (True, False)]
    chosen = min((result["setup"] for result in results if "few coordinates" in result["name"]), default=math.nan)
    engines = {
        title: min(seconds for name, seconds in times.items() if name.startswith(engine))
        for engine, title in zip(
            ENGINES, ("Exudyn, exact beams (ANCF cables)", "MuJoCo, 56 rigid segments"), strict=True
        )
    }

    def pair(values: Sequence[float], form: str) -> str:
        return " / ".join(form.format(value) for value in values)

    def ratios(seconds: float, ours: Sequence[float]) -> str:
        return f"{pair([seconds / one for one in ours], '{:.0f}')} times as long"

    rows = [
        ("paraflex, second order: fixed steps / error control", pair(like, "{:.3f} s"), "", ""),
        (f"the same, few coordinates, chosen in {chosen:.2f} s before", pair(few, "{:.3f} s"), "", ""),
        *(
            (name, f"{seconds:.3f} s", ratios(seconds, like), ratios(seconds, linear))
            for name, seconds in engines.items()
        ),
        ("paraflex, the paper's linear beams: fixed steps / error control", pair(linear, "{:.3f} s"), "", ""),
    ]
    real = pair([duration / seconds for seconds in like], "{:.1f}")
    lines = [
        "| | Time | Beside second order | Beside the linear beams |",
        "|---|---:|---:|---:|",
        *(f"| {' | '.join(cells)} |" for cells in rows),
        "",
        f"Second order is {real} times as fast as real time.",
    ]
    return "\n".join(lines)
