"""Entry point of the command line, as `python -m paraflex` and as `paraflex`."""

import os
import sys
from contextlib import suppress


def main() -> None:
    """Run the command line; a signal ends it at any time with a one-line message and the exit code of the signal."""
    from .cli.signals import exit_code, is_taken, leave_when_signalled

    leave_when_signalled()
    from .cli.app import main as command_line

    try:
        command_line()
    finally:
        if is_taken():
            import multiprocessing

            # Results of threads that still compute are not needed any more.
            with suppress(OSError, ValueError):
                sys.stdout.flush()
                sys.stderr.flush()
            for process in multiprocessing.active_children():
                process.kill()
            os._exit(exit_code())


# Worker processes import this file as well and must not start the command line.
if __name__ == "__main__":
    main()
