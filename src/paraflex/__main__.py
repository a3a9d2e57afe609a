"""`python -m paraflex` and `paraflex` are the command line."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


def main() -> None:
    """Run the command line; a signal ends it with a line and its exit code at any time."""
    from paraflex.cli.signals import exit_code, is_taken, leave_when_signalled

    leave_when_signalled()
    from paraflex.cli.app import main as command_line

    try:
        command_line()
    finally:
        if is_taken():
            import multiprocessing

            # Whatever threads still compute, nobody asks for.
            with suppress(OSError, ValueError):
                sys.stdout.flush()
                sys.stderr.flush()
            for process in multiprocessing.active_children():
                process.kill()
            os._exit(exit_code())


# Worker processes import this file too.
if __name__ == "__main__":
    main()
