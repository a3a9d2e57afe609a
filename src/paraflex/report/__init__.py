"""Reports: one HTML file with tables, interactive charts and the mechanism in motion."""

from paraflex.report.film import Animation, animation
from paraflex.report.motion import motion_page
from paraflex.report.page import Chart, Curve, Look, Page, Panel, render, save_page
from paraflex.report.tracking import tracking_page
from paraflex.report.verification import verification_page

__all__ = [
    "Animation",
    "Chart",
    "Curve",
    "Look",
    "Page",
    "Panel",
    "animation",
    "motion_page",
    "render",
    "save_page",
    "tracking_page",
    "verification_page",
]
