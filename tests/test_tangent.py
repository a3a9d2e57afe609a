"""The hand-made Jacobians of residuals, accelerations and DAEs against differences of what they are of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import twins
from conftest import make_geared_linkage, make_linkage
from paraflex.dynamics import build_system, constant_signals, inputs_of, pack_signals
from paraflex.files import ExpressionProfile, load
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.ode import (
    descriptor_jacobian,
    descriptor_residual,
    rates,
    rates_jacobian,
    stabilised_jacobian,
    stabilised_residual,
)
from paraflex.kernel.packed import CONSTRAINT, FRICTION, OMEGA2
from paraflex.kernel.stage import equations
from paraflex.kernel.tangent import make_tangent, note_slopes, residual_tangent
from paraflex.mechanism import (
    AppliedTorque,
    ForceLaw,
    Geometry,
    LinearSpring,
    LumpedMass,
    PointForce,
    PointRef,
    TabulatedProfile,
    raparm_i,
)
from test_axes import make_sliders

TIME, ALPHA, BETA, PART = 0.37, 3.0, 7.0, 1e-7
WEIGHTS = (1.0, 2.0 * ALPHA, BETA * BETA)
# Central differences of fourth order: places and weights, for a step of one.
STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))


def loaded_linkage(geometry):
    """The linkage with springs and dampers between points, loads and weight."""
    ref = PointRef.parse
    return replace(
        make_linkage().with_geometry(geometry),
        linear_springs=(
            LinearSpring("cord", ref("crank.P"), ref("flap.R"), 40.0, 0.1, damping=3.0),
            LinearSpring("stay", ref("ground.S"), ref("coupler.Q"), 70.0, 0.05, damping=1.0),
        ),
        loads=(
            PointForce("pull", ref("coupler.R"), (3.0, ExpressionProfile("1 - 5 * t"))),
            AppliedTorque("wring", ref("crank.P"), ExpressionProfile("0.7 * cos(t)")),
        ),
        gravity=(0.3, -9.81),
    )


def with_laws(mechanism):
    """The sliders under forces of everything that laws depend on, and of every operation."""
    law = ForceLaw
    table = TabulatedProfile((-3.0, -1.0, 0.2, 1.0, 4.0), (1.0, -2.0, 0.5, 3.0, 1.0))
    forces = (
        ("block.S", (law("k * guide.travel**3 - 2 * tanh(guide.rate) * t", {"k": 3.0}), law("sin(O.angle) / 3"))),
        (
            "plate.T",
            (law("exp(-plate.T.x**2) * bob.C.vy", table=table), law("max(rail.travel, -2) * min(rail.rate, 9)")),
        ),
        ("bob.C", (law("sqrt(2 + cos(pin.travel)) - log(5 + bead.travel**2)"), law("abs(bead.rate) ** 1.5 + 0.3"))),
        ("rod.W", (law("atan(trolley.travel + slot.travel) - asin(tanh(ground.G.x - rod.W.y))"), 2.0)),
    )
    torque = law("-O.rate * acos(tanh(crank.P.vx)) + 2**sinh(tanh(O.angle)) + cosh(tan(0.2 * sin(crank.M.x)))")
    loads = [PointForce(f"on_{at[:3]}", PointRef.parse(at), force) for at, force in forces]
    twist = AppliedTorque("turn", PointRef.parse("crank.P"), torque, reaction=PointRef.parse("rod.R"))
    pull = law("5 * cord.length**2 - cord.length_rate * O.rate")
    cord = LinearSpring("cord", PointRef.parse("block.S"), PointRef.parse("rod.W"), 3.0, 0.1, 0.2, force=pull)
    return replace(mechanism, loads=(*loads, twist), linear_springs=(cord,))


def mechanism(name):
    kind, _, geometry = name.partition(" ")
    geometry = Geometry(geometry or "linear")
    if kind == "raparm":
        return raparm_i().with_geometry(geometry)
    if kind == "lumps":
        # More lumps at the end of every beam than fit beside its last element's Gauss points.
        raparm = raparm_i().with_geometry(geometry)
        more = {body.name: (LumpedMass(list(body.points)[-1], 0.1, 1e-4),) * 3 for body in raparm.bodies}
        return replace(
            raparm, bodies=tuple(replace(body, lumps=(*body.lumps, *more[body.name])) for body in raparm.bodies)
        )
    if kind == "linkage":
        return loaded_linkage(geometry)
    if kind == "gears":
        return replace(make_geared_linkage().with_geometry(geometry), gravity=(0.3, -9.81))
    if kind == "sliders":
        return make_sliders(geometry)
    if kind == "laws":
        return with_laws(make_sliders(geometry))
    return load(kind).mechanism


NAMES = [
    "raparm linear", "raparm second-order", "linkage linear", "linkage second-order", "gears linear",
    "gears second-order", "sliders linear", "sliders second-order", "laws linear",
    "laws second-order",
    "lumps second-order", "slider_crank_flexible", "3prr", "andrews",
]  # fmt: skip


class Case:
    """A system at a random state, its flexible coordinates without stiffness: that would drown all else."""

    def __init__(self, name, seed=5):
        self.system = build_system(mechanism(name))
        modal = self.system.packed.modal.copy()
        modal[OMEGA2] = 0.0
        self.packed = self.system.packed._replace(modal=modal)
        random, motors = np.random.default_rng(seed), len(self.system.mechanism.motors)
        self.q, self.v, self.a = twins.random_state(self.system, seed)
        self.lam = random.standard_normal(self.system.m)
        self.signals, _ = pack_signals(
            self.system.mechanism, constant_signals(random.standard_normal(motors), 1.0), 1.0
        )
        self.torques = np.zeros(inputs_of(self.system.mechanism).acting)
        self.ws = self.system.workspace()
        note_friction(self.packed, self.q, self.v, self.ws.mu, self.ws.compliance)

    def residuals(self, q, v, a, lam):
        equations(self.packed, self.signals, TIME, WEIGHTS, q, v, a, lam, self.torques, self.ws)
        return np.concatenate([self.ws.f, self.ws.rows])

    def rates(self, y):
        dy, a, lam = np.zeros(y.size), np.zeros(self.system.n), np.zeros(self.system.m)
        arguments = (self.packed, self.signals, TIME, WEIGHTS, y, a, lam, self.torques, self.ws, PART, dy)
        assert rates(*arguments) == 0
        return dy, a, lam


@pytest.fixture(scope="module", params=NAMES)
def case(request):
    return Case(request.param)


def differences(function, x, direction, step):
    return sum(weight * function(x + place * step * direction) for place, weight in STENCIL) / step


def assert_columns_agree(found, expected, tolerance):
    """Column by column, by the largest entry of each."""
    size = np.abs(expected).max(axis=0)
    assert np.all(np.abs(found - expected).max(axis=0) <= tolerance * np.maximum(size, 1e-3 * size.max()))


def test_residuals_along_a_direction(case):
    """In q, in v, in a and in lambda at once and each alone."""
    system, random = case.system, np.random.default_rng(3)
    d, base = make_tangent(case.packed), (case.q, case.v, case.a, case.lam)
    case.residuals(*base)
    note_slopes(case.packed, case.q, case.v, case.ws.mu, case.ws.compliance, d)
    for parts in ("q", "v", "a", "lam", "q v a lam"):
        direction = []
        for name, x in zip(d._fields, base, strict=False):
            direction.append(random.standard_normal(x.size) * (name in parts.split()))
            getattr(d, name)[:] = direction[-1]
        arguments = (case.q, case.v, case.a, case.lam, case.torques, case.ws.compliance, 0, len(system.bodies), d)
        residual_tangent(case.packed, WEIGHTS, *arguments)

        def along(x, direction=direction):
            return case.residuals(*(y + x[0] * z for y, z in zip(base, direction, strict=True)))

        # Linear in accelerations and multipliers: a step of one, as rows may be 1e9 times their change.
        step = 1e-5 if "q" in parts else 1e-3 if "v" in parts else 1.0
        expected = differences(along, np.zeros(1), np.ones(1), step)
        found = np.concatenate([d.f, d.rows])
        assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
        rows = np.abs(expected[system.n :])
        assert np.abs(d.rows - expected[system.n :]).max(initial=0.0) <= 1e-7 * rows.max(initial=0.0) + 1e-8


def test_stiffness_is_a_diagonal():
    system = build_system(make_linkage())
    d, still = make_tangent(system.packed), np.zeros(system.n)
    d.q[system.bodies[0].flexible] = 2.0
    lam, torques, ws = np.zeros(system.m), np.zeros(4), system.workspace()
    arguments = (still, still, still, lam, torques, ws.compliance, 0, len(system.bodies), d)
    residual_tangent(system.packed, WEIGHTS, *arguments)
    body = system.bodies[0]
    omega2 = system.packed.modal[OMEGA2, : body.nf]
    assert np.allclose(d.f[body.flexible], 2.0 * omega2, rtol=1e-12)


def test_accelerations_satisfy_the_equations(case):
    y = np.concatenate([case.q, case.v, [0.0]])
    _, a, lam = case.rates(y)
    left = case.residuals(case.q, case.v, a, lam)
    scale = np.abs(case.residuals(case.q, case.v, 0.0 * a, 0.0 * lam)).max()
    assert np.abs(left).max() < 1e-10 * scale


def test_jacobian_of_the_rates(case):
    system = case.system
    y = np.concatenate([case.q, case.v, [0.0]])
    _, a, lam = case.rates(y)
    found = np.zeros((y.size, y.size))
    rates_jacobian(case.packed, WEIGHTS, y, a, lam, case.torques, case.ws, make_tangent(case.packed), found)
    columns = np.random.default_rng(1).permutation(2 * system.n)[:60]
    unit = np.eye(y.size)
    # With smaller steps rounding shows (a third of the tolerance at 1e-5), with larger ones curvature (all at 1e-4).
    expected = np.stack([differences(lambda x: case.rates(x)[0], y, unit[j], 3e-5) for j in columns], axis=1)
    assert_columns_agree(found[:-1, columns], expected[:-1], 1e-6)


@pytest.mark.parametrize("form", ["index 1", "index 2"])
def test_jacobian_of_the_dae(case, form):
    """Row of the power excepted, which is left out."""
    system, random = case.system, np.random.default_rng(2)
    n, m, count = system.n, system.m, len(system.mechanism.motors)
    dropped, d, c = random.random(m) < 0.2, make_tangent(case.packed), 13.0
    weight, idle, phi, dphi = random.random(n) + 0.5, np.zeros(n + count), np.zeros(m), np.zeros(m)
    size = 2 * n + (m if form == "index 1" else 2 * m) + 1
    y, dy = random.standard_normal(size), random.standard_normal(size)
    kind = system.packed.rows["kind"]
    if form == "index 2":
        y[2 * n + m : -1][dropped | (kind != CONSTRAINT)] = 0.0
    y[: 2 * n], dy[n : 2 * n] = np.concatenate([case.q, case.v]), case.a

    def residual(x):
        out, p, dz = np.zeros(size), case.packed, dy + c * (x - y)
        if form == "index 1":
            arguments = (p, case.signals, TIME, WEIGHTS, x, dz, dropped, case.torques, case.ws, out)
            descriptor_residual(*arguments)
        else:
            arguments = (p, case.signals, TIME, x, dz, dropped, weight, case.torques, idle, case.ws, d, phi, dphi, out)
            stabilised_residual(*arguments)
        return out

    residual(y)
    found = np.zeros((size, size))
    if form == "index 1":
        descriptor_jacobian(case.packed, WEIGHTS, y, dy, c, dropped, case.torques, case.ws, d, found)
    else:
        arguments = (case.packed, y, dy, c, dropped, weight, case.torques, idle, case.ws, d, found)
        stabilised_jacobian(*arguments)
    # Rows of friction are scaled anew at each rate: no part of their derivative at a root.
    rows = np.setdiff1d(np.arange(size - 1), 2 * n + np.nonzero(kind == FRICTION)[0])
    columns, unit = random.permutation(size)[:60], np.eye(size)
    expected = np.stack([differences(residual, y, unit[j], 1e-5) for j in columns], axis=1)
    assert_columns_agree(found[np.ix_(rows, columns)], expected[rows], 1e-6)
