"""Fixed steps in which Newton's iteration has a hard time: slopes that change in a step, springs it does not know."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.errors import IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Geometry,
    JointFriction,
    LinearSpring,
    Material,
    Mechanism,
    PointRef,
    RevoluteJoint,
    Section,
)
from paraflex.motion import simulate_motion
from paraflex.tracking import plan_tracking, simulate


@pytest.fixture(scope="module")
def rubbing():
    """The library's five-bar with linear beams and dry friction at a driven joint, until it comes to rest."""
    model = pf.load("five_bar")
    beams = model.mechanism.with_beams(reference="cantilever", curvature="shared").with_geometry("linear")
    mechanism = replace(beams, frictions=(JointFriction("rub", "A1", limit=0.4, speed=0.3),))
    return plan_tracking(mechanism, model.path("square"), samples=9)


def run(task, mode="++", **options):
    return simulate(task, mode, options=pf.IntegrationOptions(**options)).solution


def distance(found, expected, until):
    """Largest difference of coordinates at samples up to a time [m or rad]."""
    return np.abs(found.q - expected.q)[expected.t <= until].max()


def test_friction_whose_slope_changes_within_a_step(rubbing):
    exact, errors, rejected = run(rubbing, tolerance=1e-6), [], []
    for step in (1e-3, 2.5e-4, 5e-5):
        found = run(rubbing, step=step)
        assert found.status == "complete"
        # Until the joint turns back for the first time.
        errors.append(distance(found, exact, 0.19))
        rejected.append(found.rejected)
    # Of first order, as without friction: torques jump, and what vibrates then is faster than these steps.
    assert errors[0] < 4e-3
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.35 * errors[1]
    # Slopes are renewed in the iteration: hardly any step has to be done in parts.
    assert rejected[0] < 10
    assert rejected[1:] == [0, 0]


@pytest.mark.parametrize("method", ["esdirk5", "hht-alpha"])
def test_friction_by_other_methods(rubbing, method):
    assert run(rubbing, step=5e-4, method=method).status == "complete"


def pulled(damping, stiffness=1000.0):
    """A beam at rest, straight, whose end a damped spring pulls aside."""
    beam = FlexibleBeam(
        "beam", 1.0, Section.rectangle(0.03, 0.005), Material(70e9, 2700.0), points={"O": 0.0, "P": 1.0}, elements=2,
        reference=ReferenceCondition.CANTILEVER,
    )  # fmt: skip
    return Mechanism(
        "pulled", ground={"O": (0.0, 0.0), "Q": (1.0, 0.3)}, bodies=(beam,),
        joints=(RevoluteJoint("O", PointRef("ground", "O"), PointRef("beam", "O")),),
        linear_springs=(LinearSpring("s", PointRef("ground", "Q"), PointRef("beam", "P"), stiffness, 0.2, damping),),
        assemblies=(Assembly("straight", {"beam": 0.0}),), geometry=Geometry.LINEAR,
    )  # fmt: skip


def move(mechanism, **options):
    return simulate_motion(mechanism, 0.1, samples=6, options=pf.IntegrationOptions(**options)).solution


def test_a_step_without_convergence_is_done_in_parts():
    exact = move(pulled(50.0), tolerance=1e-7)
    found = move(pulled(50.0), step=1e-3)
    assert found.status == "complete"
    # A fifth each, and the next step is a whole one again.
    assert found.rejected > 0
    assert found.steps == 100 + 4 * found.rejected
    # The beam swings by 0.05 rad; steps of a tenth need no parts.
    assert distance(found, exact, np.inf) < 4e-4
    finer = move(pulled(50.0), step=1e-4)
    assert (finer.steps, finer.rejected) == (1000, 0)
    assert distance(finer, exact, np.inf) < 4e-4


def test_what_parts_do_not_help_is_said():
    with pytest.raises(IntegrationError, match=r"nor in parts of it, at t = .*; take a shorter step") as stopped:
        move(pulled(1e6), step=1e-2)
    assert "however small" not in str(stopped.value)
    assert stopped.value.moment.time == 0.0


def test_a_tolerance_below_what_eight_iterations_reach(tracking):
    mechanism = tracking.mechanism.with_beams(reference="cantilever", curvature="shared").with_geometry("linear")
    task = tracking.remodelled(mechanism)
    found, finer = (run(task, "++++", method="esdirk5", step=1e-3, tolerance=tolerance) for tolerance in (1e-8, 1e-10))
    assert (found.status, found.rejected) == ("complete", 0)
    assert distance(found, finer, np.inf) < 1e-9
