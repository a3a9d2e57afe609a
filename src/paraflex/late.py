"""Functions of higher layers behind methods of lower ones, registered there by class and imported at the first call.

`paraflex/__init__.py`, which knows all layers, lists the modules that register them.
"""

from functools import singledispatch
from importlib import import_module
from typing import Any


def _unregistered(thing: object, *_: object) -> Any:
    raise TypeError(f"not registered for {type(thing).__name__}")


class Late:
    """Function of an object; `register(CLASS)` decorates the function for a class, as `functools.singledispatch` does.

    Attributes
    ----------
    modules : tuple of str
        Modules that register functions, imported in this order until one has registered that of the class.
    """

    def __init__(self) -> None:
        self.modules: tuple[str, ...] = ()
        self._functions = singledispatch(_unregistered)
        self.register: Any = self._functions.register

    def __call__(self, thing: object, *given: object) -> Any:
        """Call the function for the class of an object."""
        for module in self.modules:
            if self._functions.dispatch(type(thing)) is _unregistered:
                import_module(module)
        return self._functions(thing, *given)


# HTML of an object in notebooks; film of a run; file of a mechanism, written to a path.
view: Late = Late()
played: Late = Late()
save_file: Late = Late()
