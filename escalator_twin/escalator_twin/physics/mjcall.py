"""Call MuJoCo's own ``mj_step`` from compiled code: no interpreter between two steps."""

import ctypes
from pathlib import Path

from llvmlite import ir
import mujoco
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from escalator_twin.errors import EscalatorError


def step_address() -> int:
    """Return the address of ``mj_step`` in the library that the ``mujoco`` package loaded.

    Raises
    ------
    EscalatorError
        Where the package holds no library with that function.
    """
    for path in sorted(Path(mujoco.__file__).parent.glob('*mujoco*')):
        if path.is_file() and ('.so' in path.name or path.suffix in ('.dylib', '.dll')):
            library = ctypes.CDLL(str(path))
            if hasattr(library, 'mj_step'):
                return ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0
    raise EscalatorError(
        f'mujoco {mujoco.__version__}: its package holds no library with mj_step'
    )


@intrinsic
def call_step(typingctx, address, model, data):  # type: ignore[no-untyped-def]
    """Call ``void f(void* model, void* data)`` at ``address``; all three are integers."""
    signature = types.void(types.int64, types.int64, types.int64)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        model = builder.inttoptr(arguments[1], pointer)
        data = builder.inttoptr(arguments[2], pointer)
        builder.call(function, [model, data])
        return cgutils.get_null_value(context.get_value_type(types.void))

    return signature, generate
