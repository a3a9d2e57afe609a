"""Kinds of results: one record for each, read by folders, storage, exports, figures, reports and commands."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from paraflex.errors import InputError

# Kinds of folders that are named in several places, as their manifests name them.
RUN = "run"
VERIFICATION = "verification"
COMPARISON = "comparison of methods"
LAW_COMPARISON = "comparison of control laws"
SENSITIVITY = "sensitivity"
RUN_COMPARISON = "comparison of runs"
STUDY_OF_RUNS = "study of many runs"


@dataclass(frozen=True)
class ResultKind:
    """Kind of results: the files that hold them, and the functions and words that apply to them.

    Attributes
    ----------
    name : str
        Name of the kind in datasets, in plain numbers and in the catalogue of figures.
    folder : str
        Kind of the folder that holds the results, as its manifest names it; empty if they have no folder.
    files : tuple of str
        Files by which the folder is recognised without a manifest, the summary first.
    data : str
        File with the data of figures and reports; empty for a table of many runs.
    producers : str
        Functions that make the dataset, in words; empty for results that are plain numbers.
    along : (str, str) or None
        Dimension along which the results go, and the name of the exported table over it; None without such a table.
    page : str
        Function of `paraflex.reports` for the report of a dataset, "module.function"; by default `kind_page`.
    with_folder : bool
        Whether that function also takes the folder, for the summary in it.
    figures : tuple of str
        Modules of `paraflex.figures` with the charts and tables of the results, or "module.figure" for one chart.
    drawings : tuple of str
        Names of the figures of the results that Matplotlib draws without charts.
    refusals : mapping of str to (str, str)
        Problem and remedy for what the results do not offer: "motion" (nothing moves), "page", "table".
    marks : mapping of str to Any
        Entries by which plain numbers of this kind are recognised: a value, or ... for any; empty for datasets.
    listed : bool
        Whether the plain numbers are a list of mappings with these entries.
    """

    name: str
    folder: str
    files: tuple[str, ...] = ()
    data: str = ""
    producers: str = ""
    along: tuple[str, str] | None = ("time", "time_series")
    page: str = ""
    with_folder: bool = False
    figures: tuple[str, ...] = ()
    drawings: tuple[str, ...] = ()
    refusals: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    marks: Mapping[str, Any] = field(default_factory=dict)
    listed: bool = False

    def refuse(self, offer: str, field: str) -> None:
        """Raise an `InputError` with the field and the remedy unless results offer "motion", "page" or "table"."""
        if offer in self.refusals:
            problem, remedy = self.refusals[offer]
            raise InputError(problem, field=field, remedy=remedy)


_NOTHING_MOVES = (
    "these results are not a run and show no motion",
    "paraflex plot draws them: deformed_shapes of equilibria, reduced_responses of models",
)
_DESIGN_DRAWINGS = ("response_map", "parallel_coordinates")
_RUN_FIGURES = ("controllers", "loads", "sensors")
_STUDY = ("study.json", "journal.sqlite", "results.parquet")
RESULT_KINDS: dict[str, ResultKind] = {kind.name: kind for kind in (
    ResultKind("sweep", STUDY_OF_RUNS, _STUDY, figures=("designs",), drawings=_DESIGN_DRAWINGS),
    ResultKind("optimisation", STUDY_OF_RUNS, _STUDY, "result.json", marks={"kind": "optimisation"},
               figures=("search.convergence", "designs"), drawings=_DESIGN_DRAWINGS),
    ResultKind("identification", STUDY_OF_RUNS, _STUDY, "result.json", marks={"kind": "identification"},
               figures=("search.convergence", "search.targets_reached", "designs"), drawings=_DESIGN_DRAWINGS),
    ResultKind("indices", STUDY_OF_RUNS, _STUDY, "indices.json", marks={"kind": "indices"},
               figures=("search.sobol_bars", "designs"), drawings=_DESIGN_DRAWINGS),
    ResultKind("verification", VERIFICATION, ("verify.json", "verify.nc"), "verify.nc", "Verification.dataset",
               page="verification.report_of_folder", with_folder=True,
               figures=("verification",)),
    ResultKind("methods", COMPARISON, ("compare-methods.json",), "compare-methods.json",
               marks={"methods": ..., "reference": ..., "fastest": ...},
               figures=("methods",)),
    ResultKind("laws", LAW_COMPARISON, ("laws.json", "laws.nc", "laws.csv"), "laws.nc", "compare_laws", None, refusals={
        "motion": ("a comparison of control laws keeps no motions",
                   "paraflex plot draws law_comparison; paraflex run --controller NAME keeps the motion of one law"),
        "page": ("a comparison of control laws has no report",
                 "laws.csv has its table, and paraflex plot draws law_comparison"),
    }, figures=("laws",)),
    ResultKind("runs", RUN_COMPARISON, ("compare.json",)),
    ResultKind("sensitivity", SENSITIVITY, ("sensitivity.json", "sensitivity.csv", "sensitivity.parquet"),
               "sensitivity.json", marks={"parameters": ..., "units": ..., "runs": ...},
               figures=("sensitivity",)),
    ResultKind("linear", "study of linear models", ("linear.json", "linear.nc"), "linear.nc", "linear_dataset", None,
               "linear.linear_page", figures=("linear",), refusals={
        "motion": ("these are linear models, not a run",
                   "their report.html shows mode shapes in motion, paraflex plot draws mode_shapes"),
        "table": ("linear models are matrices, not a table",
                  'export them as "mat" or "netcdf"; linear.json has poles and zeros'),
    },
               drawings=("mode_shapes",)),
    ResultKind("statics", "study of equilibria", ("statics.json", "statics.nc"), "statics.nc", "statics_dataset",
               ("step", "steps"), "statics.statics_page", figures=("equilibria",), refusals={"motion": _NOTHING_MOVES},
               drawings=("deformed_shapes", "buckling_shapes")),
    ResultKind("reduction", "study of reduced models", ("reduced.json", "reduced.nc"), "reduced.nc",
               "reduction_dataset", ("frequency", "frequencies"), "reduction.reduction_page", figures=("reduction",),
               refusals={"motion": _NOTHING_MOVES}),
    ResultKind("motion", RUN, ("summary.json", "results.nc"), "results.nc", "motion_dataset",
               page="motion.motion_page", figures=("run_motion", "motion", *_RUN_FIGURES),
               drawings=("mechanism_drawing",)),
    ResultKind("tracking", RUN, ("summary.json", "results.nc"), "results.nc", "tracking_dataset or run_study",
               page="tracking.report_of_folder", with_folder=True, figures=("tracking", "run_motion", *_RUN_FIGURES),
               drawings=("desired_path", "mechanism_drawing")),
    ResultKind("modes", "", marks={"mode": ..., "motors": ...}, listed=True, figures=("modes",)),
)}  # fmt: skip
# Files by which a folder without a manifest, from an earlier release, is recognised, by the kind of the folder.
FOLDER_FILES: dict[str, tuple[str, ...]] = {kind.folder: kind.files for kind in RESULT_KINDS.values() if kind.folder}
# Files of data that figures and reports are drawn of, those of runs first.
DATA_FILES: tuple[str, ...] = tuple(dict.fromkeys(kind.data for kind in reversed(RESULT_KINDS.values()) if kind.data))
