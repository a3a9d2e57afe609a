"""Spin-up of a cantilever (Kane; Simo and Vu-Quoc): prescribed root angle, linear floating frame at w_s = 1."""

import numpy as np
import pytest

from paraflex.dynamics import build_system, consistent_state, pack_signals
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Material,
    Mechanism,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    SampledAngle,
    Section,
)
from paraflex.results.motion import tip_deflection

W_S, RAMP, LENGTH = 1.0, 15.0, 10.0


def angle(t):
    up = t**2 / 2 + (RAMP / (2 * np.pi)) ** 2 * (np.cos(2 * np.pi * t / RAMP) - 1)
    return W_S / RAMP * np.where(t < RAMP, up, RAMP**2 / 2 + RAMP * (t - RAMP))


def rate(t):
    return W_S / RAMP * np.where(t < RAMP, t - RAMP / (2 * np.pi) * np.sin(2 * np.pi * t / RAMP), RAMP)


def acceleration(t):
    return W_S / RAMP * np.where(t < RAMP, 1 - np.cos(2 * np.pi * t / RAMP), 0.0)


@pytest.fixture(scope="module")
def spin_up():
    beam = FlexibleBeam(
        name="beam",
        length=LENGTH,
        section=Section(area=1.0, second_moment=5e-4),
        material=Material(youngs_modulus=2.8e7, density=1.2),
        points={"root": 0.0, "tip": LENGTH},
        elements=4,
    )
    mechanism = Mechanism(
        name="spin-up",
        ground={"O": (0.0, 0.0)},
        bodies=(beam,),
        joints=(RevoluteJoint("root", PointRef("ground", "O"), PointRef("beam", "root")),),
        prescribed=(PrescribedAngle("spin", "root", SampledAngle(angle, rate, acceleration, knots=(RAMP,))),),
        assemblies=(Assembly("start", {"beam": 0.0}),),
    )
    system = build_system(mechanism)
    end = 16.0
    signals, knots = pack_signals(mechanism, [], end)
    times = np.unique(np.concatenate([np.linspace(0.0, end, 1601), np.linspace(7.85, 7.91, 61)]))
    solution = integrate(
        system,
        signals,
        consistent_state(system, mechanism.assembly()),
        times,
        knots=np.array(knots),
        options=IntegrationOptions(tolerance=1e-6),
    )
    return system, solution


def test_tip_deflection_at_unit_speed(spin_up):
    """Computed with another formulation, all digits given."""
    system, solution = spin_up
    transverse = tip_deflection(system, "beam", solution.q)[:, 1]

    def at(t):
        return transverse[np.argmin(np.abs(solution.t - t))]

    assert at(5.0) == pytest.approx(-0.0797297245, abs=2e-6)
    assert at(10.0) == pytest.approx(-0.0833281499, abs=2e-6)
    lowest = np.argmin(transverse)
    assert transverse[lowest] == pytest.approx(-0.107011569, abs=2e-6)
    # The minimum is flat: 2e-6 of depth is 4e-3 s of time at this curvature.
    assert solution.t[lowest] == pytest.approx(7.879, abs=5e-3)


def test_work_of_the_prescribed_angle_is_the_energy(spin_up):
    _, solution = spin_up
    energy = solution.kinetic_energy + solution.strain_energy
    assert energy == pytest.approx(solution.work, abs=1e-4 * energy.max())
    # The rigid beam at full speed has half m L^2/3 w^2 = 200 J; the flexible one about that.
    assert energy[-1] == pytest.approx(200.0, rel=0.01)


def test_root_follows_the_law(spin_up):
    _, solution = spin_up
    assert solution.q[:, 2] == pytest.approx(angle(solution.t), abs=1e-6)
    assert solution.v[:, 2] == pytest.approx(rate(solution.t), abs=1e-5)
