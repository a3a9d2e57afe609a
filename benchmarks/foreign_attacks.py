"""What somebody hostile does to a folder of results before it is sent: the attacks of `foreign_folders.py`.

Each takes the copy of a folder, the folder with bait and a source of chance, and says in a few words what it did.
Files whose digest the manifest has are listed anew where the attack is to get further than that.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import socket
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import xarray as xr

from paraflex.campaign.journal import JOURNAL, _digest as row_digest
from paraflex.folders import MANIFEST, Manifest
from paraflex.folders.held import digest_of

# Text that stands in the bait alone; the name of a tag and an attribute that nobody but the attacks uses; text that is
# a formula, ends every element and quotation, and colours a terminal.
TOKEN = b"hush-7f3a"
NAME = "pwned"
MARK = f"<{NAME}"
HOSTILE = f"=1+1</script></style></title></textarea>]]>\"'><{NAME} on{NAME}='1'>\x1b[31m${{1}}\\u003c"
# Of the names in lists of files.
NAMES = (
    "../out/secret.txt", "/OUT/secret.txt", "..\\out\\secret.txt", "C:\\secret.txt", "C:x", "\\\\host\\share\\x",
    "a\0b", "a\0b/c", "a" * 5000, "x/" * 3000 + "y", "\ud800", "\ud800/x", "", ".", "..", "/", "figures", "results.nc",
    "figures/../../out/secret.txt", "\n", "CON", ".lock", ".ready/manifest.json", "manifest.json", ".ready", "~/x",
    HOSTILE.replace("/", "-"), "results.nc/x",
)  # fmt: skip
_OWN = (
    ".new", ".ready", ".lock", "figures", "trajectories", "parts", "export", "report.html", "report.html.part",
    "results.csv", "unfinished.parquet", "figures/torques.svg", "figures/torques.svg.part", "export/time_series.csv",
    "parts/part-000000.parquet", "summary.json", "study.json", "manifest.json", "journal.sqlite-journal",
    "journal.sqlite-wal", "journal.sqlite-shm", "journal.sqlite.copy.part", "journal.sqlite.part", "study.json.part",
    "trajectories/x.nc.part", "verify.json", "result.json", ".ready/removed.json", ".ready/manifest.json",
)  # fmt: skip
_DEEP = 100_000
_HUGE = "1" + "0" * 400
# Larger than a reader's memory, and not on the disk [bytes].
_SPARSE = 1 << 33
_BLOB = 50_000_000
# Plain values in place of others.
_WRONG: tuple[Any, ...] = (
    None, True, 0, -1, 1e308, float("nan"), float("inf"), int(_HUGE), "", "x", HOSTILE, [], [[]], {}, {"x": []},
)  # fmt: skip

Does = Callable[[Path, Path, Random], str]


class Attack(NamedTuple):
    """An attack.

    Attributes
    ----------
    does : callable
    told : bool
        Whether other numbers than those of the folder must not be read without a word.
    kinds : sequence of str
        Of results that it is made for.
    readers : sequence of str
        That look at what it damages, some more often than others; all where none is named.
    """

    does: Does
    told: bool = False
    kinds: Sequence[str] = ("run", "statics", "sweep")
    readers: Sequence[str] = ()


def make_bait(bait: Path, whole: Path) -> None:
    """Files that are not to be touched: secrets, tables, results of others."""
    (bait / "folder").mkdir(parents=True)
    (bait / "empty").write_bytes(b"")
    (bait / "secret.txt").write_bytes(TOKEN + b"\n")
    (bait / "table.csv").write_bytes(b"0, 1\n1, 2\n" + TOKEN + b"\n")
    (bait / "folder" / "secret.txt").write_bytes(TOKEN + b" in a folder\n")
    for folder in (bait, bait / "folder"):
        for name in ("x.part", "x.nc.part", "x.nc", "part-000000.parquet", "torques.svg", "time_series.csv", "x.csv"):
            (folder / name).write_bytes(TOKEN + b"\n")
    for kind in ("run", "statics", "sweep"):
        if (whole / kind).is_dir():
            shutil.copytree(whole / kind, bait / kind)


def relist(folder: Path) -> None:
    """Make the manifest one of the files as they are."""
    old = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    files = {name: digest_of(folder / name) for name in old["files"] if (folder / name).is_file()}
    write(folder / MANIFEST, {"paraflex_version": "1"} | vars(Manifest.of(old["kind"], files, {})))


def write(file: Path, value: Any) -> None:
    """Write JSON without a digest."""
    file.write_text(json.dumps(value), encoding="utf-8")


def _clear(place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


def _files(folder: Path) -> list[Path]:
    return sorted(each for each in folder.rglob("*") if each.is_file())


def _place(folder: Path, chance: Random) -> Path:
    """A file of a folder, or what paraflex may look for there."""
    there = [each.relative_to(folder).as_posix() for each in _files(folder)]
    return folder / chance.choice([*there, *_OWN])


def link(folder: Path, bait: Path, chance: Random) -> str:
    """A symbolic link in place of a file or folder."""
    place = _place(folder, chance)
    _clear(place)
    ends = [bait / "secret.txt", bait / "none", bait / "folder", bait, bait / "empty", folder.parent, folder, place,
            "/dev/zero", "/dev/null", "/proc/self/mem", "/proc/self/environ", *_files(bait)]  # fmt: skip
    if (same := list(bait.rglob(place.name))) and chance.random() < 0.5:
        ends = same
    end = Path(chance.choice(ends))
    end = Path(os.path.relpath(end, place.parent)) if chance.random() < 0.5 else end
    place.symlink_to(end)
    return f"{place.relative_to(folder)} -> {end}"


def linked_folder(folder: Path, bait: Path, chance: Random) -> str:
    """A link in place of a folder that is written to, and perhaps numbers that are to be made again."""
    place = folder / chance.choice(["trajectories", "trajectories", "figures", "export", "parts", ".new", ".ready"])
    _clear(place)
    end = chance.choice([bait, bait / "folder", bait / "none", folder, bait / "sweep" / "trajectories"])
    place.symlink_to(end)
    gone = chance.choice([(), (JOURNAL,), (JOURNAL, "results.parquet", MANIFEST), (MANIFEST,), ("results.parquet",)])
    for name in gone:
        (folder / name).unlink(missing_ok=True)
    return f"{place.name} -> {end.relative_to(folder.parent)}, without {gone}"


def folder_kind(folder: Path) -> str:
    """The kind of a folder's results."""
    return "sweep" if (folder / JOURNAL).exists() else "run" if (folder / "results.nc").exists() else "statics"


def hard_link(folder: Path, bait: Path, chance: Random) -> str:
    """A file of others under a name that is written to."""
    place = chance.choice(_files(folder)) if chance.random() < 0.7 else _place(folder, chance)
    same = [each for each in _files(bait / folder_kind(folder)) if each.name == place.name] or _files(bait)
    end = chance.choice(same)
    _clear(place)
    os.link(end, place)
    return f"{place.relative_to(folder)} = {end.relative_to(bait)}"


def ready(folder: Path, bait: Path, chance: Random) -> str:
    """A change that is ready to be moved, whose lists name other files."""
    inner = folder / ".ready"
    inner.mkdir()
    names = [name.replace("/OUT", str(bait)) for name in chance.sample(NAMES, chance.choice([1, 1, 3]))]
    shutil.copy(folder / MANIFEST, inner)
    write(inner / "removed.json", chance.choice([names, names, dict.fromkeys(names, 1), [names], [*names, 1]]))
    if chance.random() < 0.3:
        (inner / "figures").mkdir()
        (inner / "figures" / "x.svg").write_text("<svg/>")
    return f"removed.json {str(names)[:80]}"


def ready_files(folder: Path, bait: Path, chance: Random) -> str:
    """A change that is ready to be moved, with files that are none."""
    inner = folder / ".ready"
    inner.mkdir()
    shutil.copy(folder / MANIFEST, inner)
    write(inner / "removed.json", [])
    kind = chance.choice(
        ["link", "folder link", "bytes", "long", "line", "fifo", "lock", "list", "journal", "rights", "deep"]
    )
    match kind:
        case "link":
            (inner / "x.nc").symlink_to(bait / "secret.txt")
        case "folder link":
            (inner / "figures").symlink_to(bait)
        case "bytes":
            Path(os.fsdecode(os.fsencode(inner) + b"/\xff\xfe.nc")).write_bytes(b"x")
        case "long":
            (inner / ("a" * 255)).write_bytes(b"x")
        case "line":
            (inner / f"a\n{HOSTILE.replace('/', '-')}").write_bytes(b"x")
        case "fifo":
            (inner / "removed.json").unlink()
            os.mkfifo(inner / "removed.json")
        case "lock":
            (inner / ".lock").write_bytes(b"x")
        case "list":
            (inner / "manifest.json").unlink()
            (inner / "manifest.json").symlink_to(bait / "run" / MANIFEST)
        case "journal":
            shutil.copy(bait / "secret.txt", inner / "journal.sqlite-journal")
        case "rights":
            inner.chmod(0)
        case "deep":
            deep = inner / "/".join(["d" * 200] * 15)
            deep.mkdir(parents=True)
            (deep / "x").write_bytes(b"x")
    return kind


def manifest(folder: Path, bait: Path, chance: Random) -> str:
    """A manifest with wrong types, huge numbers, names of other places; also where its digests hold."""
    file = folder / MANIFEST
    found = json.loads(file.read_text(encoding="utf-8"))
    kind = chance.choice(["types", "names", "names", "kind", "deep", "huge", "twice", "empty", "bytes", "contents"])
    detail = ""
    match kind:
        case "types":
            key = chance.choice([*found])
            found[key] = chance.choice(_WRONG)
            detail = f"{key} {found[key]!r:.60}"
        case "names":
            names = [name.replace("/OUT", str(bait)) for name in chance.sample(NAMES, 2)]
            digest = hashlib.blake2b((bait / "secret.txt").read_bytes(), digest_size=16).hexdigest()
            found["files"] |= dict.fromkeys(names, digest)
            with suppress(UnicodeEncodeError):
                found |= vars(Manifest.of(found["kind"], found["files"], found["contents"]))
            detail = str(names)[:80]
        case "kind":
            from paraflex.folders import FOLDER_FILES

            detail = found["kind"] = chance.choice([*FOLDER_FILES])
        case "contents":
            one = chance.choice(_WRONG)
            contents: Any = dict.fromkeys(found["files"], one)
            found |= vars(Manifest.of(found["kind"], found["files"], contents))
            detail = f"{one!r:.60}"
        case _:
            texts = {"deep": "[" * _DEEP, "huge": '{"files": {"x": ' + _HUGE * 1000 + "}}",
                     "twice": '{"kind": "run", "kind": 1, "files": {}, "identity": ""}', "empty": "",
                     "bytes": "\xff\xfe"}  # fmt: skip
            file.write_bytes(texts[kind].encode("latin-1"))
            return kind
    found.pop("digest", None)
    write(file, found)
    return f"{kind} {detail}"


def special(folder: Path, bait: Path, chance: Random) -> str:
    """A fifo, a device, a socket, a folder, or a file larger than memory in place of a file."""
    place = _place(folder, chance)
    _clear(place)
    kind = chance.choice(["fifo", "fifo", "fifo", "device", "socket", "folder", "sparse", "unreadable"])
    if kind == "device":
        with suppress(OSError):
            os.mknod(place, 0o666 | 0o020000, os.makedev(1, 5))
        if not place.exists():
            place.symlink_to("/dev/zero")
    elif kind == "fifo":
        os.mkfifo(place)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as one, suppress(OSError):
            one.bind(str(place))
    elif kind == "folder":
        place.mkdir()
        (place / "x").write_text("x")
    elif kind == "sparse":
        with place.open("wb") as opened:
            opened.truncate(_SPARSE)
    else:
        place.write_bytes(b"{}")
        place.chmod(0)
    return f"{kind} {place.relative_to(folder)}"


def plain_values(folder: Path, bait: Path, chance: Random) -> str:
    """Other values in a file of JSON that is listed anew."""
    file = chance.choice([each for each in folder.glob("*.json") if each.name != MANIFEST])
    kind, detail = chance.choice(["types", "types", "types", "gone", "text", "deep", "bytes"]), ""
    found = json.loads(file.read_text(encoding="utf-8"))
    found.pop("digest", None)
    if kind in ("deep", "bytes"):
        file.write_bytes(b'{"modes": ' + b"[" * _DEEP if kind == "deep" else b"\xff\xfe{}")
    else:
        if kind == "text":
            found = _with_text(found, chance)
        else:
            at, key = _somewhere(found, chance)
            detail = str(key)
            if kind == "types":
                at[key] = chance.choice(_WRONG)
                detail += f" {at[key]!r:.60}"
            else:
                del at[key]
        write(file, found)
    relist(folder)
    return f"{file.name}: {kind} {detail}"


def _somewhere(found: Any, chance: Random) -> tuple[Any, Any]:
    """A place in nested values: the table or list, and its key."""
    while True:
        key = chance.choice([*found] if isinstance(found, dict) else range(len(found)))
        inner = found[key]
        if not isinstance(inner, dict | list) or not inner or chance.random() < 0.3:
            return found, key
        found = inner


def _with_text(found: Any, chance: Random) -> Any:
    """The same with hostile text in place of half of all texts that are no keys."""
    if isinstance(found, dict):
        return {key: _with_text(each, chance) for key, each in found.items()}
    if isinstance(found, list):
        return [_with_text(each, chance) for each in found]
    return HOSTILE if isinstance(found, str) and chance.random() < 0.5 else found


def dataset(folder: Path, bait: Path, chance: Random) -> str:
    """Other variables, dimensions and attributes in a netCDF file without a seal, listed anew."""
    file = chance.choice([*folder.glob("*.nc"), *folder.glob("trajectories/*.nc")])
    data = xr.load_dataset(file, engine="netcdf4")
    changes = chance.sample(list(_CHANGES), chance.choice([1, 1, 2]))
    for name in changes:
        data, detail = _CHANGES[name](data, chance)
        changes[changes.index(name)] = f"{name} {detail}"
    file.unlink()
    try:
        data.to_netcdf(file, engine="netcdf4")
    except Exception as error:  # what the format does not take
        changes.append(f"not written: {type(error).__name__}")
        file.write_bytes(b"CDF\x01" + bytes(100))
    relist(folder)
    return "; ".join(changes)


Change = Callable[[xr.Dataset, Random], tuple[xr.Dataset, str]]


def _drop(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    name = chance.choice([*map(str, data.variables)])
    return data.drop_vars(name), name


def _nothing(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    value = chance.choice([np.nan, np.inf, -1e308, 0.0])
    for name, each in data.variables.items():
        if each.dtype.kind == "f":
            data[name] = each.copy(data=np.full(each.shape, value))
    return data, str(value)


def _one_nothing(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    name = chance.choice([name for name, each in data.variables.items() if each.dtype.kind == "f"])
    data[name] = data[name].variable.copy(data=np.full(data[name].shape, np.nan))
    return data, str(name)


def _no_samples(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    dim = chance.choice(list(data.sizes))
    number = chance.choice([0, 1])
    return data.isel({dim: slice(0, number)}), f"{number} of {dim}"


def _other_type(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    name, kind = chance.choice(list(data.variables)), chance.choice(["U1", "i4", "f4", "u1", "negative"])
    values = data[name].values
    with suppress(ValueError, TypeError):
        new = -values if kind == "negative" else np.full(values.shape, "x") if kind == "U1" else values.astype(kind)
        data[name] = (data[name].dims, new, data[name].attrs)
    return data, f"{name} {kind}"


def _other_dimensions(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    name = chance.choice([name for name in data.data_vars if data[name].ndim] or list(data.data_vars))
    dims = [f"{dim}_{name}" for dim in data[name].dims]
    kind = chance.choice(["renamed", "scalar", "one more", "turned"])
    values, attrs = data[name].values, data[name].attrs
    if kind == "scalar":
        data[name] = ((), values.ravel()[0] if values.size else 0.0, attrs)
    elif kind == "one more":
        data[name] = ((*data[name].dims, "more"), values[..., None], attrs)
    elif kind == "turned":
        data[name] = data[name].transpose(*reversed(data[name].dims))
    else:
        data[name] = (dims, values, attrs)
    return data, f"{name} {kind}"


def _labels(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    """Hostile, equal or empty labels of a dimension, or text in a variable."""
    texts = [name for name, each in data.variables.items() if each.dtype.kind in "UO" and each.size]
    if not texts:
        return data, "no labels"
    name, text = chance.choice(texts), chance.choice([HOSTILE, HOSTILE, "", "x", "../../out/secret.txt", "a" * 100_000])
    values = data[name].values.astype(object)
    values[... if chance.random() < 0.3 else (0,) * values.ndim] = text
    data = data.assign_coords({name: (data[name].dims, values)}) if name in data.coords else data.assign(
        {name: (data[name].dims, values)}
    )  # fmt: skip
    return data, f"{name} {text[:20]!r}"


def _times(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    dim = next((each for each in ("time", "step") if each in data.sizes), None)
    if dim is None:
        return data, "no times"
    kind = chance.choice(["backwards", "equal", "huge", "nan"])
    values = np.asarray(data[dim].values, dtype=float)
    new = {"backwards": values[::-1], "equal": 0 * values, "huge": 1e300 * (1 + values), "nan": np.nan * values}[kind]
    return data.assign_coords({dim: (dim, new, data[dim].attrs)}), kind


def _attribute(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    """An attribute of a wrong type, of hostile text, huge, or JSON of something else."""
    holders = [("", data.attrs), *((str(name), data[name].attrs) for name in data.variables)]
    holder, attrs = chance.choice([holders[0], *(each for each in holders if each[1])])
    name = chance.choice(list(attrs)) if attrs else "schema"
    values = [HOSTILE, HOSTILE, "", 3, -1, 2.5, np.arange(3), "x" * 10_000_000, "[]", "null", "{}", "[" * _DEEP, "NaN",
              f'{{"run": {json.dumps(HOSTILE)}}}', json.dumps({HOSTILE: HOSTILE}), f'{{"run": {_HUGE}}}',
              "../../out/secret.txt"]  # fmt: skip
    value = chance.choice(values)
    attrs[name] = value
    return data, f"{holder}@{name} {value!r:.40}"


def _parameters(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    """What was asked for: wrong types, hostile text, options of the command."""
    asked = json.loads(data.attrs["parameters"]) or {"run": {"mechanism": HOSTILE}}
    kind = chance.choice(["types", "types", "gone", "text"])
    if kind == "text":
        data.attrs["parameters"] = json.dumps(_with_text(asked, chance))
        return data, kind
    at, key = _somewhere(asked, chance)
    at[key] = chance.choice(_WRONG)
    data.attrs["parameters"] = json.dumps(asked)
    return data, f"{key} {at[key]!r:.40}"


def _texts(data: xr.Dataset, chance: Random) -> tuple[xr.Dataset, str]:
    """Hostile text in place of half of all texts of attributes, in what they hold of JSON too."""
    for attrs in [data.attrs, *(data[name].attrs for name in data.variables)]:
        for name, value in attrs.items():
            if isinstance(value, str) and chance.random() < 0.5:
                try:
                    attrs[name] = json.dumps(_with_text(json.loads(value), chance))
                except ValueError:
                    attrs[name] = HOSTILE
    return data, ""


_CHANGES: dict[str, Change] = {
    "drop": _drop, "nothing": _nothing, "one nothing": _one_nothing, "samples": _no_samples, "type": _other_type,
    "dimensions": _other_dimensions, "labels": _labels, "times": _times, "attribute": _attribute,
    "parameters": _parameters, "texts": _texts,
}  # fmt: skip


def other_model(folder: Path, bait: Path, chance: Random) -> str:
    """Another model in what was asked for, or in the study, which names tables and files elsewhere."""
    place = chance.choice(["../out/table.csv", str(bait / "table.csv"), "../../out/table.csv", "own.csv"])
    if place == "own.csv":
        (folder / place).symlink_to(bait / "table.csv")
    load = {"type": "force", "point": "proximal1.A1", "table": place}
    if (folder / "study.json").exists():
        found = json.loads((folder / "study.json").read_text(encoding="utf-8"))
        found.pop("digest", None)
        found["study"]["mechanism"].setdefault("load", {})["hush"] = load
        write(folder / "study.json", found)
        relist(folder)
        return f"load.hush.table {place}"
    file = next(folder.glob("*.nc"))
    data = xr.load_dataset(file, engine="netcdf4")
    asked = json.loads(data.attrs["parameters"])
    model = bait / "model.toml"
    kind = chance.choice(["table", "mechanism", "set", "path", "option"])
    if kind == "table":
        asked.setdefault("model", {}).setdefault("load", {})["hush"] = load
    elif kind == "mechanism":
        asked["run"]["mechanism"] = chance.choice([str(model), "../out/secret.txt", str(bait / "secret.txt")])
    elif kind == "set":
        asked["run"]["set"] = {"load.hush.table": place}
    elif kind == "path":
        asked["run"]["path"] = chance.choice([str(bait / "path.toml"), "--allow-outside", "../out/secret.toml"])
    else:
        asked["run"]["mechanism"] = chance.choice(["--out=../out/new", "--help", "--allow-outside"])
    data.attrs["parameters"] = json.dumps(asked)
    data.to_netcdf(file, engine="netcdf4")
    relist(folder)
    return f"{kind} {place}"


def journal(folder: Path, bait: Path, chance: Random) -> str:
    """A journal that holds other things than rows."""
    if chance.random() < 0.7:
        for name in ("results.parquet", "results.csv", *chance.choice([(), (MANIFEST,)])):
            (folder / name).unlink(missing_ok=True)
    kind = chance.choice(list(_JOURNALS))
    with closing(sqlite3.connect(folder / JOURNAL)) as connection:
        _JOURNALS[kind](connection, folder, bait, chance)
        connection.commit()
    return kind


def _sql(*statements: str) -> Callable[[sqlite3.Connection, Path, Path, Random], None]:
    def work(connection: sqlite3.Connection, folder: Path, bait: Path, chance: Random) -> None:
        for each in statements:
            connection.execute(each)

    return work


def _wal(connection: sqlite3.Connection, folder: Path, bait: Path, chance: Random) -> None:
    """A write-ahead log of another journal."""
    other = folder.parent / "other.sqlite"
    shutil.copy(folder / JOURNAL, other)
    with closing(sqlite3.connect(other)) as one:
        one.execute("PRAGMA journal_mode = WAL")
        one.execute("DELETE FROM runs")
        one.commit()
        shutil.copy(f"{other}-wal", folder / f"{JOURNAL}-wal")
    connection.execute("PRAGMA user_version = 7")
    other.unlink()
    if chance.random() < 0.5:
        connection.commit()
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("UPDATE runs SET run = run + 1")


def _row(connection: sqlite3.Connection, folder: Path, bait: Path, chance: Random) -> None:
    """A row that holds its digest, and something else than a run."""
    content = chance.choice(["[]", "null", "[" * _DEEP, '{"run": 0, "id": 1}', "{", f'{{"run": {_HUGE}}}',
                             json.dumps({"run": 0, "id": HOSTILE, "reason": HOSTILE, "status": HOSTILE})])  # fmt: skip
    run, identity = connection.execute("SELECT run, id FROM runs").fetchone()
    run = chance.choice([run, run, -1, 1 << 60])
    new = (run, identity, content, row_digest(run, identity, content))
    connection.execute("DELETE FROM runs WHERE id = ?", (identity,))
    connection.execute("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?)", new)
    digests = [int(each, 16) for (each,) in connection.execute("SELECT digest FROM runs")]
    _note(connection, "rows", f"{len(digests)} {sum(digests) % (1 << 128)}".encode())


def shared_journal(folder: Path, bait: Path, chance: Random) -> str:
    """The unfinished journal of others, by a hard link."""
    theirs = bait / "sweep" / JOURNAL
    _take_row_out(theirs)
    for name in (JOURNAL, "results.parquet", MANIFEST):
        (folder / name).unlink()
    os.link(theirs, folder / JOURNAL)
    return ""


def _take_row_out(file: Path) -> None:
    """Make a journal that of an unfinished study."""
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("DELETE FROM runs WHERE run = 1")
        digests = [int(each, 16) for (each,) in connection.execute("SELECT digest FROM runs")]
        _note(connection, "rows", f"{len(digests)} {sum(digests) % (1 << 128)}".encode())
        connection.commit()


def _note(connection: sqlite3.Connection, name: str, value: bytes) -> None:
    connection.execute("INSERT OR REPLACE INTO notes VALUES (?, ?, ?)", (name, value, row_digest(name, value.hex())))


def _schema(connection: sqlite3.Connection, folder: Path, bait: Path, chance: Random) -> None:
    """Other columns, or none, by a note that holds its digest."""
    schemas = [b"", b"\xff" * 100, pa.schema([]).serialize().to_pybytes(),
               pa.schema([("run", pa.string()), (HOSTILE, pa.float64())]).serialize().to_pybytes()]  # fmt: skip
    _note(connection, "schema", chance.choice(schemas))


def _noted(connection: sqlite3.Connection, folder: Path, bait: Path, chance: Random) -> None:
    name = chance.choice(["study", "rows", "x"])
    _note(
        connection, name, chance.choice([b"", b"[]", b"\xff", b"[" * _DEEP, b"1", b"-5 3", b"x y z", b'{"content": 1}'])
    )


_JOURNALS: dict[str, Callable[[sqlite3.Connection, Path, Path, Random], None]] = {
    "trigger": _sql("CREATE TRIGGER t AFTER INSERT ON notes BEGIN DELETE FROM runs; END"),
    # Names that a pattern with a wildcard takes for those of SQLite itself.
    "trigger like its own": _sql("CREATE TRIGGER sqlitex AFTER INSERT ON notes BEGIN DELETE FROM runs; END"),
    "trigger of its own name": _sql(
        "CREATE TRIGGER t AFTER INSERT ON notes BEGIN DELETE FROM runs; END",
        "PRAGMA writable_schema = 1",
        "UPDATE sqlite_master SET name = 'sqlite_t' WHERE name = 't'",
    ),
    "view": _sql("ALTER TABLE runs RENAME TO other",
                 "CREATE VIEW runs AS SELECT run + 1 AS run, id, content, digest FROM other"),
    "columns": _sql("DROP TABLE runs", "CREATE TABLE runs (run TEXT, id BLOB)"),
    "virtual": _sql("DROP TABLE runs", "CREATE VIRTUAL TABLE runs USING fts5(run, id, content, digest)"),
    "generated": _sql("DROP TABLE runs", "CREATE TABLE runs (run, id, content, digest AS (zeroblob(1000000000)))",
                      "INSERT INTO runs (run, id, content) VALUES (0, 'x', '{}')"),
    "index": _sql("CREATE INDEX i ON runs (abs(run))"),
    "more": _sql("CREATE TABLE more (x)"),
    "blob": _sql(f"INSERT INTO runs VALUES (99, 'x', zeroblob({_BLOB}), 'x')"),
    "text": _sql(f"UPDATE runs SET content = '{{\"x\": \"' || hex(zeroblob({_BLOB})) || '\"}}'"),
    "types": _sql("UPDATE runs SET digest = x'ff00', content = 1.5"),
    "name": _sql("UPDATE runs SET id = x'ff'"),
    "encoding": _sql("UPDATE notes SET value = 'text'"),
    "empty": _sql("DELETE FROM runs", "DELETE FROM notes"),
    "wal": _wal, "row": _row, "schema": _schema, "note": _noted,
}  # fmt: skip


def parquet(folder: Path, bait: Path, chance: Random) -> str:
    """A table with other columns, listed anew."""
    file = folder / "results.parquet"
    if chance.random() < 0.5:
        (folder / JOURNAL).unlink()
    rows = pq.read_table(file)
    name = chance.choice(rows.column_names)
    place = rows.column_names.index(name)
    kind = chance.choice(
        ["gone", "renamed", "text", "nested", "none", "twice", "nulls", "hostile", "metadata", "big", "unlike"]
    )
    number = len(rows)
    columns = {
        "text": pa.array(["x"] * number), "hostile": pa.array([HOSTILE] * number), "nulls": pa.nulls(number),
        "nested": pa.array([[1.0]] * number), "big": pa.array(["x" * 10_000_000] * number),
        "unlike": pa.array([float("nan")] * number),
    }  # fmt: skip
    if kind in columns:
        rows = rows.set_column(place, name, columns[kind])
    elif kind == "gone":
        rows = rows.drop_columns([name])
    elif kind == "renamed":
        rows = rows.rename_columns([HOSTILE if each == name else each for each in rows.column_names])
    elif kind == "none":
        rows = rows.slice(0, 0)
    elif kind == "twice":
        rows = rows.append_column(name, rows[name])
    else:
        rows = rows.set_column(
            place, pa.field(name, rows[name].type, metadata={b"\xff": b"\xfe", b"unit": HOSTILE}), rows[name]
        )
    pq.write_table(rows, file)
    relist(folder)
    return f"{kind} {name}"


_WRITERS = ("again", "again", "again", "plot", "report", "csv", "source")
_OF_NUMBERS = ("report", "plot", "csv", "mat", "parquet", "compare", "animate", "linearise")
ATTACKS: dict[str, Attack] = {
    "link": Attack(link, told=True),
    "linked folder": Attack(linked_folder, told=True, kinds=("run", "sweep"), readers=_WRITERS),
    "hard link": Attack(hard_link, told=True, readers=_WRITERS),
    "shared journal": Attack(shared_journal, kinds=("sweep",), readers=_WRITERS),
    "ready": Attack(ready, told=True),
    "ready files": Attack(ready_files, told=True),
    "manifest": Attack(manifest, told=True),
    "special": Attack(special, told=True),
    "values": Attack(plain_values, readers=("report", "again", "source")),
    "dataset": Attack(dataset, readers=_OF_NUMBERS),
    "texts": Attack(lambda folder, bait, chance: _all_texts(folder, chance), readers=(*_OF_NUMBERS, "again")),
    "model": Attack(
        other_model, kinds=("run", "sweep"), readers=("linearise", "linearise", "report", "again", "source")
    ),
    "journal": Attack(journal, kinds=("sweep",)),
    "parquet": Attack(parquet, kinds=("sweep",)),
}


def _all_texts(folder: Path, chance: Random) -> str:
    """Hostile text in place of half of all texts, in every file."""
    for file in [each for each in folder.glob("*.json") if each.name != MANIFEST]:
        found = json.loads(file.read_text(encoding="utf-8"))
        found.pop("digest", None)
        write(file, _with_text(found, chance) if file.name != "study.json" else found | {"name": HOSTILE})
    for file in [*folder.glob("*.nc"), *folder.glob("trajectories/*.nc")]:
        data = xr.load_dataset(file, engine="netcdf4")
        for name in [name for name in data.sizes if name in data.coords]:
            if data[name].dtype.kind in "UO" and data[name].ndim == 1 and chance.random() < 0.5:
                data = data.assign_coords({name: (name, [f"{HOSTILE}{k}" for k in range(data.sizes[name])])})
        if chance.random() < 0.5:
            data, _ = _texts(data, chance)
        file.unlink()
        data.to_netcdf(file, engine="netcdf4")
    relist(folder)
    return ""
