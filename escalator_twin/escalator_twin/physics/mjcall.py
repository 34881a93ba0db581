"""Call MuJoCo's own functions from compiled code: no interpreter between two steps."""

from collections.abc import Callable
import ctypes
from functools import cache
from pathlib import Path

from llvmlite import ir
import mujoco
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from escalator_twin.errors import EscalatorError


@cache
def address_of(name: str) -> int:
    """Return the address of a function in the library that the ``mujoco`` package loaded.

    Raises
    ------
    EscalatorError
        Where the package holds no library with that function.
    """
    for path in sorted(Path(mujoco.__file__).parent.glob('*mujoco*')):
        if path.is_file() and ('.so' in path.name or path.suffix in ('.dylib', '.dll')):
            library = ctypes.CDLL(str(path))
            if hasattr(library, name):
                return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0
    raise EscalatorError(f'mujoco {mujoco.__version__}: its package holds no library with {name}')


def _typed(_context: object, _address: object, _model: object, _data: object) -> object:
    """Tell numba the type of ``call_step`` and how to generate it."""
    signature = types.void(types.int64, types.int64, types.int64)

    def generate(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        model = builder.inttoptr(arguments[1], pointer)
        data = builder.inttoptr(arguments[2], pointer)
        builder.call(function, [model, data])
        return cgutils.get_null_value(context.get_value_type(types.void))  # type: ignore[no-untyped-call]

    return signature, generate


# Calls ``void f(void* model, void* data)`` at an address; all three are integers.
call_step: Callable[[int, int, int], None] = intrinsic(_typed)  # type: ignore[assignment]
