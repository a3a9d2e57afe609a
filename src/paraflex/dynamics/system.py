"""System of a mechanism: everything that does not depend on the coordinates, computed once."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import Array, Mask
from paraflex.kernel.constraints import constraint_values, fill_jacobian
from paraflex.kernel.packed import CONSTRAINT, PackedSystem, Signals, Workspace, make_scratch, make_workspace
from paraflex.limits import solvable
from paraflex.mechanism import Mechanism, PointRef, in_frames, rotor_mass, with_actuators
from paraflex.mechanism.masses import check_masses
from .body_bases import is_reduced, reduced_body
from .constraints import RowTerm, row_order, terms_by_joint
from .coordinates import BodyCoordinates, Marker, PlacedBodies, body_coordinates
from .damping import damping_matrix
from .packing import pack_system

# Up to this number of rows a dense factorisation with pivoting is as fast as a sparse one, and more accurate.
DENSE_ROWS = 400
# Damping ratio below which a vibration counts as undamped: it loses 1.2 % of its amplitude in a period.
_HARDLY_DAMPED = 2e-3
# Angular frequency of vibrations if none is known [rad/s].
_USUAL = 1e3

T = TypeVar("T")


@named_in_errors("a system", "the system that dynamics.build_system makes")
@dataclass(frozen=True)
class System(PlacedBodies):
    """A mechanism as constant arrays, made by `build_system`.

    Attributes
    ----------
    mechanism, bodies
        Mechanism, and the coordinates of each body: see `PlacedBodies`.
    packed : PackedSystem
        Arrays and records read by the kernels.
    rows : tuple of str
        Name of each constraint row ("B1 x", "crank angle"), in the order of the multipliers.
    """

    packed: PackedSystem
    rows: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of generalised coordinates."""
        return self.bodies[-1].all.stop

    @property
    def m(self) -> int:
        """Number of multipliers: constraint rows, springs, dampers and friction."""
        return len(self.rows)

    @property
    def n_constraints(self) -> int:
        """Number of constraint rows, without those of springs, dampers and friction."""
        return int(np.sum(self.constrained))

    @cached_property
    def constrained(self) -> Mask:
        """Mask (m,) of the constraint rows among all rows."""
        return self.packed.rows["kind"] == CONSTRAINT

    @property
    def n_flexible(self) -> int:
        """Number of flexible coordinates."""
        return sum(body.nf for body in self.bodies)

    @property
    def total_mass(self) -> float:
        """Mass of all bodies [kg], without the reflected inertia of rotors."""
        return float(self.packed.total_mass - rotor_mass(self.described))

    @property
    def size(self) -> float:
        """Reference length of tolerances [m]: see `dynamics.scale`."""
        return float(self.packed.size)

    @cached_property
    def units(self) -> Array:
        """Unit of each coordinate (n,): the size of the mechanism for positions, 1 for all others."""
        units = np.ones(self.n)
        for body in self.bodies:
            units[body.position] = self.size
        return units

    @cached_property
    def row_units(self) -> Array:
        """Unit of each constraint row (m,): the size for lengths, 1 for angles."""
        return np.real(self.packed.rows["unit"]).astype(float)

    @cached_property
    def slope_rows(self) -> scipy.sparse.csr_matrix:
        """Matrix from coordinates to slopes along all bodies (slopes, n)."""
        rows = scipy.sparse.lil_matrix((sum(len(body.shape.slopes) for body in self.bodies), self.n))
        first = 0
        for body in self.bodies:
            own = slice(first, first := first + len(body.shape.slopes))
            rows[own, body.flexible] = body.shape.slopes @ body.integrals.D
        return rows.tocsr()

    @cached_property
    def slowest(self) -> float:
        """Angular frequency of the slowest vibration of a flexible body [rad/s]; 1000 if there is none."""
        return min((float(np.min(body.modes.omega)) for body in self.bodies if body.nf), default=_USUAL)

    @cached_property
    def vibrations_die_out(self) -> bool:
        """Whether the fastest vibration of each flexible body is damped, so that runs need not follow it for long."""
        flexible = [body for body in self.bodies if body.nf]
        fastest = [(body, int(np.argmax(body.modes.omega))) for body in flexible]
        return all(body.damping[k, k] > 2.0 * _HARDLY_DAMPED * body.modes.omega[k] for body, k in fastest)

    def gap(self, phi: Array) -> float:
        """Return the largest violation among constraint rows (m,), lengths in sizes of the mechanism, angles in rad."""
        return float(np.max(np.abs(phi) / self.row_units, initial=0.0))

    def once(self, name: Hashable, make: Callable[[], T]) -> T:
        """Return a quantity that depends on the system alone, computed by `make` once and cached by name."""
        kept: dict[Hashable, Any] = vars(self).setdefault("_kept", {})
        if name not in kept:
            kept[name] = make()
        return kept[name]

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what `once` has cached: it is found by identities of objects, which copies do not have."""
        return {name: value for name, value in vars(self).items() if name != "_kept"}

    @cached_property
    def row_terms(self) -> dict[str, list[RowTerm]]:
        """Terms of constraint rows, by joint."""
        return terms_by_joint(row_order(self.mechanism))

    def body(self, name: str) -> BodyCoordinates:
        """Return the coordinates of a body by name; of a divided body those of its first part."""
        return self.bodies[self.index[name] if name in self.index else self.index[self.parts(name)[0]]]

    def marker(self, ref: PointRef) -> Marker:
        """Return the material point of a name, on a body as described or on a part of it."""
        cut = self.mechanism.cut
        own = ref if cut is None else cut.points.get(ref, ref)
        return self.once(own, lambda: PlacedBodies.marker(self, own))

    @property
    def described(self) -> Mechanism:
        """Mechanism as described by the user."""
        return self.mechanism.described

    def parts(self, name: str) -> tuple[str, ...]:
        """Return the parts of a body as described, from its first end; the body itself if it is not divided."""
        cut = self.mechanism.cut
        return (name,) if cut is None else cut.parts.get(name, (name,))

    def carrier(self, part: str) -> tuple[str, float]:
        """Return the described body that a part belongs to, and the distance along it at which the part starts [m]."""
        cut = self.mechanism.cut
        return (part, 0.0) if cut is None else cut.carriers.get(part, (part, 0.0))

    @cached_property
    def described_rows(self) -> tuple[str, ...]:
        """Names of the rows of the mechanism as described."""
        return tuple(label for one in row_order(self.described) for label in one.labels)

    def workspace(self) -> Workspace:
        """Return a new workspace for the kernels."""
        return make_workspace(self.packed)

    def constraints(self, signals: Signals, t: float, q: Array, v: Array | None = None) -> tuple[Array, Array]:
        """Return Phi and Phi' at (t, q, v), each (m,), at rest without v; zero in the rows of springs."""
        phi, rate = np.zeros(self.m), np.zeros(self.m)
        v = np.zeros(self.n) if v is None else v
        constraint_values(self.packed, signals, t, q, v, make_scratch(self.packed), phi, rate)
        return phi, rate

    def jacobian(self, q: Array) -> Array:
        """Return Phi_q at q, dense (m, n); zero in the rows of springs."""
        jacobian = np.zeros((self.m, self.n))
        fill_jacobian(self.packed, q, jacobian)
        return jacobian

    def dimensionless_jacobian(self, q: Array) -> Array:
        """Return Phi_q at q in units of the coordinates and of the rows."""
        return self.jacobian(q) * self.units / self.row_units[:, None]


@checked_arguments()
def build_system(mechanism: Mechanism, like: System | None = None) -> System:
    """Build the system of a mechanism, with flexible coordinates diagonalised per body.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    like : System, optional
        System of a mechanism with slightly different numbers: modes follow its modes in order and sign, so that
        coordinates of the two systems correspond.

    Returns
    -------
    System
        System of constant arrays.

    Raises
    ------
    InputError
        A rigid body has no mass, the mass matrix of a body is not positive definite, or `reduced_body` fails.
    ProportionError
        The damping of a body cannot be computed, for numbers too far apart.
    """
    check_masses(mechanism)
    mechanism = with_actuators(in_frames(mechanism))
    constraints = row_order(mechanism)
    modes = {} if like is None else {body.name: body.modes for body in like.bodies}
    reduced = [body.name for body in mechanism.bodies if is_reduced(mechanism, body)]
    others: dict[Hashable, BodyCoordinates] = {}
    whole = tuple(
        body_coordinates(body, mechanism.geometry, None if body.name in reduced else modes.get(body.name), others)
        for body in mechanism.bodies
    )
    undamped, offset, given = [], 0, PlacedBodies(mechanism, whole)
    for body in whole:
        if body.name in reduced:
            body = reduced_body(given, constraints, body.name, modes.get(body.name))
        undamped.append(replace(body, offset=offset))
        offset += 3 + body.nf
    bodies, placed = [], PlacedBodies(mechanism, tuple(undamped))
    for body in undamped:
        with solvable(f"the damping of {body.name}"):
            bodies.append(replace(body, damping=damping_matrix(placed, body.name)))
    return System(mechanism, tuple(bodies), *pack_system(PlacedBodies(mechanism, tuple(bodies)), constraints))


def with_constraints_of(system: System, mechanism: Mechanism) -> System:
    """Return the bodies of a system, with their damping, under the constraints of another mechanism of these bodies."""
    packed, rows = pack_system(PlacedBodies(mechanism, system.bodies), row_order(mechanism))
    return System(mechanism, system.bodies, packed, rows)
