"""`paraflex edit`: the workbench, a page in the browser on which a mechanism is drawn, moved and run."""

import webbrowser

from paraflex.errors import InputError
from .commands.models import EditRequest
from .signals import end_by_ctrl_c, exit_code
from .tables import PlainConsole


def edit_command(request: EditRequest) -> int:
    """Serve the page until it is closed or a signal ends it; return the exit code."""
    try:
        from paraflex.workbench.host import Host
    except ImportError as error:
        raise InputError(f"{error.name} is missing", field="edit", remedy="pip install 'paraflex[edit]'") from None
    from paraflex.workbench.document import Document

    document = Document(request.source)
    end_by_ctrl_c()
    host, console = Host(document), PlainConsole()
    try:
        console.print_lines(f"{document.name} is edited at {host.address}", "closing the page or Ctrl-C ends this")
        if request.open and not webbrowser.open(host.address):
            console.print_lines("no browser opens it here")
        host.serve()
    except KeyboardInterrupt:
        host.end()
        return exit_code()
    return 0
