"""What the user means: frozen descriptions of bodies, joints, motors and the mechanism they form."""

from paraflex.fem import Polynomial, ShapeFunction, Sine
from paraflex.mechanism.actuation_modes import mode_of_motors, mode_of_signs, parse_mode
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
from paraflex.mechanism.damping import Damping, LossFactor, ModalDamping, RayleighDamping, stiffness_proportional
from paraflex.mechanism.gears import Gear
from paraflex.mechanism.groups import Group, grouped, groups_of
from paraflex.mechanism.joints import (
    GROUND,
    JOINT_KINDS,
    AngleLaw,
    AtEnd,
    Joint,
    Motor,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    SampledAngle,
    SlidingJoint,
    SlotJoint,
    WeldJoint,
    points_named,
)
from paraflex.mechanism.laws import ConstantSpeed, PiecewiseLaw, TabulatedLaw
from paraflex.mechanism.loads import (
    AppliedTorque,
    JointFriction,
    LinearSpring,
    Load,
    PointForce,
    TorsionalDamper,
    TorsionalSpring,
)
from paraflex.mechanism.loops import loops
from paraflex.mechanism.mechanism import Mechanism
from paraflex.mechanism.members import ActuationMode, Assembly, EndEffector, Geometry
from paraflex.mechanism.modal import ModalBody, ModalPoint
from paraflex.mechanism.poses import Pose, approximate_poses, placed_poses
from paraflex.mechanism.quantities import joints_named
from paraflex.mechanism.raparm import raparm_i
from paraflex.mechanism.rows import chain_of_segments, four_bars_in_a_row
from paraflex.mechanism.segments import (
    FIRST_END,
    LAST_END,
    Segmented,
    check_segmentable,
    finite_segments,
    is_hinge,
    proportional_segments,
)
from paraflex.mechanism.start import BodyValues, Deflection, Start, check_start

__all__ = [
    "FIRST_END",
    "GROUND",
    "JOINT_KINDS",
    "LAST_END",
    "ActuationMode",
    "AngleLaw",
    "AppliedTorque",
    "Assembly",
    "AssumedModesBeam",
    "AtEnd",
    "Body",
    "BodyValues",
    "ConstantSpeed",
    "Curvature",
    "Damping",
    "Deflection",
    "EndEffector",
    "FlexibleBeam",
    "Gear",
    "Geometry",
    "Group",
    "Joint",
    "JointFriction",
    "LinearSpring",
    "Load",
    "LossFactor",
    "LumpedMass",
    "Material",
    "Mechanism",
    "ModalBody",
    "ModalDamping",
    "ModalPoint",
    "Motor",
    "PiecewiseLaw",
    "PointForce",
    "PointRef",
    "Polynomial",
    "Pose",
    "PrescribedAngle",
    "PrismaticJoint",
    "RayleighDamping",
    "RevoluteJoint",
    "RigidBody",
    "SampledAngle",
    "Section",
    "Segmented",
    "ShapeFunction",
    "Sine",
    "SlidingJoint",
    "SlotJoint",
    "Start",
    "TabulatedLaw",
    "TorsionalDamper",
    "TorsionalSpring",
    "WeldJoint",
    "approximate_poses",
    "chain_of_segments",
    "check_mechanism",
    "check_segmentable",
    "check_start",
    "finite_segments",
    "four_bars_in_a_row",
    "given_shapes",
    "grouped",
    "groups_of",
    "is_hinge",
    "joints_named",
    "loops",
    "mode_of_motors",
    "mode_of_signs",
    "parse_mode",
    "placed_poses",
    "points_named",
    "proportional_segments",
    "raparm_i",
    "stiffness_proportional",
]
