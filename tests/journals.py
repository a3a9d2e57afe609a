"""What the journal of a folder holds, while others write it."""

from __future__ import annotations

from paraflex.campaign.journal import JOURNAL, read_journal


def rows_in(folder) -> int:
    """How many rows are on the disk."""
    if not (folder / JOURNAL).exists():
        return 0
    with read_journal(folder / JOURNAL) as journal:
        return sum(1 for _ in journal.rows())
