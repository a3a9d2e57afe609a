"""The short form of `benchmarks/kills.py`: killed commands, and those without room, leave nothing that deceives."""

import sys
from pathlib import Path

import pytest

from processes import started

# Each command is run once before the others are forked, which then load nothing anew; a sweep is of fewer designs.
# Of three kills one is at a change of a file, one at a random time, one over results that are there.
SHORT = """
import contextlib, io, os, sys, tempfile
from pathlib import Path

place, *names = sys.argv[1:]
sys.path.insert(0, place)
import kills

kills.FILES["sweep"] = kills.FILES["sweep"].replace("number = 8", "number = 2")
with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()), contextlib.chdir(folder):
    for name in names:
        if name in kills.FILES:
            Path(f"{name}.toml").write_text(kills.FILES[name].replace("number = 2", "number = 1"), encoding="utf-8")
        with contextlib.suppress(SystemExit):
            kills.command(kills.LINES[name], Path("out", name))()
sys.argv = ["kills", "--kills", "3", "--full", "1", "--only", *names]
kills.main()
"""
COMMANDS = ("motion", "sensitivity", "sweep")


@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_killed_commands_leave_the_results_before_or_the_new_ones_and_do_the_rest_when_repeated():
    benchmarks = Path(__file__).parents[1] / "benchmarks"
    with started(sys.executable, "-c", SHORT, benchmarks, *COMMANDS) as child:
        done = child.end()
    assert done.returncode == 0, done.stdout + done.stderr
    table = [line.split() for line in done.stdout.partition("\n\n")[2].splitlines()]
    killed, failures = (
        table[0].index("killed"),
        [table[0].index(name) for name in ("silent", "error", "differs", "left")],
    )
    rows = {row[0]: row for row in table[1:]}
    assert rows.keys() == set(COMMANDS)
    for row in rows.values():
        assert int(row[killed]) >= 2
        assert [row[column] for column in failures] == ["0"] * 4
