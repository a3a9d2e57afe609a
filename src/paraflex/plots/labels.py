"""Texts of printed figures: mathematics of symbols."""

import re

from paraflex.formatting import GREEK, printable, text_symbol

# Letters of symbols in mathematics.
_LETTERS = {letter: rf"\{name}" for name, letter in GREEK.items()} | {"φ": r"\varphi"}
_DOTS = {"\u0307": r"\dot ", "\u0308": r"\ddot ", "": ""}
_RAISED_BACK = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
# A Greek letter, a Latin one with dots or a number, or one alone before a unit or before a colon at the beginning, as a
# symbol within a text.
_SYMBOL = re.compile(
    rf"(?<![^\W\d_])(?:([{''.join(_LETTERS)}])([\u0307\u0308]?)([₀-₉]*)|([A-Za-z])(?:([\u0307\u0308])([₀-₉]*)|()([₀-₉]+)"
    r"|(?<![.\w].)(?= \[)|(?<=^.)(?=: )))(?![^\W\d_])"
)


def symbol(name: str) -> str:
    """Return a name as shown in figures: "A1" and "tau1" as symbols with a subscript, others unchanged."""
    return mathematics(text_symbol(name))


def mathematics(text: str) -> str:
    """Return a text with its symbols as mathematics: "travel of A₁ [mm]", "τ₁", "φ̇", and a single letter "x"."""
    if len(text) == 1 and text.isascii() and text.isalpha():
        return f"${text}$"
    return _SYMBOL.sub(_mathematics, plain(text))


def _mathematics(found: re.Match[str]) -> str:
    groups = found.groups(default="")
    letter, dots, number = groups[:3] if groups[0] else (groups[3], groups[4], groups[5] or groups[7])
    lower = number.translate(_RAISED_BACK)
    inner = _DOTS[dots] + _LETTERS.get(letter, letter)
    return f"${inner}_{{{lower}}}$" if lower else f"${inner}$"


def plain(name: str) -> str:
    """Return a printable name that Matplotlib does not parse as mathematics."""
    return printable(name).replace("$", r"\$")
