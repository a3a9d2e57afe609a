"""Formulas as MathML: browsers draw it themselves, without scripts and without a network."""

from __future__ import annotations

import re
from html import unescape
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

# What pymdownx.arithmatex leaves of $...$ and $$...$$.
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)

# A letter with a prime, and maybe an index.
_PRIME = re.compile(
    r"<(?P<tag>msup|msubsup)>(?P<base><mi>[^<]*</mi>)(?P<below><m[in]>[^<]*</m[in]>)?"
    r"<mi>(?P<prime>&#x0203[2-4];)</mi></(?P=tag)>"
)


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Every formula of a page as MathML."""

    def inline(found: re.Match[str]) -> str:
        return mathml(found[1], "inline", page.file.src_uri)

    def block(found: re.Match[str]) -> str:
        return f'<div class="formula">{mathml(found[1], "block", page.file.src_uri)}</div>'

    return _INLINE.sub(inline, _BLOCK.sub(block, html))


def mathml(latex: str, display: str, place: str) -> str:
    """A formula as MathML; a command that the converter does not know stops the build, naming the page."""
    latex = unescape(latex).strip()
    # The converter knows the starred environment only; other readers of the page want this one inside $$.
    made = convert(latex.replace("{aligned}", "{align*}"), display=display)
    if "\\" in made or "<mi>&</mi>" in made:
        raise PluginError(f"{place}: not understood: {latex}")
    return _PRIME.sub(_beside, made)


def _beside(found: re.Match[str]) -> str:
    """A prime beside what it belongs to: raised as a superscript once more, it is a speck in fonts of text."""
    base = f"<msub>{found['base']}{found['below']}</msub>" if found["below"] else found["base"]
    return f'<mrow>{base}<mo lspace="0" rspace="0.05em">{found["prime"]}</mo></mrow>'
