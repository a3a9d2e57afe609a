"""What the journal of a folder holds, while others write it."""

from __future__ import annotations

import json
import sqlite3

from paraflex.campaign.journal import JOURNAL, _digest, read_journal


def rows_in(folder) -> int:
    """How many rows are on the disk."""
    if not (folder / JOURNAL).exists():
        return 0
    with read_journal(folder / JOURNAL) as journal:
        return sum(1 for _ in journal.rows())


def forge(folder, **values) -> None:
    """Give all rows other values, with the digests that they ought to have."""
    connection = sqlite3.connect(folder / JOURNAL)
    with connection:
        for run, identity, content in connection.execute("SELECT run, id, content FROM runs").fetchall():
            other = json.dumps(json.loads(content) | values)
            entry = (other, _digest(run, identity, other), run, identity)
            connection.execute("UPDATE runs SET content = ?, digest = ? WHERE run = ? AND id = ?", entry)
        tally(connection)
    connection.close()


def tally(connection) -> None:
    """Note how many rows there are, and the sum of their digests."""
    digests = [int(each, 16) for (each,) in connection.execute("SELECT digest FROM runs")]
    value = f"{len(digests)} {sum(digests) % (1 << 128)}".encode()
    connection.execute("REPLACE INTO notes VALUES (?, ?, ?)", ("rows", value, _digest("rows", value.hex())))
