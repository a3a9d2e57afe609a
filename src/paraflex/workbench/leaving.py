"""What a person takes away from the workbench: report, drawing, film, and a link that opens the model again."""

import base64
import re
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

from paraflex.campaign import OnProgress
from paraflex.checks.drawing import pose_of
from paraflex.errors import InputError
from paraflex.folders import RUN, hold_folder
from paraflex.formatting import output_units
from paraflex.limits import FILE_BYTES
from paraflex.plots.themes import theme
from paraflex.studies.report import report as report_page
from paraflex.writing import whole_file
from .computing import computed, model_of
from .programs import program as program

# Kinds of drawings, resolution of PNG [dots per inch], and the longest link: browsers and chats cut off longer ones.
DRAWINGS, _DPI, LINK_LETTERS = ("svg", "pdf", "png"), 200.0, 32_000
# Beginning of a link after "#", which names the format, and the letters after it.
_MARK, _LETTERS = "#model=", re.compile(r"[A-Za-z0-9_-]+")
_REMEDY = "copy the whole link, or open the model's file"


def report(
    text: str,
    folder: Path | None,
    out: Path,
    *,
    source: str = "model",
    modes: Sequence[str] = (),
    path: str | None = None,
    on_progress: OnProgress | None = None,
) -> Path:
    """Run a model, write results, summary and report into a folder as `paraflex run` does, and return the report.

    Parameters
    ----------
    text : str
        Text of the model file.
    folder : Path or None
        Folder to which names of tables in the text are relative; None for the current one.
    out : Path
        Folder of the results; earlier results in it are replaced.
    source : str
        Name of the model.
    modes, path, on_progress
        See `computing.computed`.

    Raises
    ------
    InputError, NumericalError
        A model that cannot be run, or of which no mode could start.
    OutputError
        The folder cannot be written.
    """
    model = model_of(text, folder, source)
    units = [str(unit) for unit in model.parameters.get("units", {}).values()]
    with hold_folder(out, RUN) as held:
        found = computed(model, modes, path, on_progress=on_progress).begun()
        found.result.save_in(held)
        with output_units(units), held.added_files() as new:
            report_page(found.result).save(new / "report.html")
    return out / "report.html"


def figures(
    text: str,
    folder: Path | None,
    out: Path,
    *,
    source: str = "model",
    kinds: Sequence[str] = DRAWINGS,
    assembly: str | None = None,
    theme_name: str = "light",
) -> list[Path]:
    """Write the drawing of a model for print, as `paraflex draw` makes it, and return the files.

    Parameters
    ----------
    text, folder, source
        See `report`.
    out : Path
        File without the suffix, which each kind adds; its folder must exist. Files of these names are replaced.
    kinds : sequence of str
        Kinds of files: "svg", "pdf" and "png".
    assembly : str, optional
        Name of the assembly; by default the start of the study's path, or the first assembly.
    theme_name : str
        Theme: "light" or "dark".

    Raises
    ------
    InputError
        A text that is not a model, an unknown kind, or a pose that cannot be found.
    OutputError
        A file cannot be written.
    """
    for kind in kinds:
        if kind not in DRAWINGS:
            raise InputError("unknown kind of drawing", field="kinds", value=kind, remedy="svg, pdf or png")
    theme(theme_name)
    shown = pose_of(model_of(text, folder, source), assembly=assembly)
    # Matplotlib takes longer to import than all the rest.
    from paraflex.plots.model_drawing import model_drawing
    from paraflex.plots.style import write_figure

    drawing, files = (
        model_drawing(shown, theme_name=theme_name),
        [out.with_name(f"{out.name}.{kind}") for kind in kinds],
    )
    for file, kind in zip(files, kinds, strict=True):
        with whole_file(file, field=str(file.parent)) as unfinished:
            write_figure(drawing, unfinished, kind, _DPI)
    return files


def film(
    text: str,
    folder: Path | None,
    out: Path,
    *,
    source: str = "model",
    modes: Sequence[str] = (),
    path: str | None = None,
    on_progress: Callable[[int, int], None] | None = None,
    **options: object,
) -> Path:
    """Run a model and write a film of it as `paraflex animate` does, and return the file.

    Parameters
    ----------
    text, folder, source, modes, path
        See `report`. All modes are shown side by side.
    out : Path
        File, whose suffix is the format: .mp4, .gif, .svg, or .png for one picture.
    on_progress : callable, optional
        Function called with the number of pictures drawn and of all.
    **options
        Fields of `FilmOptions`, such as `magnify`, `speed` and `theme`.

    Raises
    ------
    InputError, NumericalError, OutputError
        See `report` and `paraflex.animate`.
    """
    from paraflex.plots.film import FilmOptions, animate, film_kind

    film_kind(out)
    chosen = FilmOptions(**options)  # type: ignore[arg-type]
    data = computed(model_of(text, folder, source), modes, path).begun().result.data
    assert data is not None
    shown = [str(mode) for mode in data["mode"].values] if "mode" in data.dims else []
    animate(data, out, shown, chosen, on_progress=on_progress)
    return out


def link(text: str) -> str:
    """Return a model's text as the part of an address from "#" on, which browsers do not send to any server.

    Raises
    ------
    InputError
        A text that is too long for a link.
    """
    try:
        packed = zlib.compress(text.encode(), 9)
    except UnicodeEncodeError:
        raise InputError("has letters that no file can hold", field="link", remedy="remove lone surrogates") from None
    letters = base64.urlsafe_b64encode(packed).decode("ascii").rstrip("=")
    if len(_MARK) + len(letters) > LINK_LETTERS:
        problem = f"the model is too large for a link, {len(letters)} letters of at most {LINK_LETTERS}"
        raise InputError(problem, field="link", remedy="send its file instead")
    return _MARK + letters


def text_of_link(link: str) -> str:
    """Return the text of the model in an address, or in its part from "#" on.

    Nothing of the text is executed or trusted: it is read like the text of any file.

    Raises
    ------
    InputError
        No link of a model, or one that is damaged, cut off or too large.
    """
    _, mark, letters = link.strip().partition(_MARK)
    if not mark or len(letters) > LINK_LETTERS:
        problem = "too long a link" if mark else f'no link of a model, which has "{_MARK}" in it'
        raise InputError(problem, field="link", value=link[:40], remedy=_REMEDY)
    damaged = InputError("a damaged link of a model", field="link", value=link[:40], remedy=_REMEDY)
    if not _LETTERS.fullmatch(letters) or len(letters) % 4 == 1:
        raise damaged
    unpacking = zlib.decompressobj()
    try:
        # At most one byte more than a model file may have: a few letters may stand for gigabytes.
        data = unpacking.decompress(base64.urlsafe_b64decode(letters + "=" * (-len(letters) % 4)), FILE_BYTES + 1)
        text = data[:FILE_BYTES].decode()
    except (ValueError, zlib.error):
        raise damaged from None
    if len(data) > FILE_BYTES or not unpacking.eof or unpacking.unused_data:
        problem = "too large a model" if len(data) > FILE_BYTES else damaged.problem
        raise InputError(problem, field="link", value=link[:40], remedy=_REMEDY)
    return text
