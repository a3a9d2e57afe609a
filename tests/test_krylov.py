"""Stages whose corrections with the iteration matrix of a run grow: the exact linear system is solved all the same."""

import numpy as np
import pytest

import twins
from paraflex.dynamics import build_system
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.krylov import exact_correction, make_krylov
from paraflex.kernel.linear import factor_system, solve_system
from paraflex.kernel.tangent import make_tangent, note_slopes, residual_tangent
from paraflex.mechanism import Geometry, raparm_i

ALPHA, BETA = 40.0, 40.0
WEIGHTS = (1.0, 2.0 * ALPHA, BETA * BETA)


class Stage:
    """A stage of RAParM-I at a random state whose constraint forces are large beside the masses over the step."""

    def __init__(self, geometry, forces, gamma):
        mechanism = raparm_i().with_geometry(geometry)
        self.system = system = build_system(mechanism)
        self.p, self.ws, self.gamma, self.b = system.packed, system.workspace(), gamma, gamma**2
        self.q, self.v, self.a = twins.random_state(system, 5)
        random = np.random.default_rng(7)
        self.lam, self.torques = forces * random.standard_normal(system.m), np.zeros(len(mechanism.motors))
        note_friction(self.p, self.q, self.v, self.ws.mu, self.ws.compliance)
        if self.ws.geometric is not None:
            self.ws.geometric[:] = 0.0
        factor_system(self.p, self.b, self.q, self.ws)
        self.ws.step[0] = self.b
        self.d = make_tangent(self.p)
        note_slopes(self.p, self.q, self.v, self.ws.mu, self.ws.compliance, self.d)
        self.residual = random.standard_normal(system.n + system.m)

    def times(self, z):
        """The exact matrix of the stage times (a, lambda)."""
        n, d = self.system.n, self.d
        d.q[:], d.v[:], d.a[:], d.lam[:] = self.b * z[:n], self.gamma * z[:n], z[:n], z[n:]
        bodies = (0, len(self.system.bodies), d)
        state = (self.q, self.v, self.a, self.lam, self.torques, self.ws.compliance)
        residual_tangent(self.p, WEIGHTS, *state, *bodies)
        return np.concatenate([d.f, d.rows])

    def correct(self, residual):
        """The correction of a run, left in the workspace."""
        n, scale = self.system.n, 1.0 / (WEIGHTS[0] + WEIGHTS[1] * self.gamma + WEIGHTS[2] * self.b)
        self.ws.x[:], self.ws.mu[:] = -residual[:n], -scale * residual[n:]
        solve_system(self.p, self.ws, self.ws.x, self.ws.mu)
        return self.in_workspace()

    def in_workspace(self):
        return np.concatenate([self.ws.x, self.ws.mu])


@pytest.mark.parametrize("geometry", list(Geometry))
def test_exact_corrections_solve_what_those_of_a_run_make_worse(geometry):
    stage = Stage(geometry, forces=3e3, gamma=3e-3)
    simple, sizes = np.zeros(stage.residual.size), []
    for _ in range(30):
        correction = stage.correct(stage.residual + stage.times(simple))
        simple += correction
        sizes.append(np.abs(correction).max())
    assert sizes[-1] > 10.0 * sizes[0]
    stage.correct(stage.residual)
    space = make_krylov(stage.system.n, stage.system.m)
    arguments = (stage.p, stage.gamma, stage.b, WEIGHTS, stage.q, stage.v, stage.a, stage.lam, stage.torques)
    z = np.zeros(stage.residual.size)
    for _ in range(3):
        stage.correct(stage.residual + stage.times(z))
        exact_correction(*arguments, 1e-3, stage.d, space, stage.ws)
        z += stage.in_workspace()
    columns = np.array([stage.times(unit) for unit in np.eye(z.size)]).T
    assert z == pytest.approx(np.linalg.solve(columns, -stage.residual), rel=1e-5, abs=1e-7 * np.abs(z).max())


def test_nothing_is_corrected_by_nothing():
    stage = Stage(Geometry.LINEAR, forces=1.0, gamma=1e-4)
    stage.correct(np.zeros(stage.residual.size))
    arguments = (stage.p, stage.gamma, stage.b, WEIGHTS, stage.q, stage.v, stage.a, stage.lam, stage.torques)
    exact_correction(*arguments, 1.0, stage.d, make_krylov(stage.system.n, stage.system.m), stage.ws)
    assert not stage.in_workspace().any()
