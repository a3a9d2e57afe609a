"""Warnings of a command, collected: each is printed once, when the command ends or before its numbers."""

from __future__ import annotations

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
    """Keep warnings of ours until the command ends; those of others go where they went."""
    _found.clear()
    _elsewhere.clear()
    _others.clear()
    _printed.clear()
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
    """What has been warned of until now, and more that is found."""
    return Verdict([*_found, *more])


@contextmanager
def apart() -> Iterator[None]:
    """What is warned of meanwhile belongs to one of several results: `collected` gives it to no other."""
    before = len(_found)
    try:
        yield
    finally:
        _elsewhere.extend(_found[before:])
        del _found[before:]


def printed(findings: Iterable[Finding]) -> None:
    """Note that these need not be printed when the command ends."""
    _printed.update(map(str, findings))
