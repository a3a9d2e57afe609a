"""Groups of members of a mechanism: description of each group, given once in `Members`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

from paraflex.mechanism.gears import Relation


@dataclass(frozen=True)
class Group:
    """A group of members that have names: joints, springs, loads.

    Attributes
    ----------
    table : str
        Its name in files, as in [spring.NAME]; errors name it.
    word : str
        What errors and tables call one of them.
    kinds : tuple of type
        Classes of members whose table in a file has the fields of the class; several have a `kind` each, which is the
        table's `type`. Without them `files` reads and writes the table in a way of its own.
    plural : str
        That of the word, by default with an s.
    engines : bool
        Whether Exudyn and MuJoCo can express them.
    resists : bool
        Whether they are forces of springs, dampers or friction. These do not constrain, and KED leaves them out.
    measures : bool
        Whether they are sensors, which do not act on the mechanism.
    """

    table: str
    word: str
    kinds: tuple[type, ...] = ()
    plural: str = ""
    engines: bool = False
    resists: bool = False
    measures: bool = False

    @property
    def relates(self) -> bool:
        """Whether its members relate the coordinates of joints."""
        return bool(self.kinds) and all(issubclass(kind, Relation) for kind in self.kinds)

    @property
    def one(self) -> str:
        """The word for one member, with its article."""
        return f"a{'n' if self.word[0] in 'aeiou' else ''} {self.word}"

    @property
    def words(self) -> str:
        """The word for several members."""
        return self.plural or f"{self.word}s"


def group(table: str, word: str, *kinds: type, **others: Any) -> Any:
    """The field of `Members` with the members of a group, by default none."""
    return field(default=(), metadata={"group": Group(table, word, kinds, **others)})


@cache
def groups_of(members: type) -> dict[str, Group]:
    """Groups of a mechanism by their fields."""
    return {each.name: each.metadata["group"] for each in fields(members) if "group" in each.metadata}


def grouped(mechanism: Any) -> Iterator[tuple[Group, tuple[Any, ...]]]:
    """Each group of a mechanism and its members."""
    for name, one in groups_of(type(mechanism)).items():
        yield one, getattr(mechanism, name)
