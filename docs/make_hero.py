"""The picture of the README: RAParM-I on its square in three modes, second-order geometry in the pinned frame.

python docs/make_hero.py
"""

from __future__ import annotations

from pathlib import Path

import paraflex as pf
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import Curvature
from paraflex.plots.film import FilmOptions, animate

HERO = Path(__file__).parent / "images" / "hero.png"
MODES = ("+-+-", "-+-+", "++++")


def main() -> None:
    """Run the three modes and draw them."""
    robot = pf.load("raparm_i")
    task = pf.plan(robot.mechanism, robot.path("square"), duration=0.7)
    beams = robot.mechanism.with_beams(reference=ReferenceCondition.PINNED, curvature=Curvature.SEPARATE)
    second_order = task.remodelled(beams.with_geometry("second-order"))
    options = pf.IntegrationOptions(method="esdirk5", tolerance=1e-4)
    data = pf.tracking_dataset([second_order.simulate(mode, options=options) for mode in MODES])
    animate(data, HERO, MODES, FilmOptions(magnify=20.0, size=(1500, 500), at=0.46))


if __name__ == "__main__":
    main()
