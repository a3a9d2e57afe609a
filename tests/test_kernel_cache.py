"""Kernels on disk: what was compiled from other sources, or by another compiler, is never loaded."""

import errno
import gc
import os
import shutil
import signal
from pathlib import Path

import pytest
from llvmlite import binding
from numba.core import config

import paraflex
import processes
from paraflex import cache_folder
from paraflex.kernel import disk_cache, notice, processor
from paraflex.kernel.compiling import Kernel

# The row of a prescribed angle: a kernel of constraints.py calls one of joints.py, which writes a torque of one there.
JACOBIAN = """
import numpy as np
import paraflex as pf
from paraflex.dynamics import build_system
from paraflex.kernel.constraints import fill_jacobian
system = build_system(pf.load("four_bar").mechanism.rigid())
print(fill_jacobian.cache_path)
print(system.jacobian(np.zeros(system.n))[2].max())
print(len(fill_jacobian.from_python.stats.cache_hits))
"""

# A state of its own for another release of one of them.
RELEASE = """
import sys
import llvmlite, numba, numpy
if sys.argv[1:]:
    setattr(sys.modules[sys.argv[1]], "__version__", "99.0")
from paraflex.kernel.disk_cache import FOLDER
print(FOLDER)
"""


def python(*arguments, **environment):
    return processes.python(*arguments, env=environment, check=True).stdout.strip().splitlines()


@pytest.fixture
def copy(tmp_path):
    """A copy of the package, as it is installed: without compiled kernels."""
    return shutil.copytree(Path(paraflex.__file__).parent, tmp_path / "paraflex", ignore=_kernels)


def _kernels(folder, names):
    return [name for name in names if Path(folder).name == "__pycache__" and not name.endswith(".pyc")]


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(copy):
    joints, here = copy / "kernel" / "joints.py", {"PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": ""}
    text, times = joints.read_text(), joints.stat()
    folder, entry, hits = python("-c", JACOBIAN, **here)
    assert (entry, hits) == ("1.0", "0")
    halved = text.replace("f[body.offset + 2] += torque", "f[body.offset + 2] += 0.5 * torque")
    assert halved != text
    joints.write_text(halved)
    # As an installation may leave them.
    os.utime(joints, ns=(times.st_atime_ns, times.st_mtime_ns))
    other, entry, hits = python("-c", JACOBIAN, **here)
    assert (entry, hits) == ("0.5", "0")
    assert other != folder
    # The state before is still there: a branch that is looked at for a while compiles nothing twice.
    joints.write_text(text)
    assert python("-c", JACOBIAN, **here) == [folder, "1.0", "1"]


def test_every_kernel_is_kept_in_the_folder_of_this_state():
    import paraflex.dynamics.linearise
    import paraflex.kernel.ode
    import paraflex.tracking  # noqa: F401

    # By type: proxies of what is gone answer for what they stood for.
    kernels = [each for each in gc.get_objects() if type(each) is Kernel]
    assert len(kernels) > 30
    folders = {each._cache.cache_path for kernel in kernels for each in (kernel.from_python, kernel.inner)}
    assert {Path(folder).name for folder in folders} == {disk_cache.FOLDER}


def test_other_releases_of_the_compiler_have_kernels_of_their_own():
    found = [python("-c", RELEASE, *given)[0] for given in ([], ["numba"], ["llvmlite"], ["numpy"])]
    assert found[0] == disk_cache.FOLDER
    assert len(set(found)) == 4


def test_outdated_kernels_are_removed(tmp_path):
    # Folders of other states, oldest first, and a file of somebody else's.
    others = [tmp_path / f"paraflex-kernels-{k}" for k in range(5)]
    for k, folder in enumerate(others):
        folder.mkdir()
        (folder / "march.nbc").touch()
        os.utime(folder, (k, k))
    (tmp_path / "theirs.nbc").touch()
    folder = disk_cache.make_folder(tmp_path)
    kept = {folder, tmp_path / "theirs.nbc", *others[6 - disk_cache.STATES_KEPT :]}
    assert set(tmp_path.iterdir()) == kept
    # Made already: nothing goes.
    others[0].mkdir()
    assert disk_cache.make_folder(tmp_path) == folder
    assert others[0].exists()


# Two kernels that compile in no time.
KERNELS = """
import sys
{0}
import numpy as np
from paraflex.kernel.dense import factor_dense, solve_factored
matrix, order = np.eye(2), np.zeros(2, int)
factor_dense(matrix, order)
solve_factored(matrix, order, np.ones((2, 1)))
print(*(len(kernel.from_python.stats.cache_hits) for kernel in (factor_dense, solve_factored)))
"""
SILENT = "import logging; logging.getLogger('paraflex').setLevel('ERROR')"


def streams(code, place):
    """Standard output and standard error of a process with a place for its kernels."""
    done = processes.python("-c", code, env={"NUMBA_CACHE_DIR": str(place)}, check=True)
    return done.stdout, done.stderr


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with both kernels, and what was said when they were compiled."""
    folder = tmp_path_factory.mktemp("kernels")
    return folder, streams(KERNELS.format(""), folder)


def test_that_kernels_are_compiled_is_said_once_and_only_where_they_are(compiled, tmp_path):
    folder, said = compiled
    assert said == ("0 0\n", f"{notice.NOTICE}\n")
    assert streams(KERNELS.format(""), folder) == ("1 1\n", "")
    assert streams(KERNELS.format(SILENT), tmp_path) == ("0 0\n", "")


def test_workers_say_nothing_of_compiling(monkeypatch):
    said = []
    monkeypatch.setattr(notice, "_announced", set())
    monkeypatch.setattr(notice.multiprocessing, "parent_process", lambda: "a process")
    notice.announce_compiling(said.append)
    monkeypatch.setattr(notice.multiprocessing, "parent_process", lambda: None)
    for _ in range(2):
        notice.announce_compiling(said.append)
    assert said == [notice.NOTICE]


def truncated(content):
    return content[: len(content) // 2]


def emptied(_):
    return b""


def flipped(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize("damage", [truncated, emptied, flipped])
def test_a_damaged_kernel_is_compiled_anew(compiled, tmp_path, damage):
    place = shutil.copytree(compiled[0], tmp_path / "kernels")
    # The kernel that Python calls, and no other: all of its code is in one file.
    (file,) = place.rglob("dense.factor_dense_from_python*.nbc")
    file.write_bytes(damage(file.read_bytes()))
    said = f"paraflex: a compiled kernel is damaged and compiled anew ({file})\n"
    assert streams(KERNELS.format(""), place) == ("0 1\n", said)
    assert streams(KERNELS.format(""), place) == ("1 1\n", "")


def test_two_processes_that_keep_a_kernel_at_once_do_not_mix_its_signatures(tmp_path, monkeypatch):
    """Both gave one name to their code, and an installation could be left with code that nothing could call."""
    file = disk_cache.KernelCache(python)._cache_file
    monkeypatch.setattr(file, "_index_path", str(tmp_path / "kernel.nbi"))
    monkeypatch.setattr(file, "_cache_path", str(tmp_path))
    plain = file._seal

    def late(*arguments):
        monkeypatch.setattr(file, "_seal", plain)
        file.save("other", 2)
        plain(*arguments)

    monkeypatch.setattr(file, "_seal", late)
    file.save("one", 1)
    assert [file.load(key) for key in ("one", "other", "third")] == [1, 2, None]


def test_what_cannot_be_kept_is_compiled_all_the_same(tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(notice, "_announced", set())
    monkeypatch.setattr(notice.LOG, "warning", said.append)
    cache = disk_cache.KernelCache(python)

    def full(self, signature, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(disk_cache.FunctionCache, "_save_overload", full)
    monkeypatch.setattr(disk_cache, "make_folder", lambda place: None)
    for _ in range(2):
        cache._save_overload(None, None)
    assert len(said) == 1
    assert said[0].endswith("(no space left on device): the next process compiles anew")


def test_an_interrupt_waits_until_a_kernel_is_loaded(monkeypatch):
    loaded = []

    def load(*_):
        signal.raise_signal(signal.SIGINT)
        loaded.append(True)

    monkeypatch.setattr(disk_cache.FunctionCache, "_load_overload", load)
    with pytest.raises(KeyboardInterrupt):
        disk_cache.KernelCache(python)._load_overload(None, None)
    assert loaded


@pytest.mark.skipif(binding.get_process_triple().split("-")[0] != "x86_64", reason="levels of x86-64")
def test_processors_of_a_level_share_kernels_and_others_have_their_own(monkeypatch):
    for setting in ("CPU_NAME", "CPU_FEATURES"):
        monkeypatch.setitem(vars(config), setting, None)
    level = dict.fromkeys(("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"), True)
    found = []
    for name, features in (("znver4", level | {"avx512f": True}), ("haswell", level), ("nehalem", {"sse4.2": True})):
        monkeypatch.setattr(binding, "get_host_cpu_name", lambda name=name: name)
        monkeypatch.setattr(binding, "get_host_cpu_features", lambda features=features: binding.FeatureMap(features))
        for each in (processor._level, processor.processor):
            each.cache_clear()
        found.append(processor.processor())
    for each in (processor._level, processor.processor):
        each.cache_clear()
    assert found[0] == found[1] == (binding.get_process_triple(), "x86-64-v3")
    assert found[2][1:] == ("nehalem", "+sse4.2")


def test_a_kernel_that_cannot_be_read_is_not_there(tmp_path):
    cache = disk_cache.KernelCache(python)
    (tmp_path / "kernel.nbc").mkdir()
    assert cache._cache_file._unsealed(str(tmp_path / "kernel.nbc")) is None


def test_a_cache_folder_that_cannot_be_reached_is_not_used(tmp_path, monkeypatch):
    def barred(_):
        raise PermissionError(errno.EACCES, "Permission denied")

    environment = {cache_folder.VARIABLE: str(tmp_path / "x"), "HOME": str(tmp_path)}
    warnings = []
    monkeypatch.setattr(cache_folder, "_warn", warnings.append)
    monkeypatch.setattr(Path, "exists", barred)
    cache_folder.ensure_cache_folder(tmp_path, environment)
    assert environment[cache_folder.VARIABLE] != str(tmp_path / "x")
    assert "cannot be written: compiled kernels are kept elsewhere" in warnings[0]
