"""Paths of the end-effector, and the joint motion that follows them."""

from paraflex.kinematics.closure import RigidMotion, follow_path, path_follower, reach_shortfall
from paraflex.kinematics.laws import TrapezoidalLaw
from paraflex.kinematics.model import ModelWithPaths
from paraflex.kinematics.paths import Circle, Line, Path, PathMotion, PointPath, Polygon, length_fraction
from paraflex.kinematics.reach import Shortfall

__all__ = [
    "Circle",
    "Line",
    "ModelWithPaths",
    "Path",
    "PathMotion",
    "PointPath",
    "Polygon",
    "RigidMotion",
    "Shortfall",
    "TrapezoidalLaw",
    "follow_path",
    "length_fraction",
    "path_follower",
    "reach_shortfall",
]
