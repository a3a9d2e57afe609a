"""Processes of tests: in a session of their own, with Ctrl-C as a terminal gives it, ended with all that they started.

Waits are for conditions; their bounds are only there for what would never happen.
"""

import os
import subprocess
import sys
import tempfile
import time
import uuid
from contextlib import contextmanager
from subprocess import CompletedProcess

import psutil

# What a busy machine may take [s].
WITHIN = 300.0
_MARK = "PARAFLEX_STARTED_BY_TEST"


def wait_until(condition, *, within=WITHIN, what="the condition"):
    """Wait for a condition; what it gave."""
    end = time.monotonic() + within
    while not (found := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"{what} did not come within {within:g} s")
        time.sleep(0.02)
    return found


class Child:
    """A process that a test started: see `started`."""

    def __init__(self, command, cwd=None, env=None, text=True):
        self._text = text
        self._mark = uuid.uuid4().hex
        self._said = [tempfile.TemporaryFile("w+b") for _ in range(2)]  # noqa: SIM115
        self.process = subprocess.Popen(
            [str(each) for each in command], start_new_session=True, stdin=subprocess.DEVNULL, cwd=cwd,
            stdout=self._said[0], stderr=self._said[1], env={**os.environ, **(env or {}), _MARK: self._mark},
        )  # fmt: skip

    @property
    def out(self):
        """What it has written to standard output until now."""
        return self._read(0)

    @property
    def err(self):
        """The same of standard error."""
        return self._read(1)

    def _read(self, which):
        size = os.fstat(self._said[which].fileno()).st_size
        said = os.pread(self._said[which].fileno(), size, 0)
        return said.decode(errors="replace") if self._text else said

    def until(self, condition, **bounds):
        """Wait for a condition, which must come while the process lives."""

        def found():
            ended = self.process.poll() is not None
            result = condition()
            assert result or not ended, f"it ended with {self.process.returncode}: {self.err}"
            return result

        return wait_until(found, **bounds)

    def send(self, number, *, group=False):
        """Send a signal to it, or to all of its session as a terminal does."""
        (os.killpg if group else os.kill)(self.process.pid, number)

    def end(self, within=WITHIN):
        """Wait for its end; what it said."""
        code = self.process.wait(timeout=within)
        return CompletedProcess(self.process.args, code, self.out, self.err)

    def descendants(self):
        """Processes that it started, and those that these did, whoever is their parent now."""
        found = []
        for process in psutil.process_iter():
            try:
                # Dead ones that nobody has asked for are no processes any more.
                if process.pid != self.process.pid and process.status() != psutil.STATUS_ZOMBIE:
                    found += [process] if process.environ().get(_MARK) == self._mark else []
            except (psutil.Error, OSError):
                continue
        return found

    def close(self):
        """End it and all its descendants."""
        self.process.kill()
        self.process.wait()
        while left := self.descendants():
            for each in left:
                try:
                    each.kill()
                except psutil.Error:
                    continue
            psutil.wait_procs(left, timeout=5.0)
        for file in self._said:
            file.close()


@contextmanager
def started(*command, **options):
    """A process while the block lasts; options: `cwd`, `env` (added to the environment), `text` (or bytes)."""
    child = Child(command, **options)
    try:
        yield child
    finally:
        child.close()


def run(*command, within=2 * WITHIN, check=False, **options):
    """A process, waited for: its exit code and what it said; with `check` the code must be 0."""
    with started(*command, **options) as child:
        done = child.end(within)
    assert not check or done.returncode == 0, done.stderr
    return done


def python(*arguments, **options):
    """What `run` gives of Python."""
    return run(sys.executable, *arguments, **options)
