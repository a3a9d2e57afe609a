"""Folders of results as somebody hostile would send them: does a reader fail rawly, hang, reach out, or believe them?

    python benchmarks/foreign_folders.py [--cases N] [--seed N] [--only ATTACK ...] [--write]

Small results are made: a run, a study of equilibria, a sweep with its journal and trajectories. A case copies one into
`in/`, beside `out/` with files that are bait, damages the copy by an attack (`foreign_attacks.py` has them) and lets
one reader at it, in a process of its own with bounded memory: `load_results`, what figures are drawn of, `paraflex
plot`, `report`, `export`, `compare`, `animate`, `linearise`, or the command that wrote the results, there again. It
counts

- hang: it goes on for more than a minute;
- raw: a traceback, or an exception that is not paraflex's own;
- outside: anything in `out/` or beside it is changed, made or removed, is opened because the copy says so, or is
  quoted; a process or a connection is begun;
- silent: other numbers are read, where files are not those of the manifest; the command ends well and leaves others;
- script: text of the copy stands in a page, a picture, a table or on the terminal as if it were paraflex's;
- refused: an error that is paraflex's own, in one line; and read: it ends well.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import resource
import shutil
import stat
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from bit_flips import _plain
from common import command_line, table, write_json
from foreign_attacks import ATTACKS, MARK, NAME, TOKEN, Attack, make_bait
from kills import FILES, LINES, SHORT, ended, processes_of, started

CASES, SEED = 300, 7
FAILURES = ("hang", "raw", "outside", "silent", "script")
OUTCOMES = (*FAILURES, "refused", "read")
# Time [s] and memory [bytes], beyond what the process has at first, of a reader.
_BOUND, _MEMORY = 60.0, 3 << 30
_NUMBERS = ["--no-figures", "--no-report"]
# What makes the results of a kind.
MADE = {
    "run": ["run", *SHORT, "--tol", "1e-3", *_NUMBERS],
    "statics": [*LINES["statics"], *_NUMBERS],
    "sweep": ["sweep", "sweep.toml", "--workers", "1", "--no-report"],
}
_FIGURES = ("motor_torques", "end_effector_path", "mechanism_drawing", "joint_forces", "mode_comparison")
# Readers: lines of the command, with IN for the folder and WORK for another; or what is read in Python.
_OF_ALL = {
    "open": "open",
    "source": "source",
    "list": ["plot", "IN"],
    "report": ["report", "IN", "--force"],
    "csv": ["export", "IN", "--to", "csv", "--force"],
    "again": "again",
}
READERS: dict[str, dict[str, str | list[str]]] = {
    "run": _OF_ALL | {
        "plot": ["plot", "IN", *_FIGURES, "--format", "svg", "--force"],
        "mat": ["export", "IN", "--to", "mat", "--output", "WORK/x.mat"],
        "netcdf": ["export", "IN", "--to", "netcdf", "--output", "WORK/x.nc"],
        "compare": ["compare", "WHOLE", "IN", "--json"],
        "animate": ["animate", "IN", "WORK/x.svg", "--fps", "4"],
        "linearise": ["linearise", "IN", "--at", "0.01"],
    },
    "statics": _OF_ALL | {
        "plot": ["plot", "IN", "force_travel", "--format", "svg", "--force"],
        "parquet": ["export", "IN", "--to", "parquet", "--force"],
    },
    "sweep": _OF_ALL | {
        "plot": ["plot", "IN", "all", "--format", "svg", "--force"],
        "compare": ["compare", "FIRST", "FIRST"],
    },
}  # fmt: skip
# What a process asks of the system, with the place of a path among its arguments.
_ASKED = {
    "open": (0,), "os.rename": (0, 1), "os.remove": (0,), "os.mkdir": (0,), "os.rmdir": (0,), "os.link": (0, 1),
    "os.symlink": (1,), "os.truncate": (0,), "os.listdir": (0,), "os.scandir": (0,), "sqlite3.connect": (0,),
    "shutil.rmtree": (0,), "os.chmod": (0,),
}  # fmt: skip
_NEVER = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "socket.connect", "socket.getaddrinfo")


class Case(NamedTuple):
    """An attack on a folder and a reader, and what came of it."""

    kind: str
    attack: str
    how: str
    reader: str
    outcome: str
    detail: str


class Sandbox(NamedTuple):
    """Where a case happens.

    Attributes
    ----------
    place : Path
    whole : Path
        Results as they were made, a folder of each kind.
    """

    place: Path
    whole: Path

    @property
    def folder(self) -> Path:
        """The damaged copy."""
        return self.place / "in"

    @property
    def bait(self) -> Path:
        """Files that nobody has to touch."""
        return self.place / "out"

    @property
    def work(self) -> Path:
        """Where readers write what they do not write into the copy."""
        return self.place / "work"

    @property
    def notes(self) -> Path:
        """What the process of a reader noted, and said."""
        return self.place / "notes"


def make_results(place: Path, kinds: list[str]) -> None:
    """Results of some kinds, each in a folder, and the files that they are of."""
    study = FILES["sweep"].replace("number = 8", "number = 2")
    (place / "sweep.toml").write_text(study, encoding="utf-8")
    for kind in kinds:
        log = place / f"{kind}.log"
        code = ended(started(lambda line=[*MADE[kind], "--out", str(place / kind)]: _command(line, place), log), 600.0)
        if code != 0:
            sys.exit(f"{kind} does not run:\n{log.read_text()}")


def cases(whole: Path, number: int, seed: int, attacks: dict[str, Attack], bound: float = _BOUND) -> Iterator[Case]:
    """So many cases, attacks alike many times, readers and kinds at random."""
    kinds = [kind for kind in MADE if (whole / kind).is_dir()]
    expected = {
        f"{kind} {how}": _numbers(whole / kind, kind, how) for kind in kinds for how in ("open", "source")
    }  # fmt: skip
    names = list(attacks)
    for k in range(number):
        chance = Random(f"{seed} {k}")
        name = names[k % len(names)]
        kind = chance.choice([kind for kind in kinds if kind in attacks[name].kinds])
        reader = chance.choice([each for each in attacks[name].readers or READERS[kind] if each in READERS[kind]])
        with tempfile.TemporaryDirectory() as place:
            try:
                yield _case(Sandbox(Path(place), whole), kind, name, attacks[name], reader, chance, expected, bound)
            finally:
                _open_again(Path(place))


def _open_again(place: Path) -> None:
    """Permissions that an attack took away would keep the sandbox."""
    for each in [place / "in", *(place / "in").rglob("*")]:
        if each.is_dir() and not each.is_symlink():
            each.chmod(0o755)


def _case(
    box: Sandbox, kind: str, name: str, attack: Attack, reader: str, chance: Random, expected: dict[str, str],
    bound: float,
) -> Case:  # fmt: skip
    shutil.copytree(box.whole / kind, box.folder, symlinks=True)
    for folder in (box.work, box.notes):
        folder.mkdir()
    make_bait(box.bait, box.whole)
    how = attack.does(box.folder, box.bait, chance)
    before, quoted = snapshot(box), _quoting(box)
    log = box.notes / "log"
    child = started(lambda: _read(box, kind, reader), log)
    code = ended(child, bound)
    hung = code is None
    if hung or processes_of(child):
        os.killpg(child, 9)
        if hung:
            os.waitpid(child, 0)
    said = log.read_bytes()
    outcome, detail = "read" if code == 0 else "refused", said.decode(errors="replace").strip()[-400:]
    for found, why in (
        ("hang", f"after {bound:g} s" if hung else ""),
        ("raw", "" if hung else _raw(code, said)),
        ("outside", _outside(box, reader, before, quoted)),
        ("silent", _silent(box, kind, reader, code, attack, expected)),
        ("script", _script(box, said)),
    ):
        if why:
            outcome, detail = found, f"{why}: {detail}"
            break
    return Case(kind, name, how, reader, outcome, detail)


def _read(box: Sandbox, kind: str, reader: str) -> None:
    """What the process of a reader does."""
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + _MEMORY, hard))
    os.chdir(box.work)
    sys.addaudithook(_watch(box))
    how = READERS[kind][reader]
    try:
        if isinstance(how, str) and how != "again":
            (box.notes / "numbers").write_text(_numbers(box.folder, kind, how), encoding="utf-8")
            return
        _command(_line(box, kind, how), box.whole)
    except Exception as error:
        from paraflex.errors import ParaflexError

        if isinstance(error, ParaflexError):
            print(f"error: {error}", file=sys.stderr)
            sys.exit(2)
        raise


def _command(line: list[str], files: Path) -> None:
    from paraflex.cli.app import main

    if "sweep.toml" in line:
        line = [str(files / word) if word == "sweep.toml" else word for word in line]
    sys.argv = ["paraflex", *line]
    main()


def _line(box: Sandbox, kind: str, how: str | list[str]) -> list[str]:
    """The words of a command."""
    if how == "again":
        return [*MADE[kind], "--out", str(box.folder)]
    first = next(iter(sorted(box.folder.glob("trajectories/*.nc"))), box.folder / "trajectories")
    places = {"IN": box.folder, "WORK": box.work, "WHOLE": box.whole / kind, "FIRST": first}
    words = []
    for word in how:
        start, slash, end = word.partition("/")
        words.append(f"{places[start]}{slash}{end}" if start in places else word)
    return words


def _numbers(folder: Path, kind: str, how: str) -> str:
    """A digest of what is read of a folder; of a sweep's runs, or their table."""
    import paraflex as pf
    from paraflex.plots.sources import open_source

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        if how == "open" and kind == "sweep":
            # Where none is kept, the folder says so.
            data: Any = [pf.open_results(each) for each in sorted(folder.glob("trajectories/*.nc")) or [folder]]
        elif how == "open":
            data = pf.load_results(folder)
        else:
            data = open_source(folder).data
    return hashlib.blake2b(_plain(_timeless(data)).encode(errors="replace")).hexdigest()


def _timeless(data: Any) -> Any:
    """A dataset without wall times."""
    import xarray as xr

    if isinstance(data, list):
        return [_timeless(each) for each in data]
    if isinstance(data, xr.Dataset):
        return data.drop_vars([each for each in data.variables if "wall" in str(each)])
    return data


def _watch(box: Sandbox) -> Callable[[str, tuple], None]:
    """A hook that notes what is asked of the system outside of the copy, by the names that are given."""
    log, inside = os.open(box.notes / "asked", os.O_WRONLY | os.O_CREAT | os.O_APPEND), str(box.place)
    allowed = (str(box.folder), str(box.work), str(box.notes))

    def hook(event: str, arguments: tuple) -> None:
        if event in _NEVER:
            os.write(log, f"{event} {arguments!r}\n".encode(errors="replace"))
        for place in _ASKED.get(event, ()):
            path = arguments[place]
            if not isinstance(path, str | bytes | os.PathLike):
                continue
            text = os.fsdecode(path).removeprefix("file://").partition("?")[0]
            name = os.path.normpath(os.path.join(str(box.work), text))
            if name.startswith(inside) and not any(name == each or name.startswith(f"{each}/") for each in allowed):
                os.write(log, f"{event} {name}\n".encode(errors="replace"))

    return hook


def snapshot(box: Sandbox) -> dict[str, Any]:
    """All that lies in the sandbox outside of the copy and of where readers write."""
    found: dict[str, Any] = {}
    for each in sorted([*box.place.iterdir(), *box.bait.rglob("*")]):
        about = each.lstat()
        digest = hashlib.blake2b(each.read_bytes()).hexdigest() if stat.S_ISREG(about.st_mode) else ""
        times = about.st_mtime_ns if box.bait in (each, *each.parents) else 0
        found[str(each.relative_to(box.place))] = (about.st_mode, digest, times)
    return found


def _quoting(box: Sandbox) -> dict[bytes, str]:
    """Files of the copy and of readers in which the bait's text stands, by what they hold."""
    return {each.read_bytes(): each.name for each in _written(box) if TOKEN in each.read_bytes()}


def _written(box: Sandbox) -> Iterator[Path]:
    for folder in (box.folder, box.work):
        for each in folder.rglob("*"):
            about = each.lstat()
            if stat.S_ISREG(about.st_mode) and about.st_size < 1 << 26:
                yield each


def _raw(code: int | None, said: bytes) -> str:
    for sign in (b"Traceback (most recent call last)", b"Exception ignored"):
        if sign in said:
            return "a traceback"
    if code not in (0, 1, 2) or (code and b"error: " not in said and code != 1):
        return f"exit code {code}"
    return ""


def _outside(box: Sandbox, reader: str, before: dict[str, Any], quoted: dict[bytes, str]) -> str:
    after = snapshot(box)
    changed = [name for name in {*before, *after} if before.get(name) != after.get(name)]
    if changed:
        return f"changed {sorted(changed)}"
    asked = box.notes / "asked"
    lines = asked.read_text(errors="replace").splitlines() if asked.exists() else []
    # Results are linearised by the files of the model and the path that they name, wherever those are.
    if lines := [line for line in lines if not (reader == "linearise" and line.startswith("open "))]:
        return f"asked for {lines[:3]}"
    more = [name for content, name in _quoting(box).items() if content not in quoted]
    if more or TOKEN in (box.notes / "log").read_bytes():
        return f"the bait is quoted in {more or 'what is said'}"
    return ""


def _silent(
    box: Sandbox, kind: str, reader: str, code: int | None, attack: Attack, expected: dict[str, str]
) -> str:  # fmt: skip
    """Whether other numbers were read, or are there after the command that makes them anew."""
    numbers = box.notes / "numbers"
    if code == 0 and reader == "again" and kind != "sweep":

        def read() -> None:
            numbers.write_text(_numbers(box.folder, kind, "open"))

        child = started(read, box.notes / "again")
        if ended(child, _BOUND) != 0:
            return "the results that the command left are not read"
    elif code != 0 or reader not in ("open", "source") or not attack.told:
        return ""
    said = (box.notes / "log").read_text(errors="replace")
    same = numbers.read_text() == expected[f"{kind} {'open' if reader == 'again' else reader}"]
    return "" if same or "Warning" in said else "other numbers"


class _Tags(HTMLParser):
    """Looks for a tag or an attribute that only the attacks have."""

    found = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """See a tag."""
        if tag == NAME or any(name.endswith(NAME) for name, _ in attrs):
            self.found = f"<{tag} {attrs}>"

    handle_startendtag = handle_starttag


def _script(box: Sandbox, said: bytes) -> str:
    """Where text of the copy would do something to whoever looks at what was written or said."""
    if b"\x1b" in said:
        return "an escape on the terminal"
    for each in _written(box):
        if each.suffix not in (".html", ".svg", ".csv") or MARK.encode() not in (content := each.read_bytes()):
            continue
        text = content.decode(errors="replace")
        if each.suffix == ".csv":
            if any(cell.startswith(("=", "+@", "@")) for row in csv.reader(text.splitlines()) for cell in row):
                return f"a formula in {each.name}"
            continue
        tags = _Tags()
        tags.feed(text)
        if tags.found:
            return f"{tags.found} in {each.name}"
    return ""


def main() -> None:
    """Make results, let readers at damaged copies, print the table."""
    parser = command_line(__doc__)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", nargs="*", choices=ATTACKS, default=list(ATTACKS))
    asked = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _import_once()
    with tempfile.TemporaryDirectory() as place:
        make_results(Path(place), list(MADE))
        found = []
        for case in cases(Path(place), asked.cases, asked.seed, {name: ATTACKS[name] for name in asked.only}):
            found.append(case)
            if case.outcome in FAILURES:
                print(len(found) - 1, json.dumps(case._asdict(), indent=1), file=sys.stderr, flush=True)
    counts = Counter((case.attack, case.outcome) for case in found)
    totals = Counter(case.outcome for case in found)
    lines = [[name, *(str(counts[name, outcome]) for outcome in OUTCOMES)] for name in asked.only]
    lines.append(["all", *(str(totals[outcome]) for outcome in OUTCOMES)])
    print(table(["attack", *OUTCOMES], lines))
    named = [dict(zip(("attack", *OUTCOMES), line, strict=True)) for line in lines]
    write_json("foreign_folders", {"cases": asked.cases, "seed": asked.seed, "attacks": named}, asked.folder)
    sys.exit(any(totals[each] for each in FAILURES))


def _import_once() -> None:
    """Import what all readers need: they are forked."""
    import paraflex.cli.app
    import paraflex.plots
    import paraflex.plots.film
    import paraflex.reports
    import paraflex.results.export
    import paraflex.studies  # noqa: F401


if __name__ == "__main__":
    main()
