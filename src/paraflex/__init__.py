"""paraflex: rigid-flexible dynamics of planar mechanisms with closed loops and several actuation modes.

The names below are the package's public ones; each is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.cache_folder import ensure_cache_folder

if TYPE_CHECKING:
    from paraflex import plots
    from paraflex.campaign import Workers
    from paraflex.checks import check
    from paraflex.errors import (
        InputError,
        ModelWarning,
        NumericalError,
        ParaflexError,
        ParaflexWarning,
        ResultWarning,
        StiffnessWarning,
        ValidityWarning,
    )
    from paraflex.files import Model, library_names, load, load_path
    from paraflex.integrators import METHODS, DeflectionLimit, IntegrationOptions, JointLimit, SingularDistance
    from paraflex.kinematics import Circle, Line, PointPath, Polygon
    from paraflex.mechanism import Mechanism, chain_of_segments, four_bars_in_a_row, raparm_i
    from paraflex.results import load_results, open_results, save_results, summary, tracking_dataset
    from paraflex.simulate import plan_tracking
    from paraflex.studies import (
        identify,
        load_identification,
        load_indices,
        load_optimisation,
        load_sensitivities,
        load_sweep,
        optimise,
        run_study,
        sensitivities,
        sobol_indices,
        sweep,
    )

_HOME = {
    "Circle": "kinematics",
    "DeflectionLimit": "integrators",
    "InputError": "errors",
    "IntegrationOptions": "integrators",
    "JointLimit": "integrators",
    "Line": "kinematics",
    "METHODS": "integrators",
    "Mechanism": "mechanism",
    "Model": "files",
    "ModelWarning": "errors",
    "NumericalError": "errors",
    "ParaflexError": "errors",
    "ParaflexWarning": "errors",
    "PointPath": "kinematics",
    "Polygon": "kinematics",
    "ResultWarning": "errors",
    "SingularDistance": "integrators",
    "StiffnessWarning": "errors",
    "ValidityWarning": "errors",
    "Workers": "campaign",
    "chain_of_segments": "mechanism",
    "check": "checks",
    "four_bars_in_a_row": "mechanism",
    "identify": "studies",
    "library_names": "files",
    "load": "files",
    "load_identification": "studies",
    "load_indices": "studies",
    "load_optimisation": "studies",
    "load_path": "files",
    "load_results": "results",
    "load_sensitivities": "studies",
    "load_sweep": "studies",
    "open_results": "results",
    "optimise": "studies",
    "plan_tracking": "simulate",
    "raparm_i": "mechanism",
    "run_study": "studies",
    "save_results": "results",
    "sensitivities": "studies",
    "sobol_indices": "studies",
    "summary": "results",
    "sweep": "studies",
    "tracking_dataset": "results",
}

__all__ = [
    "METHODS",
    "Circle",
    "DeflectionLimit",
    "InputError",
    "IntegrationOptions",
    "JointLimit",
    "Line",
    "Mechanism",
    "Model",
    "ModelWarning",
    "NumericalError",
    "ParaflexError",
    "ParaflexWarning",
    "PointPath",
    "Polygon",
    "ResultWarning",
    "SingularDistance",
    "StiffnessWarning",
    "ValidityWarning",
    "Workers",
    "chain_of_segments",
    "check",
    "four_bars_in_a_row",
    "identify",
    "library_names",
    "load",
    "load_identification",
    "load_indices",
    "load_optimisation",
    "load_path",
    "load_results",
    "load_sensitivities",
    "load_sweep",
    "open_results",
    "optimise",
    "plan_tracking",
    "plots",
    "raparm_i",
    "run_study",
    "save_results",
    "sensitivities",
    "sobol_indices",
    "summary",
    "sweep",
    "tracking_dataset",
]


ensure_cache_folder(Path(__file__).parent / "kernel")


def __getattr__(name: str) -> Any:
    if name == "plots":
        return import_module("paraflex.plots")
    if name in _HOME:
        return getattr(import_module(f"paraflex.{_HOME[name]}"), name)
    raise AttributeError(f"module 'paraflex' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
