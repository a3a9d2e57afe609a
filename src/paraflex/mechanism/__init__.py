"""Immutable descriptions of bodies, joints, motors and the mechanism that they form."""

from paraflex.fem import Polynomial as Polynomial, ShapeFunction as ShapeFunction, Sine as Sine
from .actuation_modes import mode_of_motors as mode_of_motors, mode_of_signs as mode_of_signs, parse_mode as parse_mode
from .actuators import Actuator as Actuator, Amplifier as Amplifier
from .bodies import (
    AssumedModesBeam as AssumedModesBeam,
    Body as Body,
    ComponentModes as ComponentModes,
    Curvature as Curvature,
    FlexibleBeam as FlexibleBeam,
    LumpedMass as LumpedMass,
    Material as Material,
    RigidBody as RigidBody,
    given_shapes as given_shapes,
)
from .damping import (
    Damping as Damping,
    LossFactor as LossFactor,
    ModalDamping as ModalDamping,
    RayleighDamping as RayleighDamping,
    stiffness_proportional as stiffness_proportional,
)
from .gears import Gear as Gear, Relation as Relation, SumRelation as SumRelation
from .groups import Group as Group, grouped as grouped, groups_of as groups_of
from .joints import (
    GROUND as GROUND,
    JOINT_KINDS as JOINT_KINDS,
    AtEnd as AtEnd,
    DistanceJoint as DistanceJoint,
    Joint as Joint,
    Motor as Motor,
    PointRef as PointRef,
    PrescribedAngle as PrescribedAngle,
    PrismaticJoint as PrismaticJoint,
    RevoluteJoint as RevoluteJoint,
    SlidingJoint as SlidingJoint,
    SlotJoint as SlotJoint,
    WeldJoint as WeldJoint,
)
from .laws import ForceLaw as ForceLaw, MotionQuantity as MotionQuantity
from .loads import (
    AppliedTorque as AppliedTorque,
    JointFriction as JointFriction,
    LinearSpring as LinearSpring,
    Load as Load,
    PointForce as PointForce,
    TorsionalDamper as TorsionalDamper,
    TorsionalSpring as TorsionalSpring,
)
from .loops import loops as loops
from .mechanism import Mechanism as Mechanism
from .members import (
    ActuationMode as ActuationMode,
    Assembly as Assembly,
    EndEffector as EndEffector,
    Geometry as Geometry,
)
from .modal import ModalBody as ModalBody, ModalPoint as ModalPoint
from .payload import Payload as Payload
from .poses import Pose as Pose, approximate_poses as approximate_poses, placed_poses as placed_poses
from .profiles import (
    ConstantSpeed as ConstantSpeed,
    PiecewiseProfile as PiecewiseProfile,
    SampledAngle as SampledAngle,
    SpeedProfile as SpeedProfile,
    TabulatedProfile as TabulatedProfile,
    TimeProfile as TimeProfile,
)
from .quantities import joints_named as joints_named
from .raparm import raparm_i as raparm_i
from .rotors import (
    actuator_motors as actuator_motors,
    actuators_by_motor as actuators_by_motor,
    rotor_mass as rotor_mass,
    with_actuators as with_actuators,
)
from .rows import chain_of_segments as chain_of_segments, four_bars_in_a_row as four_bars_in_a_row
from .sections import Rectangle as Rectangle, Round as Round, Section as Section, Shape as Shape, Tube as Tube
from .segments import (
    FIRST_END as FIRST_END,
    LAST_END as LAST_END,
    SegmentedMechanism as SegmentedMechanism,
    check_segmentable as check_segmentable,
    finite_segments as finite_segments,
    in_frames as in_frames,
    is_hinge as is_hinge,
    proportional_segments as proportional_segments,
    with_clamps as with_clamps,
)
from .sensors import (
    SENSOR_KINDS as SENSOR_KINDS,
    AccelerationSensor as AccelerationSensor,
    DeflectionSensor as DeflectionSensor,
    Encoder as Encoder,
    JointForceSensor as JointForceSensor,
    PointSensor as PointSensor,
    PositionSensor as PositionSensor,
    Sensor as Sensor,
    StrainGauge as StrainGauge,
    Tachometer as Tachometer,
    VelocitySensor as VelocitySensor,
)
from .start import (
    BodyValues as BodyValues,
    Deflection as Deflection,
    Start as Start,
    begun_at as begun_at,
    check_start as check_start,
    standing as standing,
)
