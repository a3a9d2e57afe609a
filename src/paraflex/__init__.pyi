# Every public name once, in the groups of the documentation page "The interface".
from . import library as library, plots as plots

# Mechanisms: bodies, joints, forces
from .mechanism import (
    Mechanism as Mechanism,
    RigidBody as RigidBody,
    FlexibleBeam as FlexibleBeam,
    ForceLaw as ForceLaw,
    AssumedModesBeam as AssumedModesBeam,
    ModalBody as ModalBody,
    ModalPoint as ModalPoint,
    Material as Material,
    Section as Section,
    LumpedMass as LumpedMass,
    RevoluteJoint as RevoluteJoint,
    PrismaticJoint as PrismaticJoint,
    SlotJoint as SlotJoint,
    SlidingJoint as SlidingJoint,
    WeldJoint as WeldJoint,
    DistanceJoint as DistanceJoint,
    PointRef as PointRef,
    Motor as Motor,
    Actuator as Actuator,
    Amplifier as Amplifier,
    EndEffector as EndEffector,
    Payload as Payload,
    ActuationMode as ActuationMode,
    Assembly as Assembly,
    Start as Start,
    PointForce as PointForce,
    AppliedTorque as AppliedTorque,
    TorsionalSpring as TorsionalSpring,
    LinearSpring as LinearSpring,
    TorsionalDamper as TorsionalDamper,
    JointFriction as JointFriction,
    Gear as Gear,
    SumRelation as SumRelation,
    Encoder as Encoder,
    Tachometer as Tachometer,
    PositionSensor as PositionSensor,
    VelocitySensor as VelocitySensor,
    AccelerationSensor as AccelerationSensor,
    StrainGauge as StrainGauge,
    JointForceSensor as JointForceSensor,
    DeflectionSensor as DeflectionSensor,
    LossFactor as LossFactor,
    RayleighDamping as RayleighDamping,
    ModalDamping as ModalDamping,
    PrescribedAngle as PrescribedAngle,
    ConstantSpeed as ConstantSpeed,
    PiecewiseProfile as PiecewiseProfile,
    SpeedProfile as SpeedProfile,
    TabulatedProfile as TabulatedProfile,
    SampledAngle as SampledAngle,
)

# Paths
from .paths import (
    Circle as Circle,
    Line as Line,
    PointPath as PointPath,
    Polygon as Polygon,
    SequencePath as SequencePath,
    TabulatedPath as TabulatedPath,
)

# Models: reading, checking, planning, running
from .files import (
    Model as Model,
    allowing_outside as allowing_outside,
    load as load,
    load_path as load_path,
    plan as plan,
)
from .checks import check as check
from .checks.drawing import draw as draw
from .tracking import simulate as simulate
from .motion import simulate_motion as simulate_motion

# Kinematics and rigid torques
from .driven import (
    kinematics as kinematics,
    torques as torques,
    flywheel as flywheel,
    DrivenMotion as DrivenMotion,
)

# Integration
from .integrators import (
    methods as methods,
    METHODS as METHODS,
    DeflectionLimit as DeflectionLimit,
    IntegrationOptions as IntegrationOptions,
    JointLimit as JointLimit,
    SingularDistance as SingularDistance,
)

# Linear models
from .linear import (
    linearise as linearise,
    linearise_along as linearise_along,
    LinearModel as LinearModel,
    VaryingModel as VaryingModel,
    SampledModel as SampledModel,
    poses_along as poses_along,
    PosesAlong as PosesAlong,
    reduce as reduce,
    ReducedModel as ReducedModel,
    states_needed as states_needed,
)
from .reduced_bodies import (
    Reduction as Reduction,
    planned_reduction as planned_reduction,
    reduced_mechanism as reduced_mechanism,
)

# Statics
from .equilibria import statics as statics, Statics as Statics

# Control
from .control.loop.simulation import Simulation as Simulation
from .control.loop.chain import SampledController as SampledController
from .control.laws.controllers import Controller as Controller, Plant as Plant
from .control.laws.kinds.joint_pid import JointPID as JointPID
from .control.laws.joints import joint_gains as joint_gains, internal_torques as internal_torques
from .control.laws.kinds.computed_torque import ComputedTorque as ComputedTorque
from .control.laws.compiled import CompiledLaw as CompiledLaw
from .control.laws.kinds.rate_feedback import RateFeedback as RateFeedback
from .control.design.rate_gains import rate_feedback_gains as rate_feedback_gains, RateGains as RateGains
from .control.shaping.shapers import Shaper as Shaper, shaper as shaper
from .control.shaping.shaped import ShapedPath as ShapedPath, shape_torques as shape_torques
from .control.design.sampled import discretise as discretise, SampledPlant as SampledPlant
from .control.laws.lqg_law import LQGDesign as LQGDesign, Regulator as Regulator
from .control.design.regulators import lqr as lqr, lqg as lqg
from .control.laws.estimators import (
    quantisation_noise as quantisation_noise,
    Differentiator as Differentiator,
    BackwardDifference as BackwardDifference,
)
from .control.design.closed_loops import (
    closed_loop as closed_loop,
    closed_loops as closed_loops,
    spillover as spillover,
    ClosedLoop as ClosedLoop,
)
from .control.design.margins import margins as margins, Margins as Margins
from .control.environment import Environment as Environment
from .control.vector_environment import VectorEnvironment as VectorEnvironment

# Studies
from .campaign import Workers as Workers, progress_bar as progress_bar
from .studies import (
    run_study as run_study,
    verify as verify,
    compare_methods as compare_methods,
    compare_laws as compare_laws,
    tracking_case as tracking_case,
    motion_case as motion_case,
    sweep as sweep,
    optimise as optimise,
    identify as identify,
    indices as indices,
    sensitivities as sensitivities,
    load_sweep as load_sweep,
    load_optimisation as load_optimisation,
    load_identification as load_identification,
    load_indices as load_indices,
    load_sensitivities as load_sensitivities,
)

# Results
from .results import (
    tracking_dataset as tracking_dataset,
    motion_dataset as motion_dataset,
    linear_dataset as linear_dataset,
    reduction_dataset as reduction_dataset,
    statics_dataset as statics_dataset,
    summary as summary,
    save_results as save_results,
    load_results as load_results,
    open_results as open_results,
    compare as compare,
)
from .designs.measure import metrics as metrics
from .results.export import export as export
from .plots.film import FilmOptions as FilmOptions, animate as animate
from .studies.report import report as report
from .workbench.notebook import edit as edit

# Errors and warnings
from .errors import (
    ParaflexError as ParaflexError,
    InputError as InputError,
    NumericalError as NumericalError,
    ParaflexWarning as ParaflexWarning,
    ModelWarning as ModelWarning,
    ResultWarning as ResultWarning,
    StiffnessWarning as StiffnessWarning,
    ValidityWarning as ValidityWarning,
)
