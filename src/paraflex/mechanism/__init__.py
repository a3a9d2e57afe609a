"""What the user means: frozen descriptions of bodies, joints, motors and the mechanism they form."""

from paraflex.mechanism.bodies import Body, Curvature, FlexibleBeam, LumpedMass, Material, RigidBody, Section
from paraflex.mechanism.checks import check_mechanism
from paraflex.mechanism.joints import (
    GROUND,
    AngleLaw,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    SampledAngle,
)
from paraflex.mechanism.laws import ConstantSpeed, PiecewiseLaw, TabulatedLaw
from paraflex.mechanism.loads import AppliedTorque, LinearSpring, Load, PointForce, TorsionalDamper, TorsionalSpring
from paraflex.mechanism.mechanism import (
    ActuationMode,
    Assembly,
    EndEffector,
    Geometry,
    Mechanism,
    mode_of_motors,
    mode_of_signs,
    parse_geometry,
    parse_mode,
)
from paraflex.mechanism.poses import Pose, approximate_poses
from paraflex.mechanism.raparm import raparm_i
from paraflex.mechanism.segments import FIRST_END, LAST_END, Segmented, finite_segments, proportional_segments
from paraflex.mechanism.start import BodyValues, Deflection, Start, check_start

__all__ = [
    "FIRST_END",
    "GROUND",
    "LAST_END",
    "ActuationMode",
    "AngleLaw",
    "AppliedTorque",
    "Assembly",
    "Body",
    "BodyValues",
    "ConstantSpeed",
    "Curvature",
    "Deflection",
    "EndEffector",
    "FlexibleBeam",
    "Geometry",
    "LinearSpring",
    "Load",
    "LumpedMass",
    "Material",
    "Mechanism",
    "Motor",
    "PiecewiseLaw",
    "PointForce",
    "PointRef",
    "Pose",
    "PrescribedAngle",
    "RevoluteJoint",
    "RigidBody",
    "SampledAngle",
    "Section",
    "Segmented",
    "Start",
    "TabulatedLaw",
    "TorsionalDamper",
    "TorsionalSpring",
    "approximate_poses",
    "check_mechanism",
    "check_start",
    "finite_segments",
    "mode_of_motors",
    "mode_of_signs",
    "parse_geometry",
    "parse_mode",
    "proportional_segments",
    "raparm_i",
]
