"""Substitute for Gymnasium's base class if that is not installed: modules can be imported, but make no environments."""

from typing import Any

from paraflex.errors import InputError


class Env:
    """Substitute base class of environments, which cannot be instantiated.

    Raises
    ------
    InputError
        Gymnasium is not installed; raised when an environment is made.
    """

    def __new__(cls, *args: Any, **settings: Any) -> "Env":
        """Raise the error that Gymnasium is not installed."""
        raise InputError(
            "environments need Gymnasium, which is not installed", field=cls.__name__,
            remedy="pip install 'paraflex[gym]'",
        )  # fmt: skip

    def __class_getitem__(cls, types: Any) -> type:
        """Return the class itself for any type parameters."""
        return cls
