"""Kinds of control laws: each module of this folder defines one, `LAWS` has all of them by `type` in files."""

from importlib import import_module
from pkgutil import iter_modules

from paraflex.control.laws.law import LAWS as LAWS

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
