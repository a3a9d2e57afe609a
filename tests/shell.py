"""Commands as a shell gives them: what they print, and their exit code; in this process but for Ctrl-C."""

import contextlib
import io
import signal
import sys
import time
import traceback
import warnings
from subprocess import PIPE, CompletedProcess, Popen
from unittest.mock import patch

from paraflex.cli.app import main


def interrupted(*arguments, said=""):
    """What a command that would take minutes says on stderr when Ctrl-C ends it; its exit code is 130.

    On a busy machine the first Ctrl-C may come before Python is ready for it, or before it has said `said`.
    """
    for wait in (4.0, 12.0, 40.0, 100.0):
        process = Popen([sys.executable, "-m", "paraflex", *arguments], stderr=PIPE, stdout=PIPE, text=True)
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        if process.returncode == 130 and said in errors:
            break
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    return errors


def paraflex(*arguments, cwd=None):
    """A command; every warning that reaches Python is an error, and an error that is none of ours a traceback."""
    line = ["paraflex", *map(str, arguments)]
    out, err, code = io.StringIO(), io.StringIO(), 0
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
