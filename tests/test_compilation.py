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
task = pf.plan_tracking(model.mechanism, model.path("square"), duration=0.01, samples=5)
pf.run_study(task, ["++++"])
print(len(before), compiled() - before)
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
