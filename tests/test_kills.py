"""The short form of `benchmarks/kills.py`: killed commands, and those without room, leave nothing that deceives."""

import sys
from pathlib import Path

import pytest

from processes import started

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "kills.py"


@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_killed_commands_leave_the_results_before_or_the_new_ones_and_do_the_rest_when_repeated():
    given = ("--kills", 4, "--full", 1, "--only", "motion", "sensitivity", "sweep")
    with started(sys.executable, SCRIPT, *given) as child:
        done = child.end()
    assert done.returncode == 0, done.stdout + done.stderr
    table = [line.split() for line in done.stdout.partition("\n\n")[2].splitlines()]
    killed, failures = (
        table[0].index("killed"),
        [table[0].index(name) for name in ("silent", "error", "differs", "left")],
    )
    rows = {row[0]: row for row in table[1:]}
    assert rows.keys() == {"motion", "sensitivity", "sweep"}
    for row in rows.values():
        assert int(row[killed]) >= 2
        assert [row[column] for column in failures] == ["0"] * 4
