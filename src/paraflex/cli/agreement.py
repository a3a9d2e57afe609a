"""Tables that `paraflex verify` prints for one mode."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.results.following import SPAN_WORDS, ErrorSpan

# Names short enough for a column head, of models that are not shown under their own names.
_SHORT = {"ked": "KED", "second-order": "2nd-ord.", "exudyn": "Exudyn", "mujoco": "MuJoCo"}
_ERRORS = ("error\n[m]", "largest\n[m]", "RMS\n[m]", "wall\n[s]")
_SOUND = {
    "finer step\n[m]": "change_with_finer_step",
    "finer mesh\n[m]": "change_with_finer_mesh",
    "energy\n[J]": "energy_balance_max",
    "constraints\n[m]": "constraint_position_max",
    "[m/s]": "constraint_velocity_max",
}
_LINKS = {"angle": "angle [rad]", "angular_velocity": "angular velocity [rad/s]"}


def print_agreement(console: Console, summary: dict[str, Any], mode: str) -> None:
    """Print how the models of a mode agree, the evidence that each is converged, and the differences of every link."""
    models, distances = summary["modes"][mode]["models"], summary["modes"][mode]["distances"]
    finished = {name: values for name, values in models.items() if "tracking_error" in values}
    reference = summary["reference"]
    compared = {name: values for name, values in finished.items() if "distance_max" in values and name != reference}

    short = [_short(name) for name in finished]
    where = f"{summary['mechanism']}, mode {mode}"
    span = SPAN_WORDS[ErrorSpan(summary["error"])]
    print_titled(
        console,
        f"{where}: tracking error {span}, and distance from the path of {_short(reference)}",
        plain_table("model", numbers=_ERRORS, rows=(_errors(name, one, reference) for name, one in models.items())),
    )
    apart = (
        [_short(a), *("" if a == b else number(distances[a][b], ".1e") for b in finished)] for a in finished
    )  # fmt: skip
    table = plain_table("", numbers=short, rows=apart)
    print_titled(console, "Largest distance between the paths of two models [m]", table)
    sound = ([_short(name), *(number(one[key], ".1e") for key in _SOUND.values())] for name, one in finished.items())
    title = "Change of the path with a finer step and mesh, imbalance of energy, constraint violation"
    print_titled(console, title, plain_table("model", numbers=_SOUND, rows=sound))
    for key, what in _LINKS.items() if compared else ():
        of_links = [one[f"{key}_difference_rms"] for one in compared.values()]
        rows = ([link, *(number(each[link], ".1e") for each in of_links)] for link in summary["links"])
        table = plain_table("link", numbers=(_short(name) for name in compared), rows=rows)
        print_titled(console, f"RMS difference of each link's {what} from {_short(reference)}", table)


def _errors(name: str, values: dict[str, Any], reference: str) -> list[str]:
    if "tracking_error" not in values:
        return [_short(name), "failed"]
    far = ("" if name == reference else number(values.get(f"distance_{kind}"), ".1e") for kind in ("max", "rms"))
    return [_short(name), number(values["tracking_error"], ".4e"), *far, number(values["wall_time"], ".2f")]


def _short(name: str) -> str:
    return _SHORT.get(name, name)
