"""How kernels are compiled: one decorator, one kind of C function, and calls by address.

Kernels are serial, release the interpreter lock and are kept on disk; `studio_core.parallel` runs them
in chunks on threads. Floating-point liberties stop short of `nnan` and `ninf`, so `isfinite` works.
Write no kernel factories and hand no kernel to a kernel as an argument: neither is ever found on disk
again. A function that is chosen at run time is a `batch_function`, whose `.address` travels as an
integer and is called through `call_address`; so are the functions of a C library.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable
from typing import Any, Literal, TypeVar, cast, overload

from studio_core.jit_cache import KernelCache, cache_root, open_cache

# numba's inner modules are typed in some versions and not in others.
numba: Any = importlib.import_module("numba")
types: Any = importlib.import_module("numba.core.types")
cgutils: Any = importlib.import_module("numba.core.cgutils")
normalize_signature: Any = importlib.import_module("numba.core.sigutils").normalize_signature
CFunc: Any = importlib.import_module("numba.core.ccallback").CFunc
ir: Any = importlib.import_module("llvmlite.ir")
intrinsic: Any = importlib.import_module("numba.extending").intrinsic

F = TypeVar("F", bound=Callable[..., Any])

FASTMATH = {"contract", "reassoc", "nsz", "arcp", "afn"}

CACHE_FOLDER = open_cache(cache_root())
if CACHE_FOLDER is not None:
    numba.config.CACHE_DIR = str(CACHE_FOLDER)


@overload
def kernel(function: F, /) -> F: ...
@overload
def kernel(*, inline: Literal["never", "always"] = "never") -> Callable[[F], F]: ...
def kernel(
    function: Callable[..., Any] | None = None, /, *, inline: Literal["never", "always"] = "never"
) -> Callable[..., Any]:
    """Compiles a function on its first call: nopython, without the interpreter lock, kept on disk.

    Division by zero gives inf or nan as in NumPy. `inline="always"` is for helpers whose arguments
    must be folded into the caller before types are known; LLVM inlines small helpers anyhow.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        compiled = numba.njit(nogil=True, error_model="numpy", fastmath=FASTMATH, inline=inline)(function)
        if CACHE_FOLDER is not None and hasattr(compiled, "_cache"):  # plain under NUMBA_DISABLE_JIT
            compiled._cache = KernelCache(function)
        return cast(Callable[..., Any], compiled)

    return decorate if function is None else decorate(function)


class BatchFunction:
    """A kernel with C calling convention that other kernels call by its address.

    Compiled (or loaded from disk) when `address` is first asked for; calling the object itself runs
    the Python source, which is what oracles and tests of the interface want.
    """

    def __init__(self, function: Callable[..., Any], signature: str | object):
        self.__name__ = function.__name__
        self.__doc__ = function.__doc__
        self.signature = signature
        self.python_function = function
        self._compiled: Any = None
        self._lock = threading.Lock()

    @property
    def address(self) -> int:
        """Where the machine code lies; valid while this process lives."""
        with self._lock:
            if self._compiled is None:
                options = {"nopython": True, "error_model": "numpy", "fastmath": FASTMATH}
                made = CFunc(
                    self.python_function,
                    normalize_signature(self.signature),
                    locals={},
                    options=options,
                )
                if CACHE_FOLDER is not None:
                    made._cache = KernelCache(self.python_function)
                made.compile()
                self._compiled = made
            return int(self._compiled.address)

    def __call__(self, *arguments: Any) -> Any:
        """Runs the Python source."""
        return self.python_function(*arguments)


def batch_function(signature: str | object) -> Callable[[Callable[..., Any]], BatchFunction]:
    """Makes a module-level function callable by address, with the given numba signature.

    `signature` is numba's, for example ``"void(CPointer(float32), CPointer(float32), int64)"``. The
    function loops over one batch (a vertex's directions): a call costs about 2 ns, so not per item.
    It must not raise: nobody could catch it.
    """

    def decorate(function: Callable[..., Any]) -> BatchFunction:
        return BatchFunction(function, signature)

    return decorate


def _call_address(typingctx: Any, address: Any, *arguments: Any) -> Any:
    if len(arguments) == 1 and isinstance(arguments[0], types.BaseTuple):
        arguments = tuple(arguments[0])
    if not isinstance(address, types.Integer):
        return None

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        target, packed = values
        called, kinds = [], []
        for index, kind in enumerate(arguments):
            value = builder.extract_value(packed, index)
            if isinstance(kind, types.Array):
                made = context.make_array(kind)(context, builder, value)
                value = builder.bitcast(made.data, cgutils.voidptr_t)
            elif isinstance(kind, types.Integer):
                value = context.cast(builder, value, kind, types.int64)
            called.append(value)
            kinds.append(value.type)
        function_type = ir.FunctionType(ir.VoidType(), kinds)
        wide = context.cast(builder, target, address, types.intp)
        builder.call(builder.inttoptr(wide, function_type.as_pointer()), called)
        return context.get_dummy_value()

    return types.void(address, types.StarArgTuple.from_types(arguments)), codegen


def _pointer(typingctx: Any, address: Any) -> Any:
    if not isinstance(address, types.Integer):
        return None

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        wide = context.cast(builder, values[0], signature.args[0], types.intp)
        return builder.inttoptr(wide, cgutils.voidptr_t)

    return types.voidptr(address), codegen


def _address_of(typingctx: Any, array: Any) -> Any:
    if not isinstance(array, types.Array):
        return None

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        made = context.make_array(signature.args[0])(context, builder, values[0])
        return builder.ptrtoint(made.data, context.get_value_type(types.intp))

    return types.intp(array), codegen


# The intrinsics under the types that callers see; all three work inside kernels only.
call_address = cast(Callable[..., None], intrinsic(_call_address))
"""``call_address(address, *arguments)`` calls a C function that returns nothing.

Arrays are passed as pointers to their first item, integers as 64-bit (pointers, sizes; as 32-bit
parameters they also arrive on every ABI we run on), floats as they are. The arrays must outlive the call.
"""
pointer = cast(Callable[[int], Any], intrinsic(_pointer))
carray = cast(Callable[..., Any], numba.carray)
"""``carray(pointer(address), shape, dtype)`` is the array at an address, in kernels."""
address_of = cast(Callable[[Any], int], intrinsic(_address_of))
"""``address_of(array)`` is the address of the array's first item; the array must outlive its use."""
