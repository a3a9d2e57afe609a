"""paraflex: rigid-flexible dynamics of planar mechanisms with closed loops and several actuation modes.

Each public name is imported at its first use; `__init__.pyi` lists all public names in groups.
"""

import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import lazy_loader

from .cache_folder import ensure_cache_folder
from .late import played, save_file, view

ensure_cache_folder(Path(__file__).parent / "kernel")

# Modules that register functions of objects of lower layers.
view.modules = ("paraflex.results.html", "paraflex.plots.mechanism_html", "paraflex.studies.html")
played.modules = ("paraflex.plots.film",)
save_file.modules = ("paraflex.files.model",)

_loaded, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# Deprecated names of the previous version: the module and the new name of each.
_RENAMED = {
    "chain_of_segments": ("mechanism", "library.chain_of_segments"),
    "four_bars_in_a_row": ("mechanism", "library.four_bars_in_a_row"),
    "library_names": ("files", "library.names"),
    "plan_tracking": ("tracking", "plan"),
    "raparm_i": ("mechanism", "library.raparm_i"),
    "sobol_indices": ("studies.indices", "indices"),
}


def __getattr__(name: str) -> Any:
    if name in __all__:
        return _loaded(name)
    if name not in _RENAMED:
        raise AttributeError(f"module 'paraflex' has no attribute {name!r}")
    home, now = _RENAMED[name]
    warnings.warn(f"pf.{name} is called pf.{now} now", DeprecationWarning, stacklevel=2)
    module, _, renamed = home.partition(".")
    return getattr(import_module(f"paraflex.{module}"), renamed or name)
