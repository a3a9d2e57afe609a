"""Numba's compiler passes for kernels, without those that no kernel needs.

Numba's own list of passes is for any Python function: closures, contexts, parallel loops, rewritten array expressions.
Numba also resolves the types of every sum and product again, among dozens of candidates from strings to dates.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import types
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    RewriteSemanticConstants,
    TranslateByteCode,
)

# Signatures found so far, each with its implementation.
_found: dict[Any, Any] = {}


@contextmanager
def remembered_signatures() -> Iterator[None]:
    """Return a context in which Numba remembers the signatures of operators and built-in functions by types."""
    functions: Any = types.Function
    look_up = functions.get_call_type

    def remember(function: Any, context: Any, arguments: Any, named: Any) -> Any:
        if named:
            return look_up(function, context, arguments, named)
        key = (function, tuple(arguments))
        if key not in _found:
            signature = look_up(function, context, arguments, named)
            _found[key] = signature, function.get_impl_key(signature)
        signature, implementation = _found[key]
        # A function compiled elsewhere with other options may have replaced the implementation.
        function._impl_keys[signature.args] = implementation
        return signature

    functions.get_call_type = remember
    try:
        yield
    finally:
        functions.get_call_type = look_up


class _Manager(PassManager):
    """Pass manager without bookkeeping after each pass; `IRLegalization` does it once before code generation."""

    _ENFORCING = False


_PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    RewriteSemanticConstants,
    DeadBranchPrune,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
)


def kernel_passes() -> PassManager:
    """Return the pass manager with all passes for a kernel, in order."""
    manager = _Manager("kernel")
    for each in _PASSES:
        manager.add_pass(each, each.__name__)
    manager.finalize()
    return manager
