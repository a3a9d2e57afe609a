"""Compiling beforehand: it covers what a study and a linear model call, and knows when it has been done."""

import re
import tomllib
from pathlib import Path

import numba
import numpy as np

import processes
from paraflex.compilation import are_compiled, compile_kernels
from paraflex.kernel.compiling import kernel
from paraflex.kernel.plain import TESTED, VARIABLE, choose

# Calls what is compiled beforehand, then a study; prints what the study had to compile besides.
STUDY = """
import paraflex as pf
from paraflex.compilation import _PARTS
from paraflex.mechanism import Geometry
from paraflex.kernel import bodies, closure, joints, linear, march, signals, stage, tangent, tangent_columns

def compiled():
    modules = (bodies, closure, joints, linear, march, signals, stage, tangent, tangent_columns)
    kernels = {f for module in modules for f in vars(module).values() if hasattr(f, "signatures")}
    return {(f.__name__, signature) for f in kernels for signature in f.signatures}

for call in _PARTS.values():
    call(Geometry.LINEAR)
before = compiled()
model = pf.load("raparm_i")
task = pf.plan(model.mechanism, model.path("square"), duration=0.01, samples=5)
pf.run_study(task, ["++++"])
pf.linearise(task)
print(len(before), compiled() - before)
"""

# Prints what a run gives; before it, loads from the cache what else is asked for.
RUN = """
import gc, hashlib, sys
from pathlib import Path
import paraflex as pf
from paraflex.kernel.compiling import Kernel
from paraflex.integrators import IntegrationOptions
import paraflex.kernel.ode, paraflex.dynamics.linearise

kernels = sorted((each for each in gc.get_objects() if isinstance(each, Kernel)), key=lambda each: each.__name__)
loaded = 0
for each in kernels[::-1] if sys.argv[1:] else []:
    file = each.from_python._cache._cache_file
    for found in Path(file._index_path).parent.glob(file._index_name[:-3] + "*.nbc"):
        each.from_python.compile(file._unsealed(found)[1][0])
        loaded += 1
model = pf.load("raparm_i")
task = pf.plan(model.mechanism, model.path("square"), duration=0.01, samples=5)
run = task.simulate("++++", options=IntegrationOptions(method="esdirk5", tolerance=1e-3))
print(loaded, hashlib.sha256(run.solution.q.tobytes()).hexdigest())
"""


# Prints what a kernel finds, which of our changes to Numba are loaded, and how often the kernel came from the cache.
PLAIN = """
import sys
import numpy as np
import paraflex as pf
from paraflex.dynamics import build_system
from paraflex.dynamics.state import mass_matrix
from paraflex.kernel.bodies import motion_forces
system = build_system(pf.load("raparm_i").mechanism)
print(*mass_matrix(system, np.linspace(-1.0, 1.0, system.n)).ravel().tolist())
changes = ("disk_cache", "machine_code", "passes", "records")
print([name for name in changes if f"paraflex.kernel.{name}" in sys.modules])
print(sum(motion_forces.from_python.stats.cache_hits.values()))
"""


def python(*arguments: str, **environment: str) -> str:
    return processes.python(*arguments, env=environment, check=True).stdout.strip()


def test_a_study_calls_nothing_that_was_not_compiled_beforehand():
    count, besides = python("-c", STUDY).split(maxsplit=1)
    assert int(count) >= 9
    assert besides == "set()"


def test_an_empty_cache_is_noticed(tmp_path):
    look = "from paraflex.compilation import are_compiled; print(are_compiled())"
    assert python("-c", look, NUMBA_CACHE_DIR=str(tmp_path)) == "False"
    compile_kernels()
    assert are_compiled()
    # As Numba keeps them apart, so does the stamp.
    assert python("-c", look, NUMBA_CPU_NAME="nocona") == "False"


def test_what_is_loaded_before_changes_no_bit():
    nothing, expected = python("-c", RUN).split()
    before, result = python("-c", RUN, "all").split()
    assert (int(nothing), int(before) >= 6) == (0, True)
    assert result == expected


def test_kernels_do_not_count_indices_from_the_end_but_functions_of_users_do():
    def of_a_user(x, i):
        return x[i]

    def of_a_kernel(x, i):
        return x[i]

    numbers = np.arange(6.0)
    of_a_kernel.__module__ = "paraflex.kernel.arrays"
    assert kernel(of_a_user)(numbers[3:], -1) == numbers[5]
    assert kernel(of_a_kernel)(numbers[3:], -1) == numbers[2]


def test_plain_numba_finds_the_same_and_loads_none_of_our_changes(tmp_path):
    """One kernel, with sums over the coordinates of flexible bodies: all of them take minutes."""
    ours, loaded, _ = python("-c", PLAIN).splitlines()
    assert loaded == "['disk_cache', 'machine_code', 'passes', 'records']"
    folder = {"PARAFLEX_PLAIN_NUMBA": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    for hits in ("0", "1"):
        plain, loaded, found = python("-c", PLAIN, **folder).splitlines()
        assert (loaded, found) == ("[]", hits)
        np.testing.assert_allclose(numbers(plain), numbers(ours), rtol=1e-13, atol=1e-15)
    assert ours.count(" ") > 1000


def numbers(line):
    return np.array([float(word) for word in line.split()])


def test_releases_of_numba_that_are_not_tested_are_compiled_for_plainly(caplog):
    for release in (*TESTED, "0.66.0", "0.68.1", "0.65.0dev0+3.gabc"):
        assert not choose(release, {}), release
    assert not caplog.records
    for release in ("0.61.2", "0.69.0", "0.100.0", "1.0.0"):
        environment = {}
        assert choose(release, environment)
        # Said once; processes that are started do the same.
        assert choose(release, environment)
        assert [record.getMessage().count(release) for record in caplog.records] == [1]
        assert environment == {VARIABLE: "1"}
        caplog.clear()
    assert choose(numba.__version__, {VARIABLE: "1"})
    assert not choose("0.99.0", {VARIABLE: "0"})
    assert not caplog.records


def test_the_tested_releases_are_those_that_are_installed():
    root = Path(__file__).parents[1]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"numba>={TESTED[0]}" in project["dependencies"]
    (pinned,) = re.findall(r"^numba==(\S+)$", (root / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert not choose(pinned, {})
    assert " to ".join(TESTED) in (root / "docs" / "install.md").read_text(encoding="utf-8")
