"""Processor that kernels are compiled for: on x86-64 the same for all machines, so that a wheel may contain them.

Code for the level x86-64-v3 (AVX2 and fused products, on the market since 2013) is as fast as that for the processor at
hand (`benchmarks/machine_code.py`). Elsewhere, and if NUMBA_CPU_NAME is set, code is for Numba's choice of processor.
"""

from functools import cache
from typing import Any

from llvmlite import binding
from numba.core import config

_LEVEL = "x86-64-v3"
_FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")


@cache
def _level() -> str:
    """Return the level of this processor; it is empty if kernels are compiled for Numba's choice of processor."""
    here = vars(config)
    if here["CPU_NAME"] is not None or here["CPU_FEATURES"] is not None:
        return ""
    features = binding.get_host_cpu_features()
    return _LEVEL if all(features.get(name) for name in _FEATURES) else ""


@cache
def processor() -> tuple[str, ...]:
    """Return what machine code depends on: system, processor and its features."""
    triple, here = binding.get_process_triple(), vars(config)
    if _level():
        return triple, _level()
    name = here["CPU_NAME"] or binding.get_host_cpu_name()
    return triple, name, here["CPU_FEATURES"] or binding.get_host_cpu_features().flatten()


@cache
def machine(codegen: Any, level: int) -> Any:
    """Return what makes machine code, at an optimisation level of LLVM from 0 to 3."""
    options: dict[str, Any] = {"opt": level}
    codegen._customize_tm_options(options)
    if _level():
        options |= {"cpu": _level(), "features": ""}
    return binding.Target.from_triple(binding.get_process_triple()).create_target_machine(**options)
