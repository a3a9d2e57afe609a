"""Groups of members of a mechanism, each described once, in `Members`."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

from .gears import Relation


@dataclass(frozen=True)
class Group:
    """Group of named members, such as joints, springs or loads.

    Attributes
    ----------
    table : str
        Name of the table in files, as in [spring.NAME]; errors quote it.
    noun : str
        Noun for a member in errors and tables.
    kinds : tuple of type
        Classes of members whose table in a file has the fields of the class. Where there are several, each has a
        `kind`, which is the table's `type`. Without classes `files` reads and writes the table by its own code.
    plural : str
        Plural of the noun, by default the noun with an s.
    engines : bool
        Whether Exudyn and MuJoCo can represent the members.
    resists : bool
        Whether the members are forces of springs, dampers or friction. They impose no constraints, and
        kineto-elastodynamics (KED) refuses them.
    measures : bool
        Whether the members are sensors, which do not act on the mechanism.
    """

    table: str
    noun: str
    kinds: tuple[type, ...] = ()
    plural: str = ""
    engines: bool = False
    resists: bool = False
    measures: bool = False

    @property
    def relates(self) -> bool:
        """Whether the members relate the coordinates of joints."""
        return bool(self.kinds) and all(issubclass(kind, Relation) for kind in self.kinds)

    @property
    def one(self) -> str:
        """Noun for a member with its article."""
        return f"a{'n' if self.noun[0] in 'aeiou' else ''} {self.noun}"

    @property
    def plural_noun(self) -> str:
        """Noun for several members."""
        return self.plural or f"{self.noun}s"


def group(table: str, noun: str, *kinds: type, **others: Any) -> Any:
    """Return the dataclass field of `Members` for a group, by default empty."""
    return field(default=(), metadata={"group": Group(table, noun, kinds, **others)})


@cache
def groups_of(members: type) -> dict[str, Group]:
    """Return the groups of a mechanism's class by the names of their fields."""
    return {each.name: each.metadata["group"] for each in fields(members) if "group" in each.metadata}


def grouped(mechanism: Any) -> Iterator[tuple[Group, tuple[Any, ...]]]:
    """Yield each group of a mechanism and its members."""
    for name, one in groups_of(type(mechanism)).items():
        yield one, getattr(mechanism, name)
