"""Every figure of the catalogue for the gallery of the documentation.

    python docs/make_gallery.py            # makes results in results/gallery, the figures, and docs/gallery.md
    python docs/make_gallery.py --results DIR

Results that are there already are taken as they are.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from paraflex.plots.catalogue import CATALOGUE, CatalogueFigure
from paraflex.plots.planned import drawings, figures_of
from paraflex.plots.save import write_figures
from paraflex.plots.sources import Source, open_source

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "gallery"

SHARED = """
mechanism = "five_bar"
paths = ["square"]
modes = ["++"]
"""
# Derivatives of a run follow its errors of integration.
FINE = "[integration]\ntolerance = 1e-6\n"
VARIED = """
[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.009

[vary.joint_mass]
fields = ["lump.joint.mass"]
low = 0.05
high = 0.25

[vary.modulus]
fields = ["material.aluminium.youngs_modulus"]
low = 60e9
high = 80e9
"""
METRICS = 'metrics = ["tracking_rms", "peak_torque_max", "deflection_max", "total_mass"]\n'
STUDIES = {
    "sweep": METRICS + SHARED + '[sampling]\nkind = "sobol"\nnumber = 128\nseed = 1\n' + VARIED,
    "optimisation": METRICS
    + SHARED
    + "[objective]\nminimise = { tracking_rms = 1.0, peak_torque_max = 1.0 }\n"
    + '[search]\nmethod = "nelder-mead"\nevaluations = 80\nsamples = 16\nseed = 1\n'
    + VARIED,
    "identification": METRICS
    + SHARED
    + '[[target]]\nmetric = "tracking_rms"\nvalue = 1.15e-4\n'
    + '[[target]]\nmetric = "peak_torque_max"\nvalue = 9.63\n'
    + '[[target]]\nmetric = "total_mass"\nvalue = 1.836\n'
    + '[search]\nevaluations = 40\ngradients = "exact"\n'
    + VARIED,
    "indices": METRICS + SHARED + "[sampling]\nnumber = 32\nseed = 1\n" + VARIED,
    "sensitivity": METRICS + SHARED + FINE + VARIED,
}
METHODS = ("tr-bdf2", "esdirk3", "esdirk4", "esdirk5", "newmark", "generalised-alpha")
# What each kind of results is made by; {} is its folder.
COMMANDS = {
    "tracking": ["run", "--mechanism", "raparm_i", "--geometry", "second-order", "--out", "{}"],
    "motion": ["run", "--mechanism", "four_bar", "--out", "{}"],
    "verification": ["verify", "--mechanism", "five_bar", "--out", "{}"],
    "linear": [
        "linearise", "raparm_i", "--mode", "+-+-", "--mode", "-+-+", "--mode", "++++", "--at", "0", "--along", "101",
        "--out", "{}",
    ],
    "methods": [
        "compare-methods", "--mechanism", "five_bar", "--out", "{}", "--tol", "1e-3", "--tol", "1e-4", "--tol", "1e-5",
        "--limit", "10", *(part for name in METHODS for part in ("--method", name)),
    ],
    "laws": ["control", "compare", "examples/laws.toml", "--output", "{}"],
    "sweep": ["sweep", "{}.toml", "--output", "{}"],
    "optimisation": ["optimise", "{}.toml", "--output", "{}"],
    "identification": ["identify", "{}.toml", "--output", "{}"],
    "indices": ["indices", "{}.toml", "--output", "{}"],
    "sensitivity": ["sensitivity", "{}.toml", "--output", "{}"],
    "modes": ["modes", "raparm_i", "--json"],
}  # fmt: skip
# Figures of what the models here do not have.
NOT_SHOWN = ("sensors",)
TITLES = {
    "tracking": "Runs along a path",
    "motion": "Runs without a path",
    "verification": "Models and engines compared",
    "linear": "Linear models",
    "methods": "Methods of integration compared",
    "laws": "Control laws compared",
    "sweep": "Sweeps",
    "optimisation": "Optimisations",
    "identification": "Identifications",
    "indices": "Sobol indices",
    "sensitivity": "Sensitivities",
    "modes": "Actuation modes",
}
INTRODUCTION = """# Gallery

This page has the figures that paraflex draws, by kind of results, but that of `sensors`, which these models
have none of. To draw one for print:

```sh
paraflex plot RESULTS FIGURE... --style single --format pdf,svg,png
```

`RESULTS` is the folder that a command wrote, or one of its files. Without a figure, or with `--list`, the command lists
the figures of these results; `all` draws all of them. Figures that show one actuation mode are drawn for each `--mode`;
the others show the modes named, or all. Figures of many designs take `--metric`;
those of the end-effector's motion, trails and points `--point link1.B1`.

`--style single` makes them 84 mm wide, one column of most journals, and `--style double` 174 mm, two columns; panels
that do not fit side by side are placed below one another. Text is 8 pt, numbers on axes 7 pt; fonts are embedded in PDF
as TrueType. Colours are those of Okabe and Ito, and lines also differ in their dashes, for prints in grey and
colour-blind readers. Files go to `figures/` in the folder of the results, or to `--output`; existing files are replaced
only with `--force`.

In Python each figure is a function of `paraflex.plots` that takes results or their folder:

```python
import paraflex as pf

data = pf.load_results("results/results.nc")
pf.plots.tracking_errors(data).savefig("errors.pdf")
pf.plots.link_motions(data, "++++").savefig("links.pdf")
```

`python docs/make_gallery.py` makes the figures here from small studies.
"""


def main() -> None:
    """Make what is missing, draw everything, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results/gallery"), help="folder for results")
    folder = parser.parse_args().results
    folder.mkdir(parents=True, exist_ok=True)
    drawn: set[str] = set()
    page = [INTRODUCTION]
    for kind, command in COMMANDS.items():
        source = results_of(kind, command, folder)
        if source.kind != kind:
            raise SystemExit(f"{source.folder} holds results of kind {source.kind}, not {kind}")
        page.append(f"\n## {TITLES[kind]}\n\n`{command_line(command, kind)}`\n")
        for figure in (each for each in CATALOGUE[kind] if each.name not in NOT_SHOWN):
            again = figure.name in drawn
            page.append(entry(figure, source, again=again))
            drawn.add(figure.name)
    (DOCS / "gallery.md").write_text("\n".join(page), encoding="utf-8")


def results_of(kind: str, command: list[str], folder: Path) -> Source:
    """Results of a kind; made by their command if they are not there."""
    place = folder / ("modes.json" if kind == "modes" else kind)
    if not place.exists():
        if kind in STUDIES:
            (folder / f"{kind}.toml").write_text(STUDIES[kind], encoding="utf-8")
        filled = [part.format(folder / kind) for part in command]
        done = subprocess.run(
            [sys.executable, "-m", "paraflex", *filled], check=True, stdout=subprocess.PIPE, text=True
        )
        if kind == "modes":
            place.write_text(done.stdout, encoding="utf-8")
    return open_source(place)


def command_line(command: list[str], kind: str) -> str:
    """A command as one would type it."""
    shown = command[: command.index("--tol")] if "--tol" in command else command
    return "paraflex " + " ".join(part.format(kind) for part in shown) + (" > modes.json" if kind == "modes" else "")


def entry(figure: CatalogueFigure, source: Source, *, again: bool) -> str:
    """A figure's part of the page; its file is written, unless it was with other results."""
    if figure not in figures_of(source):
        raise SystemExit(f"{figure.name} cannot be drawn of {source.folder}")
    text = f"### {figure.name}\n\n{figure.shows[0].upper()}{figure.shows[1:]}"
    if again:
        return f"{text}; as above.\n"
    drawing = drawings(source, figure)[0]
    (file,) = write_figures([drawing], IMAGES, ["png"], dpi=110.0, force=True)
    shrink(file)
    shown = file.rename(file.with_name(f"{figure.name}.png"))
    return f"{text}.\n\n![{figure.name}](images/gallery/{shown.name})\n"


def shrink(file: Path) -> None:
    """A picture of at most 160 colours: line drawings need no more."""
    from PIL import Image

    with Image.open(file) as picture:
        small = picture.convert("RGB").quantize(160, dither=Image.Dither.NONE)
    small.save(file, optimize=True)


if __name__ == "__main__":
    main()
