"""Starting: what is not needed is not imported, nothing is compiled by an import, and caches find a place."""

import os
import pickle
import shutil
import sys
import tempfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import paraflex
import paraflex as pf
from paraflex import cache_folder
from paraflex.checks import check_planned
from paraflex.checks.drawing import pose_of
from paraflex.cli.inspect import describe
from paraflex.dynamics import build_system
from paraflex.dynamics.coordinates import body_coordinates
from paraflex.dynamics.sections import sections_of
from paraflex.plots.model_drawing import model_drawing
from processes import run

HEAVY = ("numba", "matplotlib", "xarray", "scipy", "numpy", "netCDF4", "pydantic")

HELP = """
import sys
from paraflex.cli.app import app
try:
    app(["--help"])
except SystemExit:
    pass
print([name for name in sys.argv[1:] if name in sys.modules])
"""

EVERYTHING = """
import importlib, pkgutil, sys
import paraflex
for module in pkgutil.walk_packages(paraflex.__path__, "paraflex."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
kernels = [f for module in list(sys.modules.values()) if module.__name__.startswith("paraflex.kernel")
           for f in vars(module).values() if hasattr(f, "signatures") and not isinstance(f, type)]
print(len(kernels), sum(len(f.signatures) for f in kernels))
"""

WHERE = """
import numpy as np
from paraflex import compilation
from paraflex.kernel.dense import factor_dense
from paraflex.mechanism import Geometry
factor_dense(np.eye(2), np.zeros(2, int))
print(factor_dense.cache_path)
print(compilation.are_compiled())
compilation._stamp(Geometry.SECOND_ORDER).touch()
print(compilation.are_compiled(), compilation.are_compiled(Geometry.LINEAR))
"""


# Root may write anywhere but in what is mounted to be read only.
MOUNT = 'for at in $1 $2; do mount --bind $at $at && mount -o remount,ro,bind $at || exit 77; done; shift 2; exec "$@"'


def python(*arguments, read_only=(), **environment):
    command = [sys.executable, *arguments]
    if read_only and os.getuid() == 0:
        command = ["unshare", "--mount", "sh", "-c", MOUNT, "sh", *map(str, read_only), *command]
    done = run(*command, cwd="/", env=environment)
    if done.returncode == 77 or "unshare failed" in done.stderr:
        pytest.skip("root may write anywhere, and nothing can be mounted here")
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().splitlines()


def test_help_imports_nothing_heavy():
    assert python("-c", HELP, *HEAVY)[-1] == "[]"


# Prints packages and modules that a command has imported, and how many functions Numba has prepared for compiling.
COMMAND = """
import gc, sys
from paraflex.cli.app import app
try:
    app(["info", "raparm_i"])
except SystemExit:
    pass
from paraflex.kernel.compiling import Routine
routines = [each for each in gc.get_objects() if isinstance(type(each), type) and Routine in type(each).__mro__]
print(len(routines), sum("inner" in vars(each) for each in routines), *set(sys.argv) & set(sys.modules))
"""


def test_describing_a_mechanism_needs_neither_the_time_loop_nor_what_compiles():
    unneeded = [f"scipy.{name}" for name in ("fft", "integrate", "interpolate", "optimize", "spatial", "special")]
    unneeded += ["matplotlib", "xarray", "paraflex.integrators.integration", "paraflex.kernel.march", "paraflex.motion"]
    # The first process compiles what is not in the cache yet.
    for _ in range(2):
        routines, prepared, *found = python("-c", COMMAND, *unneeded)[-1].split()
    assert int(routines) > 100
    assert (prepared, found) == ("0", [])


def test_a_mechanism_is_drawn_without_what_datasets_need(tmp_path):
    unneeded = ["xarray", "pandas", "dask", "pyarrow", "netCDF4", "matplotlib.pyplot", "paraflex.kernel.march"]
    look = COMMAND.replace('["info", "raparm_i"]', '["draw", "raparm_i", "--output", sys.argv[1]]')
    for _ in range(2):
        routines, prepared, *found = python("-c", look, str(tmp_path / "drawing.svg"), *unneeded)[-1].split()
        (tmp_path / "drawing.svg").unlink()
    assert int(routines) > 100
    assert (prepared, found) == ("0", [])


# Calls of these are counted, by module and name.
WORK = (
    "paraflex.dynamics.system.build_system",
    "paraflex.fem.eigen.eigenpairs",
    "paraflex.dynamics.linearise.natural_frequencies",
    "paraflex.paths.closure.path_follower",
)


@pytest.fixture
def work(monkeypatch):
    """What has been done since the last question: systems built, bodies' eigenproblems, vibrations, closed paths."""
    calls = dict.fromkeys(WORK, 0)

    def counted(path, function):
        def count(*arguments, **options):
            calls[path] += 1
            return function(*arguments, **options)

        return count

    for path in WORK:
        module, _, name = path.rpartition(".")
        function = getattr(import_module(module), name)
        for each in [one for key, one in sys.modules.items() if key.startswith("paraflex.")]:
            if vars(each).get(name) is function:
                monkeypatch.setattr(each, name, counted(path, function))

    def done():
        found = tuple(calls.values())
        calls.update(dict.fromkeys(WORK, 0))
        return found

    return done


def test_nothing_is_computed_twice(work):
    """Of the mechanism with flexible and with rigid bodies one system each, of the path one without springs.

    The check of a study plans with rigid bodies, and needs one more. Equal links have one eigenproblem: there are long
    and short ones, and long ones with the end-effector.
    """
    model, flexible = pf.load("raparm_i"), 3
    assert work() == (0, 0, 0, 0)
    assert describe(model)["name"] == "RAParM-I"
    assert work() == (4, flexible, 2, 1)
    model_drawing(pose_of(model))
    assert work() == (2, 0, 0, 1)
    task = model.plan(samples=5, duration=0.01)
    assert work() == (2, flexible, 0, 1)
    check_planned(model, task, "square", task.mechanism.modes, None)
    assert work() == (1, 0, 1, 0)
    task.simulate("++++", warning=False)
    pf.linearise(task)
    assert work() == (0, 0, 0, 0)


def test_a_changed_length_takes_one_more_system_of_each_kind(work):
    model = pf.load("raparm_i", set={"link1.length": 0.3})
    pf.linearise(model, mode="++++")
    assert work() == (2, 4, 0, 0)


def test_equal_beams_share_integrals_modes_and_rows_of_sections():
    arm = pf.library.raparm_i().with_geometry("second-order")
    # Another strength is no other beam, but has other sections.
    strong = replace(arm.bodies[0], material=replace(arm.bodies[0].material, strength=1e9))
    system = build_system(replace(arm, bodies=(strong, *arm.bodies[1:])))
    assert len({id(body.integrals) for body in system.bodies}) == 3
    for described, body in zip(system.mechanism.bodies, system.bodies, strict=True):
        alone = body_coordinates(described, system.mechanism.geometry)
        assert alone.name == body.name
        assert np.array_equal(alone.integrals.D, body.integrals.D)
        assert np.array_equal(alone.points.N, body.points.N)
    parts, strength = sections_of(system).parts, sections_of(system).strength
    assert strength[0] == 1e9
    assert not np.any(strength[len(parts[0].x) :] == 1e9)
    assert [part.body for part in parts] == [body.name for body in system.bodies]
    assert len({id(part.moment) for part in parts}) == 3
    copied = pickle.loads(pickle.dumps(system))
    assert np.array_equal(sections_of(copied).parts[-1].moment, parts[-1].moment)


def test_methods_are_listed_without_mechanisms():
    look = "import sys, paraflex.cli.methods; print(*set(sys.argv) & set(sys.modules))"
    assert python("-c", look, "scipy.linalg", "paraflex.dynamics", "paraflex.mechanism", "pydantic") == []


def test_describing_the_library_imports_nothing_that_only_runs_need():
    look = "import sys; from paraflex.cli.inspect import library; library(); print(*set(sys.argv) & set(sys.modules))"
    unneeded = ("matplotlib", "xarray", "netCDF4", "scipy.interpolate", "scipy.integrate", "scipy.optimize")
    assert python("-c", look, *unneeded) == []


def test_commands_import_what_draws_once_there_are_numbers():
    """One after the other in one process: the first that imports too much is named, with what."""
    look = """
import importlib, sys
for command in ("run", "verify", "motion", "linear"):
    importlib.import_module(f"paraflex.cli.{command}")
    print(command, *set(sys.argv) & set(sys.modules))
"""
    found = python("-c", look, "matplotlib", "paraflex.reports", "paraflex.plots.save")
    assert found == ["run", "verify", "motion", "linear"]


STUDY = """
import sys
from paraflex.__main__ import main
out, *names = sys.argv[1:]
sys.argv[1:] = ["run", "raparm_i", "--mode", "++++", "--duration", "0.02", "--samples", "11", "--out", out]
try:
    main()
except SystemExit:
    pass
print("imported:", *(name for name in names if sys.modules.get(name)))
"""


def test_a_study_imports_nothing_that_others_need(tmp_path):
    unneeded = [f"scipy.{name}" for name in ("integrate", "interpolate", "optimize", "spatial")]
    found = python("-c", STUDY, str(tmp_path / "out"), *unneeded, "plotly")
    assert found[-1] == "imported:"
    assert {"report.html", "figures", "results.nc"} <= {file.name for file in (tmp_path / "out").iterdir()}


def test_imports_compile_nothing(tmp_path):
    kernels, signatures = python("-c", EVERYTHING, NUMBA_CACHE_DIR=str(tmp_path))[-1].split()
    assert int(kernels) > 50
    assert int(signatures) == 0
    assert not list(tmp_path.rglob("*.nb?"))


@pytest.fixture
def installation(tmp_path):
    """A copy of the package that cannot be written to, by file modes for all but root."""
    shutil.copytree(Path(paraflex.__file__).parent, tmp_path / "lib" / "paraflex", ignore=_caches)
    folders = [tmp_path / "lib", *(path for path in (tmp_path / "lib").rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    yield tmp_path
    for folder in folders:
        folder.chmod(0o755)


def _caches(folder, names):
    """Kernels that are compiled already; what Python itself has compiled is taken along."""
    return [name for name in names if Path(folder).name == "__pycache__" and not name.endswith(".pyc")]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs users")
@pytest.mark.parametrize("place", ["home", "named", "none"])
def test_a_read_only_installation_keeps_kernels_elsewhere(installation, place):
    home, temporary, read_only = (
        installation / name for name in ("home", "temporary", "home" if place == "none" else "lib")
    )
    home.mkdir(mode=0o555 if place == "none" else 0o755)
    temporary.mkdir()
    options = {
        "read_only": (installation / "lib", read_only),
        "PYTHONPATH": str(installation / "lib"), "PYTHONDONTWRITEBYTECODE": "1", "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"), "TMPDIR": str(temporary),
        "NUMBA_CACHE_DIR": str(home / "chosen") if place == "named" else "",
    }  # fmt: skip
    folder, before, after = python("-c", WHERE, **options)[-3:]
    expected = {
        "home": home / "cache" / "numba",
        "named": home / "chosen",
        "none": temporary / f"paraflex-kernels-{os.getuid()}",
    }[place]
    assert Path(folder).parent.parent == expected
    assert (before, after) == ("False", "True False")
    # A second process finds the stamp.
    look = "from paraflex.compilation import are_compiled; print(are_compiled())"
    assert python("-c", look, **options)[-1] == "True"


def test_a_folder_that_others_can_write_to_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    tempfile.tempdir = None
    monkeypatch.setattr(cache_folder, "_can_write", lambda folder: False)
    named = {}
    cache_folder.ensure_cache_folder(tmp_path, named)
    own = Path(named["NUMBA_CACHE_DIR"])
    assert own.parent == tmp_path
    assert own.stat().st_mode & 0o777 == 0o700
    own.chmod(0o777)
    named = {}
    cache_folder.ensure_cache_folder(tmp_path, named)
    tempfile.tempdir = None
    assert Path(named["NUMBA_CACHE_DIR"]) != own


@pytest.mark.parametrize("place", ["file", "file/within", "locked"])
def test_a_named_place_that_cannot_be_written_is_not_used(tmp_path, monkeypatch, caplog, place):
    (tmp_path / "file").touch()
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "locked" and access(path, mode))
    (tmp_path / "locked").mkdir()
    named = {"NUMBA_CACHE_DIR": str(tmp_path / place), "XDG_CACHE_HOME": str(tmp_path)}
    cache_folder.ensure_cache_folder(Path("/nowhere/that/can/be/written"), named)
    assert "NUMBA_CACHE_DIR" not in named
    (said,) = (record.getMessage() for record in caplog.records)
    assert (
        said == f"paraflex: NUMBA_CACHE_DIR={tmp_path / place} cannot be written: compiled kernels are kept elsewhere"
    )


def test_a_kernel_is_kept_elsewhere_than_in_a_file(tmp_path):
    """As a user meets it: one line, which processes that it starts do not repeat."""
    (tmp_path / "file").touch()
    work = "import subprocess, sys, paraflex.kernel.dense; subprocess.run([sys.executable, '-c', 'import paraflex'])"
    done = run(sys.executable, "-c", work, env={"NUMBA_CACHE_DIR": str(tmp_path / "file")}, check=True)
    assert done.stderr.count("\n") == 1
    assert "cannot be written: compiled kernels are kept elsewhere" in done.stderr


def test_a_place_that_numba_finds_is_left_to_it(tmp_path):
    named = {"XDG_CACHE_HOME": str(tmp_path)}
    cache_folder.ensure_cache_folder(Path("/nowhere/that/can/be/written"), named)
    assert "NUMBA_CACHE_DIR" not in named
