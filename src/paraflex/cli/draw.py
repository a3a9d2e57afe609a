"""`paraflex draw`: a drawing of a mechanism, before anything runs."""

from __future__ import annotations

import os
import sys
import tempfile
import webbrowser
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from paraflex.checks.drawing import pose_of
from paraflex.equilibria.conditions import StaticsDefaults
from paraflex.errors import InputError, listed
from paraflex.files import Model
from paraflex.mechanism import Mechanism
from paraflex.mechanism.masses import with_any_masses
from paraflex.plots.themes import theme
from paraflex.results.acting import drive_speed
from paraflex.writing import portable_name, whole_file
from .commands.models import DrawRequest
from .commands.requests import flagged
from .replacing import refuse_existing
from .request import conflict, requested_model
from .signals import end_by_ctrl_c, exit_code
from .tables import PlainConsole, framed_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from paraflex.results.posed import Posed

FORMATS = (".html", ".svg", ".png", ".pdf")
# Directions of a joint's coordinate that grows, and of one that falls.
_SLIDING, _TURNING = ("along its axis", "against its axis"), ("anticlockwise", "clockwise")
# Resolution of PNG [dots per inch], and largest number of rows of a table.
_DPI, _LISTED = 200.0, 12
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{name}</title>
<style>body {{ font: 15px sans-serif; margin: 1.5em auto; max-width: 1100px; padding: 0 1em }}
svg {{ width: 100%; height: auto; max-height: 92vh }} p.open {{ color: #c8102e }}</style>
{problems}
{svg}
</html>
"""


def draw_command(request: DrawRequest) -> int | None:
    """Draw the mechanism and print the name of the file, or watch its file; return the exit code of watching."""
    if request.watch:
        return _watch(request)
    output = None if request.output is None else Path(request.output)
    if output is not None:
        if output.suffix.lower() not in FORMATS:
            remedy = "end it in .html, .svg, .png or .pdf"
            raise InputError("unknown kind of drawing", field="--output", value=request.output, remedy=remedy)
        refuse_existing(output, request.force)
    model = requested_model(request.model)
    with flagged(request):
        theme(request.theme)
        shown = pose_of(model, assembly=request.assembly, path=request.path)
    if output is None:
        output = Path(tempfile.mkdtemp(prefix="paraflex-")) / f"{portable_name(model.mechanism.name)}.html"
    # Matplotlib takes longer to import than everything up to here, so it is imported only now.
    from paraflex.plots.model_drawing import model_drawing

    _write(model_drawing(shown, theme_name=request.theme), shown, output)
    _print_result(PlainConsole(), model, shown, request, output)
    _open(output.resolve().as_uri(), request)
    return None


def _watch(request: DrawRequest) -> int:
    """Draw the mechanism again whenever its file is saved, until a signal ends it; return the exit code."""
    if request.output is not None:
        raise conflict("has no effect with --watch, whose drawing is a page", "--output", request.output)
    with flagged(request):
        theme(request.theme)
    if not Path(request.model.name).exists():
        requested_model(request.model)
    from .watch import WatchServer

    end_by_ctrl_c()
    with WatchServer(request) as server:
        name = request.model.name
        try:
            PlainConsole().print_lines(f"{name} is drawn at {server.address} when it is saved; Ctrl-C ends this")
            _open(server.address, request)
            server.serve_forever()
        except KeyboardInterrupt:
            PlainConsole().print_lines(f"{name} is no longer watched")
    return exit_code()


def _open(address: str, request: DrawRequest) -> None:
    opens = (request.output is None and _has_screen()) if request.open is None else request.open
    if opens and not webbrowser.open(address):
        PlainConsole(stderr=True).print_lines("no browser opens it here")


def _write(figure: Figure, shown: Posed, output: Path) -> None:
    kind = output.suffix.lower()
    from paraflex.plots.style import figure_svg, write_figure

    with whole_file(output, field=str(output.parent)) as unfinished:
        if kind == ".html":
            problems = "".join(f'<p class="open">{escape(problem)}</p>' for problem in shown.problems)
            name = escape(shown.mechanism.name)
            page = _PAGE.format(name=name, problems=problems, svg=figure_svg(figure))
            unfinished.write_text(page, encoding="utf-8")
        else:
            write_figure(figure, unfinished, kind[1:], _DPI)


def _has_screen() -> bool:
    """Return whether stdout is a terminal and a graphical display is available."""
    screen = sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return screen and sys.stdout.isatty()


def _print_result(console: PlainConsole, model: Model, shown: Posed, request: DrawRequest, output: Path) -> None:
    """Print joints, bodies, drives, loads, sensors, open joints, the name of the drawing and the next commands."""
    mechanism = model.mechanism
    console.print_lines(f"{mechanism.name} ({model.source})")
    console.print(_joints(mechanism, shown))
    console.print_lines(f"bodies: {listed([body.name for body in mechanism.bodies], _LISTED)}")
    console.print_lines(*_drives(mechanism, shown))
    for one in shown.acting[:_LISTED]:
        console.print_lines(f"load {one.load.name}: {one.load.kind} at {one.load.point}, {one.size}")
    if mechanism.sensors:
        sensors = [f"{one.name} ({one.kind})" for one in mechanism.sensors]
        console.print_lines(f"sensors: {listed(sensors, _LISTED)}")
    console.print_lines(*(f"warning: {problem}" for problem in shown.problems))
    if shown.gaps:
        gaps = ", ".join(f"{name} by {gap}" for name, gap in shown.gaps.items())
        console.print_lines(f"drawn as given, with open joints: {gaps}")
    name = request.model.name
    then = "run" if model.statics == StaticsDefaults() else "statics"
    # Without masses only kinematics is possible.
    massless = with_any_masses(mechanism) is not mechanism
    more = f"paraflex kinematics {name}" if massless else f"paraflex info {name}, paraflex {then} {name}"
    console.print_lines(f"drawn in {output}", f"next: {more}")


def _drives(mechanism: Mechanism, shown: Posed) -> list[str]:
    """Return a line for each prescribed motion: its initial direction and its speed."""
    lines = []
    for drive in mechanism.prescribed[:_LISTED]:
        joint = mechanism.joint(drive.joint)
        sign = shown.moves.get(drive.joint, 0)
        if not sign:
            lines.append(f"prescribed {drive.name}: {drive.joint} is held")
            continue
        forwards, backwards = _SLIDING if joint.slides else _TURNING
        way = forwards if sign > 0 else backwards
        speed = drive_speed(drive, joint.slides, shown.duration)
        lines.append(f"prescribed {drive.name}: {joint.b.body} at {drive.joint} {way}, {speed}")
    return lines


def _joints(mechanism: Mechanism, shown: Posed) -> Table:
    # Columns without entries are left out.
    columns = {
        "motor": {motor.joint: motor.name for motor in mechanism.motors},
        "prescribed": {drive.joint: drive.name for drive in mechanism.prescribed},
        "open by": dict(shown.gaps),
    }
    columns = {heading: of_joints for heading, of_joints in columns.items() if of_joints}
    table = framed_table("joints", ("joint", "kind", "between", *columns))
    for joint in mechanism.joints[:_LISTED]:
        more = [of_joints.get(joint.name, "") for of_joints in columns.values()]
        table.add_row(joint.name, joint.kind, f"{joint.a}, {joint.b}", *more)
    if len(mechanism.joints) > _LISTED:
        table.add_row(f"and {len(mechanism.joints) - _LISTED} more")
    return table
