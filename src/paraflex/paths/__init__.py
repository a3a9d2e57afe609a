"""Paths of the end-effector, and the joint motion that follows them."""

from .closure import (
    PathFollower as PathFollower,
    RigidMotion as RigidMotion,
    follow_path as follow_path,
    path_follower as path_follower,
    pose_at as pose_at,
)
from .model import ModelWithPaths as ModelWithPaths
from .paths import (
    Circle as Circle,
    Line as Line,
    Path as Path,
    PathMotion as PathMotion,
    PointPath as PointPath,
    Polygon as Polygon,
    SequencePath as SequencePath,
    TabulatedPath as TabulatedPath,
    length_fraction as length_fraction,
    turning_of as turning_of,
)
from .profiles import CruiseProfile as CruiseProfile, TrapezoidalProfile as TrapezoidalProfile
