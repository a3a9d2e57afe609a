"""Drawing of a model before it runs."""

from __future__ import annotations

import warnings
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, ModelWarning
from paraflex.files import Model
from paraflex.mechanism import Mechanism
from paraflex.results.posed import Posed, posed
from .check import loaded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Least width of a drawing with its margins, and largest width that fits into memory [mm].
_NARROWEST, _WIDEST = 20.0, 5000.0


def pose_of(
    model: Model | Mechanism | str | FilePath, *, assembly: str | None = None, path: str | None = None
) -> Posed:
    """Return the pose that a model starts from: on its path if it has one, else given by its start or its assembly.

    Parameters
    ----------
    model : Model, Mechanism, str or Path
        Model, or its name or file.
    assembly : str, optional
        Name of the assembly; by default the study's, or the first.
    path : str, optional
        Name of one of the model's paths; the study's by default.

    Raises
    ------
    InputError
        A file cannot be read, a path or assembly is unknown, or there is no assembly at all.
    """
    model = loaded(model)
    if isinstance(model, Mechanism):
        model = Model(model)
    followed = None
    if path is not None or (model.paths and model.start is None):
        name = model.path_name(path)
        followed = (name, model.path(name))
    duration = model.study.duration if followed is None else model.duration(followed[1])
    return posed(model.mechanism, assembly or model.study.assembly, followed, model.start, duration)


@checked_arguments()
def draw(
    model: Model | Mechanism | str | FilePath,
    *,
    assembly: str | None = None,
    path: str | None = None,
    width: float = 174.0,
    theme_name: str = "light",
) -> Figure:
    """Draw a model before it runs: bodies, joints by kind, motors, springs, loads and path, with their names.

    Loops that do not close are drawn as given, with their open joints marked, and a warning is issued.

    Parameters
    ----------
    model, assembly, path
        Arguments of `pose_of`.
    width : float
        Width of the drawing [mm].
    theme_name : str
        Theme: "light" or "dark".

    Returns
    -------
    matplotlib.figure.Figure
        Drawing of the model.

    Raises
    ------
    InputError
        The pose cannot be found (see `pose_of`), or the width is out of range.
    """
    from paraflex.plots.model_drawing import model_drawing  # Matplotlib takes long to import

    if not _NARROWEST <= width <= _WIDEST:
        remedy = f"from {_NARROWEST:g} to {_WIDEST:g} mm"
        raise InputError("not a possible width of a drawing", field="width", value=width, remedy=remedy)

    shown = pose_of(model, assembly=assembly, path=path)
    for problem in shown.problems:
        warnings.warn(problem, ModelWarning, stacklevel=2)
    return model_drawing(shown, width=width, theme_name=theme_name)
