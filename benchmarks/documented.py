"""Numbers of the pages: measured, kept as JSON, and put where the pages show them.

    python benchmarks/documented.py measure NAME ...   # or all: writes benchmarks/measured/NAME.json
    python benchmarks/documented.py write              # numbers from there onto the pages
    python benchmarks/documented.py run PAGE ...       # or all: what blocks of a page print, and numbers that follow

A number on a page stands between comments, `<!--=NAME.KEY FACTOR FORMAT-->0.099<!--/-->`: a key of NAME.json, what it
is multiplied by, and Python's format. `<!--=run FORMAT EXPRESSION-->` takes an expression of what the page's own blocks
leave. Tests hold the pages against both.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from common import write_json

ROOT = Path(__file__).parents[1]
DOCS, EXAMPLES, MEASURED = ROOT / "docs", ROOT / "examples", Path(__file__).parent / "measured"
KEPT = Path(__file__).parent / "results"
RUN_PAGES = ("index.md", "tutorial.md", "first-mechanism.md", "modes.md")
# What pages show until something has been measured.
NOT_MEASURED = "(not measured)"
MARK = re.compile(r"<!--=(?P<what>[^>]+?)-->(?P<shown>.*?)<!--/-->", re.DOTALL)


def pages() -> Iterator[Path]:
    """Every page with numbers of its own."""
    yield from (ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted(EXAMPLES.glob("*.toml")))


def number(what: str) -> str:
    """What a mark asks for, as text; `run` marks are left to `numbers_of_run`."""
    key, factor, form = what.split()
    name, *path = key.split(".")
    file = MEASURED / f"{name}.json"
    if not file.exists():
        return NOT_MEASURED
    value: Any = json.loads(file.read_text(encoding="utf-8"))
    for part in path:
        value = value[int(part)] if isinstance(value, list) else value[part]
    return value if isinstance(value, str) else format(float(factor) * value, form)


def filled(text: str, of_run: dict[str, Any] | None = None) -> str:
    """A page with the numbers that its marks ask for; those of its own blocks from the names these leave."""

    def put(found: re.Match[str]) -> str:
        what, shown = found["what"], found["shown"]
        if not what.startswith("run "):
            shown = number(what)
        elif of_run is not None:
            _, form, expression = what.split(maxsplit=2)
            shown = format(eval(expression, of_run), form)
        return f"<!--={what}-->{shown}<!--/-->"

    return MARK.sub(put, text)


def search(kind: str, file: str, folder: str | Path, **changes: Any) -> dict[str, Any]:
    """A search as its example has it, or with other settings; its figures, and how long it took."""
    import paraflex.studies as studies

    load = {"optimise": studies.load_optimisation, "identify": studies.load_identification}[kind]
    study = load(EXAMPLES / file)
    study = dataclasses.replace(study, search=dataclasses.replace(study.search, **changes))
    result = getattr(studies, kind)(study, folder)
    if not changes:
        draw({"optimise": "optimisation", "identify": "identification"}[kind], result.to_dict())
    return {name: value for name, value in result.to_dict().items() if name != "history"} | {"seconds": result.seconds}


# Pictures of the pages, by what they are of: the figure that the command writes, and its name there.
PICTURES = {
    "optimisation": ("convergence", "optimisation_convergence"),
    "identification": ("targets", "identification_targets"),
    "indices": ("indices", "sobol_indices"),
}


def draw(kind: str, figures: dict[str, Any]) -> None:
    """Bring the picture on the page up to date."""
    from paraflex.plots import save_figures

    written, shown = PICTURES[kind]
    with tempfile.TemporaryDirectory() as folder:
        save_figures({"kind": kind} | figures, folder)
        shutil.copyfile(Path(folder) / f"{written}.png", DOCS / "images" / f"{shown}.png")


def optimisation() -> dict[str, Any]:
    """The example of docs/optimisation.md."""
    with tempfile.TemporaryDirectory() as folder:
        return search("optimise", "optimisation.toml", folder)


def methods() -> dict[str, Any]:
    """Other methods on the same study, from the same samples."""
    limits = {"slsqp": 500, "trust-constr": 500, "optuna": 400, "differential-evolution": 400}
    found = {}
    for name, limit in limits.items():
        with tempfile.TemporaryDirectory() as folder:
            found[name.replace("-", "_")] = search(
                "optimise", "optimisation.toml", folder, method=name, evaluations=limit
            )
    return found


def identification() -> dict[str, Any]:
    """The published RAParM-I, from its example; targets by their mode and metric. Goes on where it was stopped."""
    found = search("identify", "identification.toml", KEPT / "identification")
    targets = {f"{each['mode']} {each['metric']}".replace(" ", "_"): each for each in found["targets"]}
    for each in targets.values():
        each["start_off"] = 100.0 * (each["start"] / each["value"] - 1.0)
        each["off"] = 100.0 * (each["reached"] / each["value"] - 1.0)
    deviations = (found["confidence"] or {}).get("deviations", {})
    shown = dict.fromkeys(found["values"], "not given")
    for name, value in deviations.items():
        if value is not None:
            shown[name] = f"{value:.2g} kg" if name.endswith("mass") else f"{1e3 * value:.2g} mm"
    reasons = list(dict.fromkeys((found["confidence"] or {}).get("reasons", {}).values()))
    why = "not given: " + "; ".join(reasons) if reasons else "given of all parameters"
    return found | {"targets": targets, "shown": shown, "why": why}


GRADIENTS = """
mechanism = "raparm_i"
paths = ["square"]
modes = ["++++"]
duration = 0.1
samples = 101
metrics = ["tracking_rms"]
[integration]
method = "esdirk5"
tolerance = 1e-4
[objective]
minimise = {{ tracking_rms = 1.0, peak_torque_max = 1.0 }}
[search]
gradients = "{}"
[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.003
high = 0.010
scale = "log"
[vary.end_mass]
fields = ["lump.end.mass"]
low = 0.1
high = 0.4
"""


def gradients() -> dict[str, Any]:
    """One optimisation by differences and by exact gradients; kernels are compiled before."""
    from paraflex.studies import load_optimisation, optimise

    found = {}
    for kind in ("differences", "exact"):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "study.toml"
            file.write_text(GRADIENTS.format(kind), encoding="utf-8")
            study = load_optimisation(file)
            few = dataclasses.replace(study, search=dataclasses.replace(study.search, evaluations=2))
            optimise(few, Path(folder) / "compiled")
            result = optimise(study, Path(folder) / "out")
            found[kind] = {
                "objective": result.objective, "evaluations": result.evaluations, "seconds": result.seconds,
            }  # fmt: skip
    return found


def indices() -> dict[str, Any]:
    """Sobol indices of the study of docs/optimisation.md."""
    from paraflex.studies import indices

    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        chosen = {"metrics": ["tracking_rms", "peak_torque_max"], "samples": 128, "seed": 1}
        result = indices(EXAMPLES / "optimisation.toml", folder, **chosen)
        draw("indices", result.to_dict())
        rows: dict[str, dict[str, Any]] = {}
        for row in result.to_dict()["indices"]:
            rows.setdefault(row["metric"], {})[row["parameter"]] = row
        return {"runs": result.sweep.total, "seconds": time.perf_counter() - began, **rows}


SCALES = ("material.aluminium.density", "material.aluminium.youngs_modulus", "lump.joint.mass", "lump.joint.inertia",
          "lump.end.mass", "lump.end.inertia")  # fmt: skip


FIXED_AND_CONTROLLED = {
    "fixed": 'method = "tr-bdf2"\nstep = 2e-3\ntolerance = 1e-11\n',
    "controlled": 'method = "esdirk5"\ntolerance = 1e-4\n',
}


def sensitivities() -> dict[str, Any]:
    """Exactness by the law of scale, and processor time of parameters in runs."""
    from paraflex.designs.run import Task, run_task
    from paraflex.studies import load_sensitivities, sensitivities as differentiate

    head = 'mechanism = "raparm_i"\npaths = ["line"]\nmodes = ["++++"]\nduration = 0.06\nsamples = 61\n'
    head += 'metrics = ["tracking_rms", "tracking_max"]\n[integration]\n'
    vary = "".join(f'[vary.p{k}]\nfields = ["{field}"]\n' for k, field in enumerate(SCALES))
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "study.toml"
        for name, more in FIXED_AND_CONTROLLED.items():
            file.write_text(head + more + vary, encoding="utf-8")
            study = load_sensitivities(file)
            differentiate(study)
            began = time.process_time()
            result = differentiate(study)
            seconds = time.process_time() - began
            task = Task(0, 0, tuple(result.nominal), "line")
            began = time.process_time()
            run_task(study.setting, task)
            of_run = time.process_time() - began
            off = abs(result.relative.sum(axis=2)).max() / abs(result.relative).max()
            found[name] = {"law_of_scale": float(off), "seconds": seconds, "run_seconds": of_run,
                           "runs_a_parameter": (seconds / of_run - 1.0) / len(SCALES)}  # fmt: skip
    return found


MEASUREMENTS: dict[str, Callable[[], dict[str, Any]]] = {
    "optimisation": optimisation,
    "optimisation_methods": methods,
    "identification": identification,
    "gradients": gradients,
    "indices": indices,
    "sensitivities": sensitivities,
}


def run(page: Path) -> None:
    """Bring what a page shows of its own blocks up to what these print."""
    sys.path.append(str(ROOT / "tests"))
    import pytest

    from pages import refreshed  # pyright: ignore[reportMissingImports]

    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        text = refreshed(page, Path(folder), patch, filled)
    page.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=["measure", "write", "run"])
    parser.add_argument("names", nargs="*", help="what to measure, or pages")
    given = parser.parse_args()
    if given.task == "measure":
        for name in given.names or MEASUREMENTS:
            write_json(name, MEASUREMENTS[name](), str(MEASURED))
    elif given.task == "run":
        for name in given.names or RUN_PAGES:
            run(DOCS / name)
    if given.task != "run":
        for page in pages():
            text = page.read_text(encoding="utf-8")
            if MARK.search(text):
                page.write_text(filled(text), encoding="utf-8")


if __name__ == "__main__":
    main()
