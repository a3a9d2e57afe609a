"""Pictures of the gallery of the documentation, one for each figure of the catalogue, and the page that shows them.

    python docs/make_gallery.py                  # makes results in results/gallery, the pictures, and docs/gallery.md
    python docs/make_gallery.py --results DIR    # uses and completes the results in another folder
    python docs/make_gallery.py --only sweep     # makes the pictures of one kind of results, and docs/gallery.md
    python docs/make_gallery.py --page           # writes docs/gallery.md from the pictures that exist

Existing results are used as they are.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from paraflex.figures.entry import Figure as CatalogueFigure
from paraflex.plots.catalogue import CATALOGUE
from paraflex.plots.planned import drawings, figures_of, find_figure
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
# Command that makes each kind of results; {} stands for their folder.
COMMANDS = {
    "tracking": ["run", "raparm_i", "--geometry", "second-order", "--out", "{}"],
    "motion": ["run", "four_bar", "--out", "{}"],
    "verification": ["verify", "five_bar", "--out", "{}"],
    "linear": [
        "linearise", "raparm_i", "--mode", "+-+-", "--mode", "-+-+", "--mode", "++++", "--at", "0", "--along", "101",
        "--out", "{}",
    ],
    "reduction": [
        "reduce", "raparm_i", "--mode", "+-+-", "--mode", "++++", "--along", "21", "--out", "{}",
    ],
    "statics": ["statics", "leaf_spring_guide", "--load", "stage.T.x=10.5 N", "--out", "{}"],
    "methods": [
        "compare-methods", "five_bar", "--out", "{}", "--tol", "1e-3", "--tol", "1e-4", "--tol", "1e-5",
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
# Figures of sensors and controllers, which the models of the gallery do not have.
NOT_SHOWN = ("sensors", "controllers")
# Arguments of a plotting function, by what it takes.
ARGUMENTS = {
    "results": "data",
    "mode": "data, mode",
    "models": "data, mode, models",
    "run": "data, run",
    "designs": "data",
    "nothing": "",
}
TITLES = {
    "tracking": "Runs along a path",
    "motion": "Runs without a path",
    "verification": "Comparison of models and engines",
    "linear": "Linear models",
    "reduction": "Reduced models",
    "statics": "Equilibria",
    "methods": "Comparison of integration methods",
    "laws": "Comparison of control laws",
    "sweep": "Sweeps",
    "optimisation": "Optimisations",
    "identification": "Identifications",
    "indices": "Sobol indices",
    "sensitivity": "Sensitivities",
    "modes": "Actuation modes",
}
INTRODUCTION = """# Gallery of figures

This page shows the figures that paraflex draws, sorted by kind of results. The figures `sensors` and `controllers`
are not shown, because the models of this page have neither. Select a picture to enlarge it. The name of the figure
and the function that draws it are below each picture.

The command `paraflex plot` draws figures for print:

```sh
paraflex plot RESULTS FIGURE... --style single --format pdf,svg,png
```

`RESULTS` is the folder that a command wrote, or one of its files. Without a figure, or with `--list`, the command
lists the figures of these results; `all` draws all of them. Figures that show one actuation mode are drawn for each
`--mode`; the others show the selected modes, or all. Figures of many designs accept `--metric`. Figures of the
end-effector's motion, of trails and of points accept `--point link1.B1`; `point_paths`, `hodographs` and
`point_components` show several points if the option is repeated.

The option `--style single` makes figures 84 mm wide, one column of most journals, and `--style double` 174 mm, two
columns. Panels that do not fit side by side are placed below one another. Text is 8 pt, numbers on axes are 7 pt;
fonts are embedded in PDF as TrueType. Colours are those of Okabe and Ito, and lines also differ in their dashes, for
prints in grey and for colour-blind readers. Files are written to `figures/` in the folder of the results, or to
`--output`. Existing files are replaced only with `--force`.

This style is a base. Settings of Matplotlib that differ from its defaults have priority: those of a `matplotlibrc`, of
`plt.rcParams` and of `matplotlib.style.use`. If only `font.size` is set, all sizes of charts follow it. The following
options do the same for one command:

- `--style ggplot` and `--style mine.mplstyle` choose a style of Matplotlib by its name or file. The option is
  repeatable, also beside `single` or `double`; the last style has priority.
- `--font STIXGeneral` chooses the family of fonts of text and symbols. Characters that it lacks are taken from DejaVu
  Sans.
- `--svg-text` writes text in SVG as text, which editors can change and which is shown in the viewer's fonts; by default
  it is drawn as outlines. Matplotlib writes labels that contain symbols letter by letter.
- `--format pgf` writes macros for `\\input` in a LaTeX document, whose fonts they use. LaTeX must be installed
  (`pgf.texsystem`, by default `xelatex`), because it measures the text.

Sizes of names in drawings of mechanisms and in films do not depend on these settings, nor do their colours.

The option `--units deg,mm,kN` chooses the units on the axes, and so does the table
[`[units]`](model-file-tables.md#units) of the model's file.

The option `--over` draws curves over the angle or travel of a joint, or over a coordinate of a point, in place of
time. With it, `all` or no figure stands for all figures with curves over time:

```sh
paraflex plot motion joint_forces --over O
paraflex plot tracking link_motions energies --over link4.C.x
```

<div class="gallery" markdown>

<figure id="over" markdown>
[![Joint forces of a four-bar over the angle of its crank.](images/gallery/over.png)](images/gallery/over.png)

<figcaption markdown>
Forces in the joints of a four-bar over the angle of its crank.

`pf.plots.joint_forces(data, over="O")`
</figcaption>
</figure>

</div>

Desired values are drawn at the angle, travel or coordinate that the run has at the same time. A joint or coordinate
that does not move is refused, and so is a figure without curves over time.

In Python, each figure is a function of `paraflex.plots` that takes results or their folder:

```python
import paraflex as pf

data = pf.load_results("results/results.nc")
pf.plots.tracking_errors(data).savefig("errors.pdf")
pf.plots.link_motions(data, "++++").savefig("links.pdf")
pf.plots.link_motions(data, "++++", over="A1").savefig("links_over_A1.pdf")
```

Settings apply while a figure is made, and while it is written: `with plt.rc_context({"font.family": "serif"}):` holds
for what is within.

The script `python docs/make_gallery.py` makes the figures of this page from small studies, and writes the page.
References such as "Fig. 11" name the figure of the paper that has the same content.
"""


def main() -> None:
    """Make missing results, draw their figures, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results/gallery"), help="folder for results")
    parser.add_argument("--only", choices=tuple(COMMANDS), help="kind of results to draw; by default all")
    parser.add_argument("--page", action="store_true", help="draw nothing, only write the page")
    given = parser.parse_args()
    if not given.page:
        given.results.mkdir(parents=True, exist_ok=True)
        for kind in [given.only] if given.only else COMMANDS:
            source = results_of(kind, COMMANDS[kind], given.results)
            if source.kind != kind:
                raise SystemExit(f"{source.folder} holds results of kind {source.kind}, not {kind}")
            for figure in first_shown(kind):
                draw(figure, source)
            if kind == "motion":
                draw(find_figure(source, "joint_forces"), source, over="O")
    (DOCS / "gallery.md").write_text(gallery_page(), encoding="utf-8")


def gallery_page() -> str:
    """Return the text of the page: a grid of pictures for each kind of results."""
    return "\n".join([INTRODUCTION, *map(section, COMMANDS)])


def section(kind: str) -> str:
    """Return the part of the page about one kind of results."""
    made, results = command_line(COMMANDS[kind], kind), "modes.json" if kind == "modes" else kind
    figures = first_shown(kind)
    draws = "these figures" if len(figures) > 1 else "this figure"
    text = f"## {TITLES[kind]}\n\nThe following command makes the results:\n\n```sh\n{made}\n```\n"
    text += f"\n`paraflex plot {results} FIGURE` draws {draws}:\n"
    text += f'\n<div class="gallery" markdown>\n\n{"".join(map(entry, figures))}</div>\n'
    if again := [figure.name for figure in shown(kind) if figure not in figures]:
        links = [f"[`{name}`](#{name})" for name in again]
        text += (
            f"\nThese results also have the figures {', '.join(links[:-1])} and {links[-1]}, which are shown above.\n"
        )
    return text


def shown(kind: str) -> list[CatalogueFigure]:
    """Return the figures of a kind of results, without those that the gallery cannot show."""
    return [figure for figure in CATALOGUE[kind] if figure.name not in NOT_SHOWN]


def first_shown(kind: str) -> list[CatalogueFigure]:
    """Return the figures of a kind of results that no kind before it has."""
    kinds = list(COMMANDS)
    before = {figure.name for earlier in kinds[: kinds.index(kind)] for figure in shown(earlier)}
    return [figure for figure in shown(kind) if figure.name not in before]


def entry(figure: CatalogueFigure) -> str:
    """Return a picture of the grid with its name, its caption and the function that draws it."""
    picture = f"images/gallery/{figure.name}.png"
    paper = f" (Fig. {figure.paper})" if figure.paper else ""
    caption = f"{figure.shows[0].upper()}{figure.shows[1:]}{paper}."
    return (
        f'<figure id="{figure.name}" markdown>\n'
        f"[![{caption}]({picture})]({picture})\n\n"
        f"<figcaption markdown>\n**{figure.name}**\n\n{caption}\n\n"
        f"`pf.plots.{figure.name}({ARGUMENTS[figure.takes]})`\n</figcaption>\n</figure>\n\n"
    )


def results_of(kind: str, command: list[str], folder: Path) -> Source:
    """Return results of a kind, made by their command if they do not exist."""
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
    """Return a command as typed in a shell."""
    typed = command[: command.index("--tol")] if "--tol" in command else command
    parts = [part.format(kind) for part in typed]
    quoted = [f'"{part}"' if " " in part else part for part in parts]
    return " ".join(["paraflex", *quoted]) + (" > modes.json" if kind == "modes" else "")


def draw(figure: CatalogueFigure, source: Source, over: str = "time") -> None:
    """Draw a figure, over time or another abscissa, and write its picture."""
    if figure not in figures_of(source):
        raise SystemExit(f"{figure.name} cannot be drawn of {source.folder}")
    drawing = drawings(source, figure, over=over)[0]
    (file,) = write_figures([drawing], IMAGES, ["png"], dpi=110.0, force=True)
    shrink(file)
    file.rename(file.with_name(f"{figure.name if over == 'time' else 'over'}.png"))


def shrink(file: Path) -> None:
    """Reduce a picture to 160 colours, which line drawings do not exceed."""
    from PIL import Image

    with Image.open(file) as picture:
        small = picture.convert("RGB").quantize(160, dither=Image.Dither.NONE)
    small.save(file, optimize=True)


if __name__ == "__main__":
    main()
