"""Reports of results: one HTML file with tables, interactive charts and an animation of the mechanism."""

from paraflex.figures.charts import Chart as Chart, Curve as Curve, Look as Look, Panel as Panel
from .film import Animation as Animation, animation as animation
from .linear import linear_page as linear_page
from .motion import motion_page as motion_page
from .page import Page as Page, render as render, save_page as save_page
from .reduction import reduction_page as reduction_page
from .statics import statics_page as statics_page
from .tracking import tracking_page as tracking_page
from .verification import verification_page as verification_page
