"""The picture of the README: RAParM-I in mode +-+- with rigid links, flexible links, and the paper's linear beams.

python docs/make_hero.py
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import paraflex as pf
from paraflex.plots.film import FilmOptions, animate
from paraflex.results.record import record

HERO = Path(__file__).parent / "images" / "hero.png"
MODE = "+-+-"


def main() -> None:
    """Run the mode with each model of the links and draw the ends of the motions along the path."""
    robot = pf.load("raparm_i")
    linear = robot.mechanism
    beams = linear.with_beams(reference="pinned", curvature="separate").with_geometry("second-order")
    models = {"rigid links": linear.rigid(), "flexible links": beams, "the paper's linear beams": linear}
    task = pf.plan(linear, robot.path("square"), duration=0.7)
    options = pf.IntegrationOptions(method="esdirk5", tolerance=1e-4)
    runs = [
        dataclasses.replace(
            record(task.remodelled(model).simulate(MODE, options=options, warning=False)), mode=f"{MODE}, {name}"
        )
        for name, model in models.items()
    ]
    modes = [run.mode for run in runs]
    animate(pf.tracking_dataset(runs), HERO, modes, FilmOptions(magnify=1.0, size=(1500, 480), at=0.7))


if __name__ == "__main__":
    main()
