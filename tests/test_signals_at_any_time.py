"""The short form of `benchmarks/kills.py --signals`: commands end by themselves, and are repeated as after kills."""

import sys
from pathlib import Path

import pytest

from processes import started

# As of kills; see `test_kills.py`. Of three signals one is at a change of a file, one over results that are there.
SHORT = """
import contextlib, io, sys, tempfile
from pathlib import Path

place, *names = sys.argv[1:]
sys.path.insert(0, place)
import kills

with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()), contextlib.chdir(folder):
    with contextlib.suppress(SystemExit):
        kills.command(kills.LINES["linearise"], Path("out"))()
sys.argv = ["kills", "--kills", "2", "--signals", "3", "--full", "0", "--only", *names]
kills.main()
"""
COMMANDS = ("linearise", "table")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are forked, and looked for in /proc")
def test_interrupted_commands_end_by_themselves_and_files_are_those_before_or_the_new_ones():
    benchmarks = Path(__file__).parents[1] / "benchmarks"
    with started(sys.executable, "-c", SHORT, benchmarks, *COMMANDS) as child:
        done = child.end()
    assert done.returncode == 0, done.stdout + done.stderr
    heads, *rows = [line.split() for line in done.stdout.partition("\n\n")[2].splitlines()]
    found = {row[0]: dict(zip(heads, row, strict=False)) for row in rows}
    assert found.keys() == set(COMMANDS)
    assert sum(int(row["signals"]) for row in found.values()) >= 2
    for row in found.values():
        assert [row[name] for name in ("hang", "silent", "error", "differs", "left")] == ["0"] * 5
