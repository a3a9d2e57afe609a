"""Fields that take one of a few values: the member or its value, converted, and nothing else."""

from dataclasses import replace
from enum import Enum

import numpy as np
import pytest

from paraflex.campaign import open_engine
from paraflex.compilation import are_compiled
from paraflex.designs.samples import designs
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition, mesh_beam
from paraflex.fem.reference import reference_basis
from paraflex.integrators import METHODS, IntegrationOptions, Treatment
from paraflex.mechanism import (
    Curvature,
    EndEffector,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    PointRef,
    Section,
    raparm_i,
)
from paraflex.plots.layout import column_width
from paraflex.plots.themes import theme
from paraflex.studies.agreement import Refinement
from paraflex.studies.optimisation.objective import Objective
from paraflex.studies.optimisation.study import Search
from paraflex.studies.verification import ModelRuns, VerificationOptions
from paraflex.tracking import plan_tracking, simulate


def beam(**options):
    return FlexibleBeam("beam", 1.0, Section(1e-4, 1e-9), Material(70e9, 2700.0), points={"P": 0.0}, **options)


def mechanism(**options):
    return Mechanism("free", ground={}, bodies=(beam(),), joints=(), **options)


def styled(style):
    with column_width(style):
        pass


# Members of an enumeration: how a value is given, how it is kept, under which name it is refused.
MEMBERS = {
    "geometry": (Geometry, lambda x: mechanism(geometry=x).geometry, "geometry"),
    "replaced geometry": (Geometry, lambda x: replace(mechanism(), geometry=x).geometry, "geometry"),
    "with_geometry": (Geometry, lambda x: mechanism().with_geometry(x).geometry, "geometry"),
    "reference": (ReferenceCondition, lambda x: beam(reference=x).reference, "body.beam.reference"),
    "replaced reference": (
        ReferenceCondition, lambda x: replace(beam(), reference=x).reference, "body.beam.reference",
    ),
    "with_beams(reference)": (
        ReferenceCondition, lambda x: mechanism().with_beams(reference=x).body("beam").reference, "reference",
    ),
    "curvature": (Curvature, lambda x: beam(curvature=x).curvature, "body.beam.curvature"),
    "replaced curvature": (Curvature, lambda x: replace(beam(), curvature=x).curvature, "body.beam.curvature"),
    "with_beams(curvature)": (
        Curvature, lambda x: mechanism().with_beams(curvature=x).body("beam").curvature, "curvature",
    ),
}  # fmt: skip

# Those that give no member back, and fields of names: what is refused, and what is known.
NAMES = {
    "with_beams of a rigid mechanism": (
        lambda x: mechanism().rigid().with_beams(reference=x), "reference", [each.value for each in ReferenceCondition],
    ),
    "reference_basis": (
        lambda x: reference_basis(mesh_beam(1.0, {}, 1), x, np.eye(8), np.eye(8)), "reference",
        [each.value for each in ReferenceCondition],
    ),
    "are_compiled": (are_compiled, "geometry", [each.value for each in Geometry]),
    "constraints": (lambda x: IntegrationOptions(constraints=x), "constraints", ["baumgarte", "projection", "ggl"]),
    "method": (lambda x: IntegrationOptions(method=x), "method", list(METHODS)),
    "replaced method": (lambda x: replace(IntegrationOptions(), method=x), "method", list(METHODS)),
    "method of a verification": (lambda x: VerificationOptions(method=x), "method", list(METHODS)),
    "level": (lambda x: ModelRuns({}).finished(x), "level", [each.value for each in Refinement]),
    "search.method": (lambda x: Search(method=x), "search.method", ["slsqp", "optuna"]),
    "search.gradients": (lambda x: replace(Search(), gradients=x), "search.gradients", ["differences", "exact"]),
    "objective.over": (lambda x: Objective({"duration": 1.0}, over=x), "objective.over", ["worst", "mean"]),
    "sampling": (lambda x: designs((), x, None, 0), "sampling.kind", ["grid", "list"]),
    "engine": (open_engine, "--engine", ["threads"]),
    "theme": (theme, "theme", ["light", "dark"]),
    "style": (styled, "style", ["single", "double"]),
}  # fmt: skip


@pytest.mark.parametrize("case", MEMBERS)
def test_a_member_and_its_value_are_the_same(case):
    kind, kept, _ = MEMBERS[case]
    for member in kind:
        assert kept(member) is member
        assert kept(member.value) is member


class Foreign(Enum):
    """Of another enumeration, with a value that is known."""

    LINEAR = "linear"
    CANTILEVER = "cantilever"
    SHARED = "shared"


WRONG = ["2nd", "", 2, ["linear"], *Foreign]


@pytest.mark.parametrize("case", MEMBERS)
@pytest.mark.parametrize("value", WRONG, ids=repr)
def test_anything_else_is_refused(case, value):
    kind, kept, field = MEMBERS[case]
    with pytest.raises(InputError) as refused:
        kept(value)
    assert refused.value.field == field
    assert any(member.value in refused.value.remedy for member in kind)
    nearly = next(iter(kind)).value[:-1]
    with pytest.raises(InputError, match=f'did you mean "{nearly}'):
        kept(nearly)


@pytest.mark.parametrize("case", NAMES)
def test_names_are_known_or_refused(case):
    take, field, known = NAMES[case]
    for value in ("2nd", 2, ["linear"]):
        with pytest.raises(InputError) as refused:
            take(value)
        assert refused.value.field == field
        assert refused.value.value == value
        assert any(name in refused.value.remedy for name in known)
    for name in known:
        take(name)


def test_treatments_of_constraints_are_taken_as_members_too():
    assert IntegrationOptions(constraints=Treatment.GGL) == IntegrationOptions(constraints="ggl")
    with pytest.raises(InputError, match="esdirk5 cannot keep the constraints in this way"):
        IntegrationOptions(constraints=Treatment.POSITION)


def test_task_coordinates_are_a_list_of_x_y_and_angle():
    point = PointRef("beam", "P")
    assert EndEffector(point, ["y", "angle"]).coordinates == ("y", "angle")
    for wrong in ("xy", "angle", (), ("x", "x"), ("x", "z"), (["x"],)):
        with pytest.raises(InputError, match=r"end_effector\.coordinates: not a set of task coordinates"):
            EndEffector(point, wrong)


@pytest.mark.parametrize("damping", ["rayleigh", 0.02, (0.02,)])
def test_damping_is_of_a_known_kind(damping):
    with pytest.raises(InputError, match=r"body\.beam\.damping: not a damping"):
        Mechanism("free", ground={}, bodies=(beam(damping=damping),), joints=())


def test_values_compute_what_members_compute(square):
    model = raparm_i().with_beams(reference="pinned", curvature="separate")
    assert model == raparm_i().with_beams(reference=ReferenceCondition.PINNED, curvature=Curvature.SEPARATE)
    ends = [
        simulate(plan_tracking(replace(model, geometry=geometry), square, duration=0.02, samples=2), "+-+-")
        for geometry in ("second-order", Geometry.SECOND_ORDER, "linear")
    ]
    by_value, by_member, linear = (run.solution.q[-1] for run in ends)
    assert np.array_equal(by_value, by_member)
    assert not np.array_equal(by_value, linear)
