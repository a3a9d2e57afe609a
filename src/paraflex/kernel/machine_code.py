"""Machine code of kernels: one unit for each function that Python calls, with its own copies of all functions it calls.

Plain Numba makes machine code of every function and uses the first copy of a function that a process has loaded for all
callers. But copies are optimised for their callers, and sums may be reordered in them: the last bits of a kernel's
results would depend on the order of loading.

Plain Numba also counts references to every array that a local name refers to (for one field of a workspace, those of
all others too) by atomic operations, which cost more than the arithmetic. Kernels create no arrays: their caller owns
them.

Plain Numba compares every index with zero, as negative ones count from the end. Kernels use none.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

from llvmlite import binding
from numba import njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.np import arrayobj

from .disk_cache import KernelCache
from .notice import announce_compiling
from .passes import kernel_passes, remembered_signatures
from .processor import machine

# Beginning of the names that Numba gives to the code of kernels: functions of other packages keep their indices.
_OF_KERNELS = "_ZN8paraflex6kernel"
_numbas_index = arrayobj.fix_integer_index


def _index(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
    """Return an index as a number of the machine; Numba adds the size to a negative one, except in kernels."""
    if builder.function.name.startswith(_OF_KERNELS):
        return context.cast(builder, index, kind, types.intp)
    return _numbas_index(context, builder, kind, index, size)


arrayobj.fix_integer_index = _index


class _Library(JITCodeLibrary):
    """Code of a function, optimised and made machine code only if Python calls the function."""

    called_from_python = True
    # Optimisation level of LLVM, 0 to 3.
    level = 3

    def _optimize_functions(self, ll_module: Any) -> None:
        with _on(self._codegen, machine(self._codegen, self.level)):
            super()._optimize_functions(ll_module)

    def _optimize_final_module(self) -> None:
        if self.called_from_python:
            with _on(self._codegen, machine(self._codegen, self.level)):
                self._optimise()

    def _optimise(self) -> None:
        super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        # Code read from the cache is already divided into these two parts.
        if self._shared_module is not None:
            super()._finalize_final_module()
            return
        self._divide()
        # Numba's engine makes code for one processor and level, but accepts code made before, as from the cache.
        code = machine(self._codegen, self.level).emit_object(self._final_module)
        self._compiled_object = code
        super()._finalize_final_module()
        self._compiled_object = code

    def _divide(self) -> None:
        """Separate the code that other functions copy from the code that becomes machine code."""
        module = self._final_module
        variables = [f'@"{each.name}" = common global ptr null' for each in module.global_variables if _is_kept(each)]
        if self.called_from_python:
            # No other function copies this code: names suffice to find it in the cache.
            entries = _defined(module, binding.Linkage.external)
            stubs = [f'define void @"{each.name}"() {{ ret void }}' for each in entries]
            self._shared_module = _parsed(stubs + variables, module.name)
            _relink(module, binding.Linkage.linkonce_odr, binding.Linkage.internal)
        else:
            self._shared_module, self._final_module = module, _parsed(variables, module.name)
            _relink(module, binding.Linkage.external, binding.Linkage.linkonce_odr)


class _QuickLibrary(_Library):
    """Code of a function, compiled in less time, but slower."""

    level = 0

    def _optimise(self) -> None:
        manager, builder = self._codegen._module_pass_manager(opt=0, loop_vectorize=False, slp_vectorize=False)
        manager.run(self._final_module, builder)


@contextmanager
def _on(codegen: Any, other: binding.TargetMachine) -> Iterator[None]:
    """Let LLVM optimise for another machine within the context; Numba compiles one function at a time."""
    before, codegen._tm = codegen._tm, other
    try:
        yield
    finally:
        codegen._tm = before


class SeparateCode(CompilerBase):
    """Numba's compiler with other passes and libraries."""

    library = _Library

    def define_pipelines(self) -> list[PassManager]:
        """Return the only pipeline of kernels."""
        return [kernel_passes()]

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function."""
        library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        library.called_from_python = not self.state.flags.no_cpython_wrapper
        if library.called_from_python:
            # The function is not in the cache on disk, otherwise it would not be compiled.
            announce_compiling()
        library.enable_object_caching()
        self.state.library = library
        with remembered_signatures():
            return super().compile_extra(func)


class QuickCode(SeparateCode):
    """Compiler for functions with so few calls that optimised compilation would take longer than it saves."""

    library = _QuickLibrary


class _Cache:
    """Cache of a kernel on disk, opened when the kernel is first needed.

    Cached code is loaded without initialising Numba's declarations for compiling, which takes longer than loading.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def _on_disk(self) -> Any:
        return KernelCache(self._function)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the code compiled for a signature, or None."""
        with self._on_disk._guard_against_spurious_io_errors():
            return self._on_disk._load_overload(signature, context)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._on_disk, name)


def compiled(function: Callable[..., Any], *, quick: bool = False, **options: Any) -> Any:
    """Return a function compiled by `SeparateCode`, or by `QuickCode` if `quick`."""
    own = {"no_cfunc_wrapper": True, "_nrt": False, "pipeline_class": QuickCode if quick else SeparateCode}
    found: Any = njit(**options, **own)(function)
    found._cache = _Cache(function)
    return found


def _defined(module: Any, linkage: binding.Linkage) -> list[Any]:
    return [each for each in module.functions if not each.is_declaration and each.linkage == linkage]


def _relink(module: Any, old: binding.Linkage, new: binding.Linkage) -> None:
    for function in _defined(module, old):
        function.linkage = new


def _is_kept(variable: Any) -> bool:
    """Return whether Numba looks the variable up in the cache; its definition there may be empty."""
    return variable.name.startswith("_ZN08NumbaEnv")


def _parsed(lines: list[str], name: str) -> Any:
    module = binding.parse_assembly("\n".join(lines))
    module.name = name
    return module
