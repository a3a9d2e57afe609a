"""Commands as a shell gives them: what they print, and their exit code; in this process but for Ctrl-C."""

import contextlib
import io
import signal
import sys
import traceback
import warnings
from subprocess import CompletedProcess
from unittest.mock import patch

from paraflex.cli.app import main
from processes import started

# Says when the time loop has begun.
BEGUN = """
import sys
from paraflex.__main__ import main
from paraflex.integrators.native import NativeRun
start = NativeRun.start
def begun(run):
    start(run)
    print("begun", file=sys.stderr, flush=True)
NativeRun.start = begun
main()
"""


def interrupted(*arguments):
    """What a command that would take minutes says on stderr when Ctrl-C ends it in its run; its exit code is 130."""
    with started(sys.executable, "-c", BEGUN, *arguments) as child:
        child.until(lambda: "begun\n" in child.err)
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


def paraflex(*arguments, cwd=None, mixed=False):
    """A command; every warning that reaches Python is an error, and an error that is none of ours a traceback.

    Mixed, its lines on stderr are among those on stdout, in the order of a terminal.
    """
    line = ["paraflex", *map(str, arguments)]
    out, code = io.StringIO(), 0
    err = out if mixed else io.StringIO()
    with contextlib.ExitStack() as stack:
        stack.enter_context(patch.object(sys, "argv", line))
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("error")
        if cwd is not None:
            stack.enter_context(contextlib.chdir(cwd))
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        except Exception:
            traceback.print_exc()
            code = 1
    return CompletedProcess(line, code, out.getvalue(), err.getvalue())
