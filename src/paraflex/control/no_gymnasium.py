"""What stands in for Gymnasium's environment where it is not installed: modules are imported, none can be made."""

from __future__ import annotations

from typing import Any

from paraflex.errors import InputError


class Env:
    """The base class of environments, of which none can be made.

    Raises
    ------
    InputError
        As one is made.
    """

    def __new__(cls, *args: Any, **settings: Any) -> Env:
        """See the class."""
        raise InputError(
            "environments need Gymnasium, which is not installed", field=cls.__name__,
            remedy="pip install 'paraflex[gym]'",
        )  # fmt: skip

    def __class_getitem__(cls, types: Any) -> type:
        """The class itself, whatever it observes."""
        return cls
