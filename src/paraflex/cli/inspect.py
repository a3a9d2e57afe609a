"""`paraflex info` and `paraflex modes`: what a mechanism is, and what its motors can do."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from rich.table import Table

from paraflex.actuation import actuation_condition
from paraflex.actuation.allocation import check_mode
from paraflex.cli.tables import plain_console
from paraflex.dynamics import build_system, consistent_state, redundant_rows
from paraflex.errors import ActuationError, NumericalError
from paraflex.files import generator_names, library_names, load
from paraflex.simulate import plan_tracking

_FREQUENCIES_SHOWN = 3


def info_command(source: str, as_json: bool) -> None:
    """Describe a mechanism."""
    facts = describe(source)
    if as_json:
        print(json.dumps(facts, indent=2))
        return
    console = plain_console()
    console.print(f"{facts['name']} ({facts['source']})")
    if facts["description"]:
        console.print(facts["description"])
    table = Table(show_header=False, box=None)
    for label, key in (
        ("bodies", "bodies"),
        ("joints", "joints"),
        ("motors", "motors"),
        ("coordinates", "coordinates"),
        ("  rigid", "rigid_coordinates"),
        ("  flexible", "flexible_coordinates"),
        ("constraints", "constraints"),
        ("redundant constraints", "redundant_constraints"),
        ("degrees of freedom (rigid)", "degrees_of_freedom"),
        ("total mass [kg]", "total_mass"),
        ("assemblies", "assemblies"),
        ("modes", "modes"),
        ("paths", "paths"),
    ):
        value = facts[key]
        text = ", ".join(map(str, value)) if isinstance(value, list) else f"{value:g}"
        table.add_row(label, text or "none")
    console.print(table)
    links = Table(title="bodies, each held in its own frame", title_justify="left")
    for heading in ("body", "kind", "length [m]", "mass [kg]", "elements", "coord.", "f1, f2, f3 [Hz]"):
        links.add_column(heading, justify="left" if heading in ("body", "kind") else "right")
    for link in facts["links"]:
        lowest = ", ".join(f"{f:.1f}" for f in link["frequencies_hz"][:_FREQUENCIES_SHOWN])
        length = "" if link["length"] is None else f"{link['length']:g}"
        elements = "" if link["elements"] is None else str(link["elements"])
        links.add_row(
            link["name"], link["kind"], length, f"{link['mass']:.4f}", elements, str(link["coordinates"]), lowest
        )
    console.print(links)
    console.print(f"library: {', '.join([*library_names(), *generator_names()])}; paraflex new NAME --from one of them")


def describe(source: str) -> dict[str, Any]:
    """The facts `paraflex info` prints."""
    model = load(source)
    mechanism = model.mechanism
    system = build_system(mechanism)
    links = []
    for body, coordinates in zip(mechanism.bodies, system.bodies, strict=True):
        links.append(
            {
                "name": body.name,
                "kind": "flexible" if getattr(body, "flexible", False) else "rigid",
                "length": getattr(body, "length", None),
                "mass": float(coordinates.integrals.m),
                "elements": coordinates.mesh.n_elements if coordinates.mesh else None,
                "coordinates": 3 + coordinates.nf,
                "frequencies_hz": [float(w) / (2.0 * np.pi) for w in coordinates.modes.omega],
            }
        )
    rigid = build_system(mechanism.rigid())
    redundant, closed = [], None
    if mechanism.assemblies:
        try:
            redundant = redundant_rows(rigid, consistent_state(rigid, mechanism.assembly()).q)
            closed = True
        except NumericalError as error:
            closed = str(error)
    return {
        "name": mechanism.name,
        "source": model.source,
        "description": mechanism.description,
        "bodies": len(mechanism.bodies),
        "joints": len(mechanism.joints),
        "motors": [motor.name for motor in mechanism.motors],
        "coordinates": system.n,
        "rigid_coordinates": rigid.n,
        "flexible_coordinates": system.n_flexible,
        "constraints": system.n_constraints,
        "redundant_constraints": redundant,
        "degrees_of_freedom": rigid.n - rigid.n_constraints + len(redundant),
        "assembly_closes": closed,
        "total_mass": system.total_mass,
        "assemblies": [assembly.name for assembly in mechanism.assemblies],
        "modes": [mode.name for mode in mechanism.modes],
        "paths": list(model.paths),
        "links": links,
    }


def modes_command(source: str, path: str | None, as_json: bool) -> None:
    """List the actuation modes with the condition of their actuation matrix along a path."""
    model = load(source)
    rows = []
    effort = None
    if model.mechanism.end_effector is not None and (path is not None or model.paths):
        effort = plan_tracking(
            model.mechanism.rigid(), model.path(path), samples=201, orientation=model.study.orientation
        ).effort
    for mode in model.mechanism.modes:
        row: dict[str, Any] = {"mode": mode.name, "motors": list(mode.motors)}
        if effort is not None:
            row["redundancy"] = len(mode.motors) - effort.required.shape[1]
            row["condition_max"] = float(np.max(actuation_condition(effort, mode)))
            try:
                check_mode(effort, mode)
                row["drives_path"] = True
            except ActuationError as error:
                row["drives_path"], row["reason"] = False, str(error)
        rows.append(row)
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    table = Table(title=f"{model.mechanism.name}: actuation modes", title_justify="left")
    for heading in ("mode", "active motors", "redundancy", "worst condition number", "drives the path"):
        table.add_column(heading)
    for row in rows:
        drives = {True: "yes", False: row.get("reason", "no"), None: ""}[row.get("drives_path")]
        condition = f"{row['condition_max']:.3g}" if "condition_max" in row else ""
        table.add_row(row["mode"], ", ".join(row["motors"]), str(row.get("redundancy", "")), condition, drives)
    plain_console().print(table)
