"""Charts of a run without a path: angles, speeds and energies, generalised coordinates."""

from collections.abc import Iterator
from dataclasses import replace

import xarray as xr

from paraflex.formatting import ROUNDING, peak, text_symbol
from .charts import Axis, Chart, Curve, look
from .entry import figure
from .run_motion import ANGLE, ANGLES, RATES, energy_chart
from .runs import followed, ranges, stopped_runs
from .selection import names_of

# Axes of coordinates by the last part of their names.
_KINDS = {
    "x": Axis("displacement", "m", "x"),
    "y": Axis("displacement", "m", "y"),
    "phi": ANGLE,
    "eta": Axis("modal coordinate", "m √kg", "η"),
}


@figure("angles, speeds and energies", written_as="motion_overview", height=40.0)
def motion_overview(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the angles and angular velocities of the bodies, and of the energies."""
    yield followed(ANGLES, data, data["angle"])
    yield followed(RATES, data, data["angular_velocity"])
    yield energy_chart(data)


@figure("generalised coordinates, including modal coordinates of bodies", heading="Coordinates", panels="choices",
        variables=("coordinate_value",), height=34.0)  # fmt: skip
def coordinates(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the generalised coordinates that change: of one kind at a time.

    They are positions and angles of body frames, and flexible coordinates.
    """
    names, bodies = names_of(data, "coordinate"), names_of(data, "body")
    values = data["coordinate_value"].transpose("mode", "time", "coordinate").values
    travel = ranges(values[0])
    kinds = [name.rpartition(".")[2].rstrip("0123456789") for name in names]
    groups = {kind: [k for k, one in enumerate(kinds) if one == kind and travel[k] > ROUNDING] for kind in _KINDS}
    groups = {kind: members for kind, members in groups.items() if members} or {"phi": list(range(len(names)))[:1]}
    curves, stopped = [], stopped_runs(data)[0]
    for choice, (kind, members) in enumerate(groups.items()):
        for place, k in enumerate(members):
            body, _, own = names[k].rpartition(".")
            # A body has the same look in all charts of its frame's coordinates.
            label, style = text_symbol(body), look(bodies.index(body))
            if kind == "eta":
                label, style = f"{label}: {text_symbol(own)}", look(place)
            curves.append(Curve(label, values[0, :, k], look=style, run=0, choice=choice, stopped=stopped))
    yield Chart(
        "coordinates", "Generalised coordinates",
        [replace(_KINDS[kind], extent=peak(values[..., own])) for kind, own in groups.items()],
        curves, choices=[text_symbol(kind) for kind in groups], choosing="coordinate",
        note="Coordinates that do not change are left out. Flexible coordinates are those of mass-normalised modes.",
    )  # fmt: skip
