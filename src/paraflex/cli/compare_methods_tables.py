"""Tables that `paraflex compare-methods` prints."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.integrators.methods import DEFAULT_METHOD, title_of

_KEPT = {
    "gap\n[m]": "constraint_position_max",
    "its rate\n[m/s]": "constraint_velocity_max",
    "energy\n[J]": "energy_balance_max",
}
_COUNTS = {
    "steps\n": "steps",
    "rejected\n": "rejected",
    "Newton\niter.": "newton_iterations",
    "factor-\nings": "factorisations",
    "evalu-\nations": "evaluations",
}
_SETTING = "tol. [m],\nstep [s]"


def print_comparison(console: Console, summary: dict[str, Any]) -> None:
    """Print errors and work of every run, time of every method to reach an error, failures, and the fastest method."""
    reference = summary["reference"]
    if reference is None:
        return
    console.print(
        f"{summary['mechanism']}, {summary['case']}, {summary['duration']:g} s. Errors are distances from "
        f"{reference['method']} at {reference['tolerance']:g} m, known to {reference['uncertainty']:.0e} m "
        f"(the distance of {reference['check_method']} at {reference['check_tolerance']:g} m).",
        soft_wrap=True,
    )
    done = {
        name: [run for run in method["runs"] if run["status"] == "complete"]
        for name, method in summary["methods"].items()
    }
    if any(done.values()):
        _print_tables(console, summary, [(name, run) for name, runs in done.items() for run in runs])
    _print_reasons(console, summary["methods"])
    fastest = [f"{level} m {name}" for level, name in summary["fastest"].items() if name is not None]
    if fastest:
        console.print(f"Fastest: {', '.join(fastest)}", soft_wrap=True)


def _print_tables(console: Console, summary: dict[str, Any], done: list[tuple[str, dict[str, Any]]]) -> None:
    """Print the tables of the complete runs, each of which comes with the name of its method."""
    uncertainty = summary["reference"]["uncertainty"]
    precision = (
        [
            name,
            _setting(run),
            f"{run['error']:.1e}" if run["error"] > uncertainty else f"<{uncertainty:.0e}",
            f"{run['wall_time']:.3g}",
            *(number(run[key], ".1e") for key in _KEPT.values()),
        ]
        for name, run in done
    )
    table = plain_table("method", numbers=(_SETTING, "error\n[m]", "wall\n[s]", *_KEPT), rows=precision)
    print_titled(console, "Error, time, violation of constraints, imbalance of energy", table)
    work = ([name, _setting(run), *(str(run[key]) for key in _COUNTS.values())] for name, run in done)
    print_titled(console, "Work", plain_table("method", numbers=(_SETTING, *_COUNTS), rows=work))
    levels, methods = list(summary["fastest"]), {name: summary["methods"][name] for name, _ in done}
    times = (
        [name, *(number(one["time_to_reach"][level], ".3g") for level in levels), number(one["relative_time"], ".2f")]
        for name, one in methods.items()
    )
    relative = f"x {title_of(DEFAULT_METHOD)}"
    table = plain_table("method", numbers=(*(f"{level} m" for level in levels), relative), rows=times)
    print_titled(console, "Wall time to an error [s]; the last column at 1e-5 m", table)


def _print_reasons(console: Console, methods: dict[str, Any]) -> None:
    for name, method in methods.items():
        for run in method["runs"]:
            where = f" at {_setting(run)}" if _setting(run) else ""
            if run["status"] != "complete":
                console.print(f"{name}{where}: {run['status']}, {run['reason']}", soft_wrap=True)
            for text in run["warnings"]:
                console.print(f"{name}{where}: warning: {text}", soft_wrap=True)


def _setting(run: dict[str, Any]) -> str:
    if run["step"] is not None:
        return f"{run['step']:g} s"
    return "" if run["tolerance"] is None else f"{run['tolerance']:g}"
