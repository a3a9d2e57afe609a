"""Masses of rigid bodies, which dynamics needs and kinematics does without."""

from dataclasses import replace

from paraflex.errors import InputError
from .bodies import RigidBody
from .mechanism import Mechanism


def check_masses(mechanism: Mechanism) -> None:
    """Check that every rigid body has a mass and a moment of inertia.

    Raises
    ------
    InputError
        A body has none.
    """
    for body in mechanism.bodies:
        if isinstance(body, RigidBody) and not body.mass:
            raise InputError(
                "is missing, and forces depend on it", field=f"body.{body.name}.mass",
                remedy="give mass in kg and inertia in kg m^2; paraflex kinematics does without, and a rod without "
                'mass between two pins is a joint of type = "distance"',
            )  # fmt: skip


def with_any_masses(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with any masses where rigid bodies have none, for motions that do not depend on them."""
    bodies = tuple(
        replace(body, mass=body.mass or 1.0, inertia=body.inertia or 1.0)
        if isinstance(body, RigidBody) and not (body.mass and body.inertia) else body for body in mechanism.bodies
    )  # fmt: skip
    return mechanism if bodies == mechanism.bodies else replace(mechanism, bodies=bodies)
