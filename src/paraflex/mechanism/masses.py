"""Masses of rigid bodies, which dynamics needs and kinematics does without."""

import math
from dataclasses import replace

from paraflex.errors import InputError
from .bodies import RigidBody
from .mechanism import Mechanism
from .poses import local_points


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
    """Return the mechanism with any masses where rigid bodies have none, for motions that do not depend on them.

    Radii of gyration are the size of the largest body: with others, closure of very small loops would be inaccurate.
    """
    places = [math.hypot(*place) for body in mechanism.bodies for place in local_points(body).values()]
    radius = max(places, default=0.0) or 1.0
    bodies = tuple(
        replace(body, mass=body.mass or 1.0, inertia=body.inertia or (body.mass or 1.0) * radius**2)
        if isinstance(body, RigidBody) and not (body.mass and body.inertia) else body for body in mechanism.bodies
    )  # fmt: skip
    return mechanism if bodies == mechanism.bodies else replace(mechanism, bodies=bodies)
