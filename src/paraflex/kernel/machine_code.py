"""What becomes machine code: a kernel that Python calls, with copies of all it calls that are its own.

Numba makes machine code of every function and lets the first copy of a function that a process has loaded stand in for
all others. But copies are fitted to where they are called, and sums may be reordered there: what a kernel computes
would depend, in the last bits, on what was loaded before it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Library(JITCodeLibrary):
    """The code of a function: optimised and made machine code of only where Python calls it."""

    called_from_python = True

    def _optimize_final_module(self) -> None:
        if self.called_from_python:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        # Read from the cache, it is in these two parts already.
        if self._shared_module is None:
            self._divide()
        super()._finalize_final_module()

    def _divide(self) -> None:
        """Part what other functions take copies of from what becomes machine code."""
        module = self._final_module
        self._shared_module = module.clone() if self.called_from_python else module
        _relink(self._shared_module, binding.Linkage.external, binding.Linkage.linkonce_odr)
        if self.called_from_python:
            _relink(module, binding.Linkage.linkonce_odr, binding.Linkage.internal)
        else:
            names = [each.name for each in module.global_variables if _is_environment(each)]
            kept = "\n".join(f"@{name} = common global ptr null" for name in names)
            self._final_module = binding.parse_assembly(kept)
            self._final_module.name = module.name


class SeparateCode(Compiler):
    """Numba's compiler, but for the libraries it makes."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function."""
        library = _Library(self.state.targetctx.codegen(), func.__qualname__)
        library.called_from_python = not self.state.flags.no_cpython_wrapper
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(func)


def _is_environment(variable: Any) -> bool:
    """Whether Numba looks for it, be there code or not."""
    return variable.name.startswith("_ZN08NumbaEnv")


def _relink(module: Any, old: binding.Linkage, new: binding.Linkage) -> None:
    for function in module.functions:
        if not function.is_declaration and function.linkage == old:
            function.linkage = new
