"""What the commands print."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    # With what they import they take as long as all of `paraflex info`.
    from paraflex.simulate import TrackingTask
    from paraflex.studies import StudyResult

# How a run ends that did what was asked.
FINISHED = ("complete", "stopped")


def plain_console(*, stderr: bool = False) -> Console:
    """A console that leaves square brackets alone: here they hold units."""
    return Console(highlight=False, markup=False, stderr=stderr)


def study_table(figures: dict[str, Any], task: TrackingTask, model: str) -> Table:
    """Tracking error and peak torques of every mode in a model, and what the solver did."""
    motors = [motor.name for motor in task.mechanism.motors]
    heads = [f"{name}\n[{unit}]" for name, unit in zip(motors, task.mechanism.motor_units(), strict=True)]
    efforts = "forces" if set(task.mechanism.motor_units()) == {"N"} else "torques"
    table = Table(
        title=f"{figures['mechanism']}, {model}: tracking error and peak {efforts}",
        title_justify="left",
        box=box.SIMPLE,
        collapse_padding=True,
        pad_edge=False,
    )
    table.add_column("mode", no_wrap=True)
    for heading in ("error\n[m]", *heads, "vibration\n[m]", "steps\n", "wall\n[s]"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, mode in figures["modes"].items():
        if "steps" not in mode:
            table.add_row(name, "failed", *["" for _ in motors], "", "", "")
            continue
        table.add_row(
            name,
            number(mode["tracking_rms"], ".4e") if mode["status"] == "complete" else mode["status"],
            *(number(mode["peak_torque"][motor], ".2f") for motor in motors),
            number(mode["residual_vibration"], ".2e"),
            str(mode["steps"]),
            number(mode["wall_time"], ".2f"),
        )
    return table


def events(console: Console, figures: dict[str, Any]) -> None:
    """One line for each mode that an event stopped."""
    for name, mode in figures["modes"].items():
        if mode["status"] == "stopped":
            console.print(f'mode "{name}": {mode["message"]}', soft_wrap=True)


def validity(console: Console, figures: dict[str, Any]) -> None:
    """Whether the model holds: of the worst mode, and which others are beyond."""
    from paraflex.results.validity import validity_lines  # with xarray, which descriptions of mechanisms do without

    for line in validity_lines({name: mode.get("validity") for name, mode in figures["modes"].items()}):
        console.print(line, soft_wrap=True)


def failures(console: Console, result: StudyResult) -> None:
    """One line for each mode that did not run to its end."""
    for reason in result.failed.values():
        console.print(f"error: {reason}", soft_wrap=True)
    if result.data is not None:
        for mode in result.data["mode"].values:
            run = result.data.sel(mode=mode)
            if run["status"].item() not in FINISHED:
                console.print(f'error: mode "{mode}": {run["message"].item()}', soft_wrap=True)


def number(value: float | None, form: str) -> str:
    """A number in a form; nothing for None."""
    return "" if value is None else format(value, form)
