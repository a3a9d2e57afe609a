"""What `paraflex verify` prints of one mode."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from paraflex.cli.tables import number, plain_table
from paraflex.results.following import SPAN_WORDS, ErrorSpan

# Names that fit above a column.
_SHORT = {
    "rigid": "rigid",
    "ked": "KED",
    "linear": "linear",
    "second-order": "2nd-ord.",
    "segments": "segments",
    "exudyn": "Exudyn",
    "mujoco": "MuJoCo",
}
_SOUND = {
    "finer step\n[m]": "change_with_finer_step",
    "finer mesh\n[m]": "change_with_finer_mesh",
    "energy\n[J]": "energy_balance_max",
    "constraints\n[m]": "constraint_position_max",
    "[m/s]": "constraint_velocity_max",
}
_LINKS = {"angle": "angle [rad]", "angular_velocity": "angular velocity [rad/s]"}


def print_agreement(console: Console, figures: dict[str, Any], mode: str) -> None:
    """How the models of a mode agree, the evidence that each is converged, and the differences of every link."""
    models, distances = figures["modes"][mode]["models"], figures["modes"][mode]["distances"]
    finished = {name: values for name, values in models.items() if "tracking_error" in values}
    reference = figures["reference"]
    compared = {name: values for name, values in finished.items() if "distance_max" in values and name != reference}

    def show(title: str, table: Table) -> None:
        # Not the table's own title: that is broken at the table's width.
        console.print(title, soft_wrap=True)
        console.print(table)

    where = f"{figures['mechanism']}, mode {mode}"
    span = SPAN_WORDS[ErrorSpan(figures["error"])]
    show(
        f"{where}: tracking error {span}, and distance from the path of {_SHORT[reference]}", _errors(models, reference)
    )
    show("Largest distance between the paths of two models [m]", _distances(finished, distances))
    show(
        "Change of the path with a finer step and mesh, imbalance of energy, constraint violation", _soundness(finished)
    )
    for key, what in _LINKS.items() if compared else ():
        show(f"RMS difference of each link's {what} from {_SHORT[reference]}", _links(figures["links"], compared, key))


def _errors(models: dict[str, Any], reference: str) -> Table:
    table = plain_table("model", numbers=("error\n[m]", "largest\n[m]", "RMS\n[m]", "wall\n[s]"))
    for name, values in models.items():
        if "tracking_error" not in values:
            table.add_row(_SHORT[name], "failed")
            continue
        table.add_row(
            _SHORT[name],
            number(values["tracking_error"], ".4e"),
            *("" if name == reference else number(values.get(f"distance_{kind}"), ".1e") for kind in ("max", "rms")),
            number(values["wall_time"], ".2f"),
        )
    return table


def _distances(finished: dict[str, Any], distances: dict[str, Any]) -> Table:
    table = plain_table("", numbers=(_SHORT[name] for name in finished))
    for name in finished:
        table.add_row(
            _SHORT[name], *("" if other == name else number(distances[name][other], ".1e") for other in finished)
        )
    return table


def _soundness(finished: dict[str, Any]) -> Table:
    table = plain_table("model", numbers=_SOUND)
    for name, values in finished.items():
        table.add_row(_SHORT[name], *(number(values[key], ".1e") for key in _SOUND.values()))
    return table


def _links(links: list[str], compared: dict[str, Any], key: str) -> Table:
    table = plain_table("link", numbers=(_SHORT[name] for name in compared))
    for link in links:
        table.add_row(link, *(number(values[f"{key}_difference_rms"][link], ".1e") for values in compared.values()))
    return table
