"""Our own methods on a stiff flexible mechanism with a loop: orders, treatments of constraints, steps, bad input."""

from functools import cache

import numpy as np
import pytest

from paraflex.dynamics import build_system, consistent_state
from paraflex.errors import InputError, IntegrationError
from paraflex.integrators import METHODS, IntegrationOptions, integrate
from paraflex.integrators.methods import Family
from paraflex.kernel.packed import Signals
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    ModalDamping,
    Motor,
    PointRef,
    RevoluteJoint,
    Section,
)

END, TORQUE = 0.05, 3.0
NATIVE = [name for name, method in METHODS.items() if method.family in (Family.ESDIRK, Family.NEWMARK)]


def four_bar(modes=None, ratio=0.05, geometry=Geometry.LINEAR) -> Mechanism:
    """Three strips of steel; frequencies from 130 to 290,000 rad/s, or to 3,200 with two modes a link."""

    def link(name, length, a, b):
        return FlexibleBeam(
            name, length, Section.rectangle(0.02, 0.003), Material(210e9, 7850.0), points={a: 0.0, b: length},
            elements=2, modes=modes, damping=ModalDamping((ratio,)) if ratio else None,
        )  # fmt: skip

    ends = {"O": ("ground", "crank"), "A": ("crank", "coupler"), "B": ("coupler", "rocker"), "Q": ("ground", "rocker")}
    return Mechanism(
        name="four-bar",
        ground={"O": (0.0, 0.0), "Q": (0.4, 0.0)},
        bodies=(link("crank", 0.1, "O", "A"), link("coupler", 0.35, "A", "B"), link("rocker", 0.25, "Q", "B")),
        joints=tuple(RevoluteJoint(k, PointRef(a, k), PointRef(b, k)) for k, (a, b) in ends.items()),
        motors=(Motor("drive", "O"),),
        assemblies=(Assembly("open", {"crank": 1.0, "coupler": 0.4, "rocker": 1.6}),),
        geometry=geometry,
    )


@cache
def started(modes=None, ratio=0.05, geometry=Geometry.LINEAR):
    system = build_system(four_bar(modes, ratio, geometry))
    return system, consistent_state(system, system.mechanism.assembly())


def smooth_torque() -> Signals:
    """Grows with the fourth power of time: nothing rings, all is as smooth as theory asks."""
    pieces = np.zeros((2, 6))
    pieces[0, 4], pieces[0, 5] = TORQUE / END**4, -0.5 * TORQUE / END**5
    return Signals(np.array([0, 2]), np.array([0.0, END]), pieces)


def run(system, state, method, *, steps=None, times=(END,), tolerance=1e-3, newton=1e-7, **options):
    step = None if steps is None else END / steps
    chosen = IntegrationOptions(method=method, step=step, tolerance=tolerance, newton_fraction=newton, **options)
    return integrate(system, smooth_torque(), state, np.array(times), options=chosen)


def ends(solution):
    return solution.q[-1], solution.v[-1], solution.multipliers[-1]


@cache
def exact(modes=None, ratio=0.05):
    return ends(run(*started(modes, ratio), "esdirk5", steps=6000))


def errors(method, steps, modes=None, ratio=0.05, **options):
    """Largest of positions, velocities and multipliers for each number of steps: (steps, 3)."""
    found = [ends(run(*started(modes, ratio), method, steps=n, **options)) for n in steps]
    return np.array([[np.max(np.abs(a - b)) for a, b in zip(one, exact(modes, ratio), strict=True)] for one in found])


def orders(errors):
    return np.log2(errors[:-1] / errors[1:])
