"""Calls of a command that write files are made on all processors, in copies of its process."""

import os
import subprocess
import sys

import pytest

from paraflex.campaign.workers import share_out


def test_calls_are_shared_with_copies_of_the_process_and_failures_are_its_own(tmp_path):
    """In a process with one thread, as that of a command is."""
    program = f"""
import os
from functools import partial
from pathlib import Path
from paraflex.campaign.workers import share_out
from paraflex.mechanism import raparm_i

def write(k):
    if k == 3 and os.getpid() != first:
        os._exit(1)
    (Path({str(tmp_path)!r}) / f"{{k}}.txt").write_text(str(os.getpid()))

def fail():
    raise ValueError("no room")

first = os.getpid()
share_out([partial(write, k) for k in range(8)])
try:
    share_out([partial(write, 8), fail])
except ValueError as error:
    print(first, error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    first, _, problem = done.stdout.partition(" ")
    assert problem.strip() == "no room"
    writers = {k: (tmp_path / f"{k}.txt").read_text() for k in range(9)}
    if sys.platform == "linux":
        # The call whose copy died is made by the process itself.
        assert writers[3] == first
        assert writers[8] != first


@pytest.mark.skipif(sys.platform != "linux", reason="processes are not copied")
def test_calls_are_made_while_the_process_goes_on(tmp_path):
    """The block waits for a call to be made; an error in it ends the copies."""
    program = f"""
import time
from functools import partial
from pathlib import Path
from paraflex.campaign.workers import sharing_out

folder = Path({str(tmp_path)!r})

def write(name, seconds):
    time.sleep(seconds)
    (folder / name).touch()

with sharing_out([partial(write, "one", 0.0), partial(write, "two", 0.0)]) as finish:
    while not (folder / "one").exists():
        time.sleep(0.01)
    finish()
    print((folder / "two").exists())
began = time.monotonic()
try:
    with sharing_out([partial(write, "three", 60.0)] * 2):
        raise KeyboardInterrupt
except KeyboardInterrupt:
    print(time.monotonic() - began < 30.0)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True"]
    assert not (tmp_path / "three").exists()


def test_a_process_with_several_threads_is_not_copied(monkeypatch):
    monkeypatch.setattr("threading.active_count", lambda: 2)
    found = []
    share_out([lambda: found.append(os.getpid())] * 3)
    assert found == [os.getpid()] * 3
