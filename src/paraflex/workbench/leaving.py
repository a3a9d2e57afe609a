"""Things that a person takes away from the workbench: report, drawing, film, program, and a link to the same model.

Functions take the text of a model file, the folder to which names of files in it are relative (None for the current
one), and the name of the model for errors and titles, `source`.
"""

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
from paraflex.studies.report import report as report_page
from paraflex.writing import whole_file
from .computing import computed, model_of
from .programs import program as program

# Kinds of drawings, resolution of PNG [dots per inch], and the longest link: browsers and chats cut off longer ones.
DRAWINGS, _DPI, LINK_LETTERS = ("svg", "pdf", "png"), 200.0, 32_000
# Beginning of a link, and the letters after it.
_MARK, _LETTERS = "#model=", re.compile(r"[A-Za-z0-9_-]+")


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
    """Run a model, write results, summary and report into the folder `out` as `paraflex run` does; return the report.

    Raises
    ------
    InputError, NumericalError
        See `computing.computed`; also if no mode could start.
    OutputError
        The folder cannot be written.
    """
    model = model_of(text, folder, source)
    with hold_folder(out, RUN) as held:
        found = computed(model, modes, path, on_progress=on_progress).begun()
        found.result.save_in(held)
        with output_units(model.parameters.get("units", {}).values()), held.added_files() as new:
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
    """Write the drawing of `paraflex draw` into a file per kind, named `out` and the kind; return the files.

    Raises
    ------
    InputError
        A text that is not a model, an unknown kind or theme, or a pose that cannot be found.
    OutputError
        A file cannot be written.
    """
    for kind in kinds:
        if kind not in DRAWINGS:
            raise InputError("unknown kind of drawing", field="kinds", value=kind, remedy="svg, pdf or png")
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
    """Run a model and write its film, all modes side by side, as `paraflex animate` does; return the file.

    The suffix is .mp4, .gif, .svg, or .png for one picture; `options` are those of `FilmOptions`.

    Raises
    ------
    InputError, NumericalError, OutputError
        See `report` and `paraflex.animate`.
    """
    from paraflex.plots.film import FilmOptions, animate, film_kind

    film_kind(out)
    chosen = FilmOptions(**options)  # type: ignore[arg-type]
    data = computed(model_of(text, folder, source), modes, path).begun().result.data
    shown = [str(mode) for mode in data["mode"].values] if data is not None and "mode" in data.dims else []
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
    made = _MARK + base64.urlsafe_b64encode(packed).decode("ascii").rstrip("=")
    if len(made) > LINK_LETTERS:
        problem = f"the model is too large for a link, {len(made)} letters of at most {LINK_LETTERS}"
        raise InputError(problem, field="link", remedy="send its file instead")
    return made


def text_of_link(link: str) -> str:
    """Return the text of the model in an address, or in its part from "#" on; it is read like that of any file.

    Raises
    ------
    InputError
        No link of a model, or one that is damaged, cut off or too large.
    """
    _, mark, letters = link.strip().partition(_MARK)
    if not mark:
        raise _refused(f'no link of a model, which has "{_MARK}" in it', link)
    if len(letters) > LINK_LETTERS:
        raise _refused("too long a link", link)
    unpacking = zlib.decompressobj()
    try:
        if not _LETTERS.fullmatch(letters):
            raise ValueError
        # At most one byte more than a model file may have: a few letters may stand for gigabytes.
        data = unpacking.decompress(base64.urlsafe_b64decode(letters + "=" * (-len(letters) % 4)), FILE_BYTES + 1)
        if len(data) > FILE_BYTES:
            raise _refused("too large a model", link)
        if not unpacking.eof or unpacking.unused_data:
            raise ValueError
        return data.decode()
    except InputError:
        raise
    except (ValueError, zlib.error):
        raise _refused("a damaged link of a model", link) from None


def _refused(problem: str, link: str) -> InputError:
    return InputError(problem, field="link", value=link[:40], remedy="copy the whole link, or open the model's file")
