"""Folders of results are replaced whole or not at all, whenever the writer is killed; foreign files are noticed."""

import json
import os
import shutil
import signal
import sys

import pytest
import xarray as xr

from paraflex.errors import InputError, OutputError
from paraflex.folders import (
    COMPARISON,
    MANIFEST,
    RUN,
    STUDY_OF_RUNS,
    Manifest,
    added_to,
    check_listed,
    files_of,
    foreign_files,
    hold_folder,
    kind_of_folder,
    lock_folder,
    read_manifest,
)
from paraflex.results.storage import write_results
from paraflex.writing import write_json

BEFORE = {"results.nc": "old", "summary.json": "old", "figures/a.png": "old", "figures/b.png": "old"}
AFTER = {"results.nc": "new", "summary.json": "new", "figures/b.png": "new", "figures/c.png": "new"}
CHANGES = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "shutil.rmtree"}


def write(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def replace(folder, files, kind=RUN, **options):
    with hold_folder(folder, kind, **options) as held, held.replaced() as new:
        write(new, files)


def ours(folder):
    return {name: (folder / name).read_text() for name in files_of(folder)}


@pytest.fixture
def folder(tmp_path):
    replace(tmp_path / "out", BEFORE)
    (tmp_path / "out" / "notes.txt").write_text("mine")
    (tmp_path / "out" / "figures" / "mine.png").write_text("mine")
    return tmp_path / "out"


def killed_at(change, work):
    """Whether work in another process was killed at its nth change of a file."""
    child = os.fork()
    if child == 0:
        left = [change]

        def count(event, arguments):
            if event in CHANGES and not (event == "open" and arguments[1] in ("r", "rb")):
                left[0] -= 1
                if left[0] == 0:
                    os._exit(9)

        sys.addaudithook(count)
        work()
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_killed_at_any_change_of_a_file_the_results_are_the_old_or_the_new_ones(folder, tmp_path):
    found, change = [], 1
    while True:
        copy = tmp_path / str(change)
        shutil.copytree(folder, copy)
        if not killed_at(change, lambda: replace(copy, AFTER)):  # noqa: B023
            break
        assert kind_of_folder(copy) == RUN
        found.append(ours(copy))
        assert found[-1] in (BEFORE, AFTER), change
        for name in found[-1]:
            check_listed(copy / name, "again")
        assert foreign_files(copy) == ["figures/mine.png", "notes.txt"]
        replace(copy, AFTER)
        assert ours(copy) == AFTER
        assert not [each for each in copy.iterdir() if each.name in (".new", ".ready")]
        change += 1
    assert ours(copy) == AFTER
    assert found.index(AFTER) > 5
    assert len(found) - found.index(AFTER) > 5
    assert found == [BEFORE] * found.index(AFTER) + [AFTER] * (len(found) - found.index(AFTER))


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_broken_off_it_leaves_what_was_there(folder, error):
    def broken_off():
        with hold_folder(folder, RUN) as held, held.replaced() as new:
            write(new, {"results.nc": "new"})
            raise error

    with pytest.raises((KeyboardInterrupt, OutputError)) as raised:
        broken_off()
    if isinstance(error, OSError):
        said = f"{folder}: cannot be written (no space left on device); choose another folder"
        assert str(raised.value) == said
    assert ours(folder) == BEFORE
    assert not (folder / ".new").exists()


def test_figures_that_a_killed_command_was_drawing_vanish(folder):
    write(folder / ".drawn" / "figures", {"path.png": "half"})
    assert foreign_files(folder) == ["figures/mine.png", "notes.txt"]
    with hold_folder(folder, RUN) as held:
        assert not (folder / ".drawn").exists()
        with held.drawn_files() as drawn:
            write(drawn, {"path.png": "whole"})
    assert not drawn.exists()
    assert ours(folder) == BEFORE


def test_ctrl_c_waits_until_all_files_are_in_their_place(folder, monkeypatch):
    import paraflex.folders.changes as module

    put = module._put

    def broken_off(ready, target):
        (ready / "results.nc").replace(target / "results.nc")
        signal.raise_signal(signal.SIGINT)
        put(ready, target)

    monkeypatch.setattr(module, "_put", broken_off)
    with pytest.raises(KeyboardInterrupt):
        replace(folder, AFTER)
    assert ours(folder) == AFTER


def test_errors_name_the_folder_and_not_that_within(folder):
    with pytest.raises(OutputError) as raised, hold_folder(folder, RUN) as held, held.replaced() as new:
        raise OutputError("cannot be written (no)", field=str(new / "results.nc"))
    assert raised.value.field == str(folder / "results.nc")


def test_results_of_another_kind_need_force(folder):
    with pytest.raises(InputError, match=r"^--out: the folder holds other results, a run .* or use --force"):
        replace(folder, {"compare-methods.json": "new"}, COMPARISON, force=False, field="--out")
    with pytest.raises(InputError, match=r"^folder: the folder holds other results, a run .*; name another folder$"):
        replace(folder, {"compare-methods.json": "new"}, COMPARISON)
    assert ours(folder) == BEFORE
    replace(folder, {"compare-methods.json": "new"}, COMPARISON, force=True)
    assert ours(folder) == {"compare-methods.json": "new"}
    assert foreign_files(folder) == ["figures", "notes.txt"]


def test_the_same_results_leave_all_as_it_is(folder):
    with added_to(folder / "figures") as new:
        write(new, {"later.png": "later"})
    replace(folder, BEFORE)
    assert ours(folder) == BEFORE | {"figures/later.png": "later"}
    replace(folder, AFTER)
    assert ours(folder) == AFTER


def test_the_same_results_mend_a_damaged_file(folder):
    (folder / "results.nc").write_text("0ld")
    with pytest.raises(InputError, match=r"results\.nc: damaged, or of other results: .*; again"):
        check_listed(folder / "results.nc", "again")
    replace(folder, BEFORE)
    check_listed(folder / "results.nc", "again")


def test_figures_are_added_where_there_are_results_and_written_where_there_are_none(folder, tmp_path):
    identity = read_manifest(folder).identity
    with added_to(folder / "figures") as new:
        assert new != folder / "figures"
        write(new, {"d.png": "d"})
    assert files_of(folder).keys() == {*BEFORE, "figures/d.png"}
    assert read_manifest(folder).identity == identity
    with added_to(tmp_path / "elsewhere") as new:
        assert new == tmp_path / "elsewhere"


@pytest.mark.parametrize("same", [True, False])
def test_equal_runs_have_one_identity_and_keep_what_was_drawn(tmp_path, same):
    def write_run(name, wall_time, torque):
        folder = tmp_path / name
        with hold_folder(folder, RUN) as held, held.replaced() as new:
            values = {"torque": ("time", [0.0, torque]), "wall_time": ("mode", [wall_time]), "mode": ["++"]}
            write_results(xr.Dataset(values, attrs={"tolerance": 1e-5}), new / "results.nc")
            write_json(new / "summary.json", {"modes": {"++": {"wall_time": wall_time, "peak": torque}}})
        return folder

    first, second = write_run("a", 0.1, 1.0), write_run("b", 0.2, 1.0 if same else 1.0 + 1e-15)
    assert (read_manifest(first).identity == read_manifest(second).identity) == same
    with added_to(first / "figures") as new:
        write(new, {"a.png": "drawn"})
    write_run("a", 0.3, 1.0 if same else 2.0)
    assert (first / "figures" / "a.png").exists() == same
    assert json.loads((first / "summary.json").read_text())["modes"]["++"]["wall_time"] == 0.3
    check_listed(first / "results.nc", "again")


def test_while_the_runs_of_a_study_go_on_a_report_is_written_beside_them(tmp_path):
    replace(tmp_path / "out", {"results.csv": "old"}, STUDY_OF_RUNS)
    with hold_folder(tmp_path / "out", STUDY_OF_RUNS) as held:
        with added_to(tmp_path / "out") as new:
            assert new == tmp_path / "out"
            write(new, {"report.html": "of some runs"})
        with held.replaced() as new:
            write(new, {"results.csv": "new"})
    assert ours(tmp_path / "out") == {"results.csv": "new"}
    assert not (tmp_path / "out" / "report.html").exists()


def test_a_file_of_other_results_is_noticed(folder, tmp_path):
    replace(tmp_path / "other", AFTER)
    shutil.copyfile(tmp_path / "other" / "summary.json", folder / "summary.json")
    with pytest.raises(InputError, match=r"summary\.json: damaged, or of other results"):
        check_listed(folder / "summary.json", "again")
    check_listed(folder / "notes.txt", "again")


@pytest.mark.parametrize("change", [lambda text: text[:-9], lambda text: text.replace("results.nc", "results.nd")])
def test_a_damaged_manifest_is_noticed_and_replaced(folder, change):
    text = (folder / MANIFEST).read_text()
    (folder / MANIFEST).write_text(change(text))
    with pytest.raises(InputError, match=r"manifest\.json: damaged: not "):
        check_listed(folder / "results.nc", "again")
    assert kind_of_folder(folder) == RUN
    replace(folder, AFTER)
    assert ours(folder) == AFTER


def test_a_folder_of_an_earlier_release_is_known_by_its_files(tmp_path):
    write(tmp_path, {"results.nc": "old", "summary.json": "old", "report.html": "old", "mine.txt": "mine"})
    assert kind_of_folder(tmp_path) == RUN
    assert foreign_files(tmp_path) == ["mine.txt"]
    check_listed(tmp_path / "results.nc", "again")
    replace(tmp_path, {"results.nc": "new"})
    assert ours(tmp_path) == {"results.nc": "new"}
    assert foreign_files(tmp_path) == ["mine.txt"]


def test_nothing_is_left_where_nothing_came_of_it(tmp_path):
    with pytest.raises(ZeroDivisionError), hold_folder(tmp_path / "a" / "b", RUN):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_computed(folder, monkeypatch):
    def forbidden(self, *_, **__):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr("pathlib.Path.rmdir", forbidden)
    said = r"^--out: cannot be written \(permission denied\) \(got .*\); choose another folder$"
    with pytest.raises(OutputError, match=said), hold_folder(folder, RUN, field="--out"):
        pytest.fail("computed")


def test_two_writers_of_one_folder(folder):
    with hold_folder(folder, RUN):
        for writer in (lambda: replace(folder, AFTER), lambda: added_to(folder).__enter__()):
            with pytest.raises(InputError, match="another process writes to it"):
                writer()
    assert ours(folder) == BEFORE


def test_a_reader_finishes_what_a_killed_writer_left_or_waits_for_a_living_one(folder, monkeypatch):
    ready = folder / ".ready"
    write(ready, {"summary.json": "new", "removed.json": "[]"})
    manifest = json.loads((folder / MANIFEST).read_text())
    (ready / MANIFEST).write_text(json.dumps(manifest))
    monkeypatch.setattr("paraflex.folders.lock._PATIENCE", 0.1)
    with lock_folder(folder):
        write(ready, {"removed.json": "[]", MANIFEST: json.dumps(manifest)})
        with pytest.raises(InputError, match="another process writes to it"):
            check_listed(folder / "results.nc", "again")
    check_listed(folder / "results.nc", "again")
    assert not ready.exists()


@pytest.mark.parametrize("name", ["../mine.txt", "figures/../../mine.txt", "/mine.txt", "C:\\mine.txt", "..\\mine.txt"])
def test_no_list_reaches_out_of_its_folder(folder, name):
    mine = folder.parent / "mine.txt"
    mine.write_text("mine")
    name = str(mine) if name == "/mine.txt" else name
    forged = Manifest.of(RUN, files_of(folder) | {name: "0"}, {})
    write_json(folder / MANIFEST, vars(forged))
    with pytest.raises(InputError, match=r"manifest\.json: damaged: not a list of the folder's files"):
        check_listed(folder / "results.nc", "again")
    replace(folder, AFTER)
    write(folder / ".ready", {MANIFEST: (folder / MANIFEST).read_text(), "removed.json": json.dumps([name])})
    check_listed(folder / "results.nc", "again")
    assert mine.read_text() == "mine"
    write(folder / ".ready", {MANIFEST: (folder / MANIFEST).read_text(), "removed.json": "["})
    with pytest.raises(InputError, match=r"removed\.json: damaged: .*; delete the folder \.ready"):
        check_listed(folder / "results.nc", "again")


def test_what_is_in_the_way_is_named_before_anything_is_moved(folder):
    (folder / "report.html").mkdir()
    for new, said in (
        ({"report.html": "new"}, r"report\.html: cannot be written \(a folder of that name is there\)"),
        ({"notes.txt/a.png": "new"}, r"notes\.txt: cannot be written \(a file of that name is there\)"),
    ):
        with pytest.raises(OutputError, match=said):
            replace(folder, AFTER | new)
        assert ours(folder) == BEFORE
        assert not (folder / ".ready").exists()


def foreign(place, names, removed=(), links=()):
    """A folder as another may have made it: with results that are ready to be moved, and links."""
    ready = place / ".ready"
    write(ready, dict.fromkeys(names, "theirs"))
    write_json(ready / "manifest.json", vars(Manifest.of(RUN, {}, {})) | {"files": {}})
    write_json(ready / "removed.json", list(removed))
    for name, target in links:
        (place / name).symlink_to(target)
    return place


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege")
@pytest.mark.parametrize(
    "hostile",
    [
        {"names": ["x/a"], "links": [("x", "../outside")]},
        {"names": ["x/y/a"], "links": [("x", "../outside")]},
        {"names": [], "removed": ["x/theirs.txt"], "links": [("x", "../outside")]},
        {"names": ["loop/a"], "links": [("loop", "loop")]},
    ],
)
def test_nothing_is_moved_or_removed_where_links_lead_out(tmp_path, hostile):
    outside = tmp_path / "outside"
    write(outside, {"theirs.txt": "theirs"})
    folder = foreign(tmp_path / "out", **hostile)
    uses = (kind_of_folder, lambda place: check_listed(place / "a.nc", "again"), lambda place: replace(place, AFTER))
    for use in uses:
        with pytest.raises(OutputError, match=r"a link leads out of|cannot be written"):
            use(folder)
    assert {file.name: file.read_text() for file in outside.iterdir()} == {"theirs.txt": "theirs"}
    assert not (folder / "results.nc").exists()


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege")
@pytest.mark.parametrize("name", [".ready", ".lock", "figures", ".new", ".drawn"])
def test_links_in_place_of_own_files_and_folders_are_refused(folder, tmp_path, name):
    outside = foreign(tmp_path / "outside", ["a"])
    shutil.move(outside / ".ready", tmp_path / "theirs")
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file() and folder not in file.parents}
    if (folder / name).is_dir():
        shutil.rmtree(folder / name)
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(tmp_path / ("new file" if name == ".lock" else "theirs"))
    with pytest.raises(OutputError) as raised:
        replace(folder, AFTER)
    assert name in str(raised.value)
    after = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file() and folder not in file.parents}
    assert after == before


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owners")
def test_what_another_user_prepared_is_not_moved(tmp_path, monkeypatch):
    folder = foreign(tmp_path / "out", ["results.nc"])
    monkeypatch.setattr(os, "getuid", lambda: (folder / ".ready").stat().st_uid + 1)
    with pytest.raises(OutputError, match="another user prepared"):
        kind_of_folder(folder)
    assert not (folder / "results.nc").exists()


@pytest.mark.parametrize("removed", [{"a": 1}, [1, 2], "results.nc"])
def test_a_list_of_files_that_is_none(tmp_path, removed):
    folder = foreign(tmp_path / "out", ["results.nc"])
    (folder / ".ready" / "removed.json").write_text(json.dumps(removed))
    with pytest.raises(InputError, match="not a list of names"):
        kind_of_folder(folder)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege")
def test_unfinished_files_that_are_links_are_not_written_through(tmp_path):
    write(tmp_path, {"theirs.txt": "theirs"})
    (tmp_path / "a.json.part").symlink_to("theirs.txt")
    write_json(tmp_path / "a.json", {"mine": 1})
    assert (tmp_path / "theirs.txt").read_text() == "theirs"
    assert not (tmp_path / "a.json").is_symlink()
