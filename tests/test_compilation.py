"""Compiling beforehand: it covers what a study calls, and knows when it has been done."""

import os
import subprocess
import sys

from paraflex.compilation import are_compiled, compile_kernels

# Calls what is compiled beforehand, then a study; prints what the study had to compile besides.
STUDY = """
import paraflex as pf
from paraflex.compilation import _PARTS
from paraflex.mechanism import Geometry
from paraflex.kernel import bodies, closure, joints, linear, march, signals, stage

def compiled():
    modules = (bodies, closure, joints, linear, march, signals, stage)
    kernels = {f for module in modules for f in vars(module).values() if hasattr(f, "signatures")}
    return {(f.__name__, signature) for f in kernels for signature in f.signatures}

for call in _PARTS.values():
    call(Geometry.LINEAR)
before = compiled()
model = pf.load("raparm_i")
task = pf.plan(model.mechanism, model.path("square"), duration=0.01, samples=5)
pf.run_study(task, ["++++"])
print(len(before), compiled() - before)
"""

# Prints what a run gives; before it, loads from the cache what else is asked for.
RUN = """
import gc, hashlib, sys
import paraflex as pf
from paraflex.kernel.compiling import Kernel
from paraflex.integrators import IntegrationOptions
import paraflex.kernel.ode, paraflex.dynamics.linearise

kernels = sorted((each for each in gc.get_objects() if isinstance(each, Kernel)), key=lambda each: each.__name__)
loaded = 0
for each in kernels[::-1] if sys.argv[1:] else []:
    for signature, *_ in each.from_python._cache._cache_file._load_index():
        each.from_python.compile(signature)
        loaded += 1
model = pf.load("raparm_i")
task = pf.plan(model.mechanism, model.path("square"), duration=0.01, samples=5)
run = task.simulate("++++", options=IntegrationOptions(method="esdirk5", tolerance=1e-3))
print(loaded, hashlib.sha256(run.solution.q.tobytes()).hexdigest())
"""


def python(*arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, check=True, env={**os.environ, **environment}
    )
    return done.stdout.strip()


def test_a_study_calls_nothing_that_was_not_compiled_beforehand():
    count, besides = python("-c", STUDY).split(maxsplit=1)
    assert int(count) >= 9
    assert besides == "set()"


def test_an_empty_cache_is_noticed(tmp_path):
    look = "from paraflex.compilation import are_compiled; print(are_compiled())"
    assert python("-c", look, NUMBA_CACHE_DIR=str(tmp_path)) == "False"
    compile_kernels()
    assert are_compiled()


def test_what_is_loaded_before_changes_no_bit():
    nothing, expected = python("-c", RUN).split()
    before, result = python("-c", RUN, "all").split()
    assert (int(nothing), int(before) >= 6) == (0, True)
    assert result == expected
