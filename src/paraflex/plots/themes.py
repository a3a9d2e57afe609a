"""Colours of drawings, films and reports on light and on dark backgrounds."""

from dataclasses import dataclass

from paraflex.mechanism.quantities import known


@dataclass(frozen=True)
class Theme:
    """Colours by use; those of links are distinguishable for colour-blind readers as well."""

    ground: str
    ink: str
    faint: str
    earth: str
    desired: str
    trail: str
    sensor: str
    links: tuple[str, ...]

    def link(self, number: int) -> str:
        """Return the colour of a body by its number."""
        return self.links[number % len(self.links)]


# After Okabe and Ito (2008), Color Universal Design; darker on the light background, lighter on the dark one. No colour
# of a link is near that of the trail, or near the grey and ink of the desired path.
THEMES = {
    "light": Theme(
        "#ffffff", "#1d2327", "#c3c9ce", "#59636b", "#8a949b", "#d55e00", "#00676f",
        ("#0072b2", "#c98700", "#009e73", "#b04a8a", "#4aa8e2", "#6a4fcf", "#7a7f00", "#8c5a2b"),
    ),
    "dark": Theme(
        "#14181b", "#e8ecef", "#454d53", "#9aa4ab", "#8e989f", "#ff9a4d", "#7fe3e8",
        ("#56b4e9", "#f0c93a", "#2fd0a0", "#e79bc5", "#8fa8ff", "#b6d24a", "#c08cf0", "#b98a5a"),
    ),
}  # fmt: skip
# Theme for a page of unknown background, such as a notebook: colours for both light and dark.
PAGE = Theme(
    "rgba(128, 128, 128, 0.6)", "currentColor", "currentColor", "currentColor", "currentColor", "currentColor",
    "currentColor",
    ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
)  # fmt: skip


def theme(name: str) -> Theme:
    """Return a theme by name; raise InputError if there is none."""
    known(name, THEMES, "theme", "theme")
    return THEMES[name]
