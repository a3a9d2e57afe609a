"""Reports of results: one HTML file with tables, interactive charts and an animation of the mechanism."""

from paraflex.figures.charts import Chart as Chart, Curve as Curve, Look as Look, Panel as Panel
from paraflex.report.film import Animation as Animation, animation as animation
from paraflex.report.linear import linear_page as linear_page
from paraflex.report.motion import motion_page as motion_page
from paraflex.report.page import Page as Page, render as render, save_page as save_page
from paraflex.report.reduction import reduction_page as reduction_page
from paraflex.report.statics import statics_page as statics_page
from paraflex.report.tracking import tracking_page as tracking_page
from paraflex.report.verification import verification_page as verification_page
