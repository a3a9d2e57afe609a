"""Collected warnings of a command: each is printed once, when the command ends or before its numbers."""

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import typer

from paraflex.errors import ParaflexWarning, printable
from paraflex.findings import Finding, Verdict

_found: list[Finding] = []
_elsewhere: list[Finding] = []
_others: list[str] = []
_printed: set[str] = set()


@contextmanager
def collecting() -> Iterator[None]:
    """Collect paraflex warnings and print them when the command ends; other warnings are shown as before."""
    for earlier in (_found, _elsewhere, _others, _printed):
        earlier.clear()
    with warnings.catch_warnings():
        warnings.simplefilter("always", ParaflexWarning)
        before = warnings.showwarning

        def collect(message, category, filename, lineno, file=None, line=None) -> None:
            if not isinstance(message, ParaflexWarning):
                before(printable(str(message)), category, filename, lineno, file, line)
            elif message.finding is not None:
                _found.append(message.finding)
            else:
                _others.append(str(message))

        warnings.showwarning = collect
        try:
            yield
        finally:
            for text in dict.fromkeys([*map(str, Verdict([*_found, *_elsewhere])), *_others]):
                if text not in _printed:
                    typer.echo(f"warning: {text}", err=True)


def collected(more: Iterable[Finding] = ()) -> Verdict:
    """Return the findings of all warnings so far, together with `more`."""
    return Verdict([*_found, *more])


@contextmanager
def apart() -> Iterator[None]:
    """Assign the warnings within the context to one of several results: afterwards `collected` omits them."""
    before = len(_found)
    try:
        yield
    finally:
        _elsewhere.extend(_found[before:])
        del _found[before:]


def printed(findings: Iterable[Finding]) -> None:
    """Mark findings as printed, so that they are not printed again when the command ends."""
    _printed.update(map(str, findings))
