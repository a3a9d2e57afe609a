"""Mechanisms that come with the package: their names and files, and those that a function builds from numbers."""

from paraflex.files.library import library_names as names, library_text as text
from paraflex.mechanism.raparm import raparm_i
from paraflex.mechanism.rows import chain_of_segments, four_bars_in_a_row

__all__ = ["chain_of_segments", "four_bars_in_a_row", "names", "raparm_i", "text"]
