"""The page of the workbench: its modules joined to one, its style, and the scripts that it shares with reports."""

import re
from functools import cache
from importlib.resources import files
from string import Template

from paraflex.plots.themes import THEMES

# Modules in the order in which they are joined; each imports only from those before it.
_MODULES = (
    "elements.js", "colours.js", "link.js", "names.js", "places.js", "sheet.js", "icons.js", "dragging.js",
    "drawing.js", "painting.js", "tools.js", "fields.js", "outline.js", "text.js", "photograph.js", "start.js",
    "curves.js", "recordings.js", "pulling.js", "motion.js", "seeing.js", "leave.js", "workbench.js",
)  # fmt: skip
# Scripts of reports that stand before the modules, and the style sheets.
_SHARED, _STYLES = ("unpacking.js",), ("workbench.css", "panels.css")
_IMPORT = re.compile(r"^import .*?;\n", re.MULTILINE | re.DOTALL)
_EXPORT = re.compile(r"^export (?!default)", re.MULTILINE)


@cache
def module() -> str:
    """Return the ES module of the page, whose default export has `render({model, el})` as anywidget asks for."""
    parts = [_IMPORT.sub("", _EXPORT.sub("", _asset(name))) for name in _MODULES]
    shared = [_asset(name, "reports") for name in _SHARED]
    names = (*_SHARED, *_MODULES)
    return "".join(f"// {name}\n{part}\n" for name, part in zip(names, [*shared, *parts], strict=True))


@cache
def style() -> str:
    """Return the style sheet, with the colours of drawings and reports."""
    light, dark = (_colours(name) for name in ("light", "dark"))
    return Template("".join(map(_asset, _STYLES))).safe_substitute(light=light, dark=dark)


@cache
def page() -> str:
    """Return the HTML of the page, which loads its module and style from beside it."""
    return _asset("workbench.html")


def _colours(name: str) -> str:
    """Return the colours of a theme as CSS variables."""
    theme = THEMES[name]
    named = {key: getattr(theme, key) for key in ("ground", "ink", "faint", "earth", "desired", "trail", "sensor")}
    named |= {f"link{k}": colour for k, colour in enumerate(theme.links)}
    return " ".join(f"--{key}: {colour};" for key, colour in named.items())


def _asset(name: str, package: str = "workbench") -> str:
    return (files(f"paraflex.{package}") / "assets" / name).read_text(encoding="utf-8")
