"""Colours of drawings and films on light and on dark ground."""

from __future__ import annotations

from dataclasses import dataclass

from paraflex.mechanism.quantities import known


@dataclass(frozen=True)
class Theme:
    """Colours by use; those of links are distinguishable by colour-blind readers too."""

    ground: str
    ink: str
    faint: str
    earth: str
    desired: str
    trail: str
    links: tuple[str, ...]

    def link(self, number: int) -> str:
        """Colour of a body by its number."""
        return self.links[number % len(self.links)]


# Okabe and Ito (2008), Color Universal Design; darker where the ground is light, lighter where it is dark.
THEMES = {
    "light": Theme(
        "#ffffff", "#1d2327", "#c3c9ce", "#59636b", "#8a949b", "#d55e00",
        ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#8c5a2b", "#5a4fcf", "#7a7f00"),
    ),
    "dark": Theme(
        "#14181b", "#e8ecef", "#454d53", "#9aa4ab", "#8e989f", "#ff9a4d",
        ("#4aa8e0", "#f0b93a", "#2ec49a", "#e39cc4", "#9ad4f5", "#c99565", "#a59df0", "#c6cb4a"),
    ),
}  # fmt: skip
# On a page of unknown ground, as of a notebook: what is neither too light nor too dark for one of the two kinds.
PAGE = Theme(
    "rgba(128, 128, 128, 0.6)", "currentColor", "currentColor", "currentColor", "currentColor", "currentColor",
    ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
)  # fmt: skip


def theme(name: str) -> Theme:
    """Colours by name."""
    known(name, THEMES, "theme", "theme")
    return THEMES[name]
