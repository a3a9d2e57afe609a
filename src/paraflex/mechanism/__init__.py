"""What the user means: frozen descriptions of bodies, joints, motors and the mechanism they form."""

from paraflex.fem import Polynomial, ShapeFunction, Sine
from paraflex.mechanism.bodies import (
    AssumedModesBeam,
    Body,
    Curvature,
    FlexibleBeam,
    LumpedMass,
    Material,
    RigidBody,
    Section,
    given_shapes,
)
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
from paraflex.mechanism.modal import ModalBody, ModalPoint
from paraflex.mechanism.raparm import raparm_i
from paraflex.mechanism.segments import (
    FIRST_END,
    LAST_END,
    Segmented,
    check_segmentable,
    finite_segments,
    proportional_segments,
)

__all__ = [
    "FIRST_END",
    "GROUND",
    "LAST_END",
    "ActuationMode",
    "AngleLaw",
    "AppliedTorque",
    "Assembly",
    "AssumedModesBeam",
    "Body",
    "Curvature",
    "EndEffector",
    "FlexibleBeam",
    "Geometry",
    "LinearSpring",
    "Load",
    "LumpedMass",
    "Material",
    "Mechanism",
    "ModalBody",
    "ModalPoint",
    "Motor",
    "PointForce",
    "PointRef",
    "Polynomial",
    "PrescribedAngle",
    "RevoluteJoint",
    "RigidBody",
    "SampledAngle",
    "Section",
    "Segmented",
    "ShapeFunction",
    "Sine",
    "TorsionalDamper",
    "TorsionalSpring",
    "check_mechanism",
    "check_segmentable",
    "finite_segments",
    "given_shapes",
    "mode_of_motors",
    "mode_of_signs",
    "parse_geometry",
    "parse_mode",
    "proportional_segments",
    "raparm_i",
]
