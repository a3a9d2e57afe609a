"""View of a mechanism in notebooks: its members and a sketch."""

import re
from typing import Any

from paraflex.display import facts, page, sentence, table
from paraflex.dynamics.constraints import constraint_count
from paraflex.late import view
from paraflex.mechanism import Body, Mechanism, grouped, loops
from .svg import sketch

# Largest number of bodies, joints or modes listed one by one.
_MOST_LISTED = 40
# Groups that are listed elsewhere on the page; of the others only the number of members is shown.
_LISTED_GROUPS = ("body", "joint", "motor", "assembly", "mode")


@view.register(Mechanism)
def mechanism_html(mechanism: Mechanism) -> str:
    """Return the HTML view of a mechanism: bodies, joints, motors, freedoms and a sketch of the first assembly."""
    rows = [(body.name, _words(body), getattr(body, "length", None), ", ".join(body.points))
            for body in mechanism.bodies]  # fmt: skip
    joints = [(joint.name, joint.kind, f"{joint.a} – {joint.b}") for joint in mechanism.joints]
    return page(
        mechanism.name,
        sentence(mechanism.description),
        sketch(mechanism),
        facts(_counts(mechanism)),
        _few("bodies", ("body", "kind", "length [m]", "points"), rows),
        _few("joints", ("joint", "kind", "of"), joints),
    )


def freedoms(mechanism: Mechanism) -> int:
    """Return the degrees of freedom of the rigid mechanism by Grübler's formula, which ignores redundancy."""
    return 3 * len(mechanism.bodies) - constraint_count(mechanism)


def _counts(mechanism: Mechanism) -> list[tuple[str, Any]]:
    units = mechanism.motor_units()
    effector = mechanism.end_effector
    flexible = sum(bool(getattr(body, "flexible", False)) for body in mechanism.bodies)
    motors = [f"{motor.name} at {motor.joint} [{unit}]" for motor, unit in zip(mechanism.motors, units, strict=True)]
    return [
        ("bodies", f"{len(mechanism.bodies)}, {flexible} of them flexible"),
        ("joints", len(mechanism.joints)),
        ("closed loops", len(loops(mechanism))),
        ("degrees of freedom (Grübler)", freedoms(mechanism)),
        ("motors", motors),
        ("end-effector", None if effector is None else f"{effector.point}: {', '.join(effector.coordinates)}"),
        ("actuation modes", [mode.name for mode in mechanism.modes[:_MOST_LISTED]]),
        ("assemblies", [assembly.name for assembly in mechanism.assemblies]),
        ("geometry of flexible bodies", mechanism.geometry.value),
        *(
            (group.plural_noun, len(members))
            for group, members in grouped(mechanism)
            if members and group.table not in _LISTED_GROUPS
        ),
    ]


def _few(what: str, headings: tuple[str, ...], rows: list[tuple]) -> str:
    """Return a table of the first rows, and the number of the others."""
    more = len(rows) - _MOST_LISTED
    return table(headings, rows[:_MOST_LISTED]) + (sentence(f"and {more} more {what}") if more > 0 else "")


def _words(body: Body) -> str:
    """Return the class of a body in words, "flexible beam", with a remark if the body is held rigid."""
    text = re.sub(r"(?<!^)(?=[A-Z])", " ", type(body).__name__).lower()
    return f"{text}, held rigid" if getattr(body, "flexible", True) is False else text
