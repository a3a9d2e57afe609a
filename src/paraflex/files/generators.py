"""Library mechanisms of variable size: "four_bars:3" names a model of three four-bars in a row."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from paraflex.errors import InputError
from paraflex.mechanism import Mechanism, RigidBody, chain_of_segments, four_bars_in_a_row

# Reading a hundred thousand bodies alone takes minutes; a larger number is taken for a typing error.
_LARGEST_NUMBER = 100_000


@dataclass(frozen=True)
class _Generator:
    """Generator of a mechanism from a number, with the name of what is counted and further text of the file."""

    make: Callable[[int], Mechanism]
    counts: str
    heading: str
    ending: str


_GENERATORS: Mapping[str, _Generator] = {
    "four_bars": _Generator(
        four_bars_in_a_row,
        "loops",
        "# Four-bars in a row, neighbours sharing a crank: benchmark A02 of the IFToMM library of multibody problems.\n"
        "# All links are uniform rods of 1 kg and 1 m. The cranks start upright, their pins at +1 m/s in x.",
        "[start.velocity.angular]\ncrank0 = -1.0 # rad/s; the joints give the rest\n\n"
        "# From 0.71 s on all links lie in line twice a swing, in a singular position.\n"
        "[study]\nduration = 10.0 # s\nsamples = 1001\n",
    ),
    "chain": _Generator(
        chain_of_segments,
        "segments",
        "# A cable of rigid segments with torsional springs that falls from the horizontal, held at one end.\n"
        "# The numbers are ours: 1 m, 1 kg, bending stiffness 0.02 N m^2 at any number of segments.",
        "[study]\nduration = 1.0 # s\nsamples = 1001\n",
    ),
}


def generator_names() -> list[str]:
    """Return the names of generated mechanisms; N stands for a number."""
    return [f"{name}:N" for name in _GENERATORS]


def is_generated(name: str) -> bool:
    """Check whether a name is that of a generated mechanism, with or without a number."""
    return name.partition(":")[0] in _GENERATORS


def generated_text(name: str) -> str:
    """Return the text of the model file of a generated mechanism, such as "four_bars:3".

    Raises
    ------
    InputError
        Missing or invalid number.
    """
    base, _, number = name.partition(":")
    generator = _GENERATORS[base]
    if not (number.isascii() and number.isdigit() and 0 < int(number[:9]) <= _LARGEST_NUMBER and len(number) < 9):
        raise InputError(
            f"a mechanism of how many {generator.counts}?",
            field="mechanism",
            value=name,
            remedy=f"write {base}:3, at most {base}:{_LARGEST_NUMBER}",
        )
    return "\n".join(_lines(generator, generator.make(int(number))))


def _lines(generator: _Generator, mechanism: Mechanism) -> Iterator[str]:
    """Yield the lines of the file of a mechanism of rigid bodies, revolute joints and torsional springs."""
    yield generator.heading
    yield f'\nname = "{mechanism.name}"'
    yield f'description = "{mechanism.description}"'
    yield f"gravity = {list(mechanism.gravity)} # m/s^2\n"
    yield "# Pins [x, y] in m.\n[ground]"
    yield from (f"{name} = {list(place)}" for name, place in mechanism.ground.items())
    for body in mechanism.bodies:
        yield from _rigid_body(body)
    yield "\n[joint]"
    yield from (f'{joint.name} = ["{joint.a}", "{joint.b}"]' for joint in mechanism.joints)
    for spring in mechanism.springs:
        yield f'\n[spring.{spring.name}]\njoint = "{spring.joint}"\nstiffness = {spring.stiffness} # N m/rad'
    for assembly in mechanism.assemblies:
        yield f"\n# Angles in rad.\n[assembly.{assembly.name}]"
        yield from (f"{name} = {angle}" for name, angle in assembly.angles.items())
    yield f"\n{generator.ending}"


def _rigid_body(body: object) -> Iterator[str]:
    assert isinstance(body, RigidBody)
    points = ", ".join(f"{name} = {list(place)}" for name, place in body.points.items())
    yield f'\n[body.{body.name}]\ntype = "rigid"\nmass = {body.mass} # kg\ninertia = {body.inertia} # kg m^2'
    yield f"centre_of_mass = {list(body.centre_of_mass)} # m\npoints = {{ {points} }}"
