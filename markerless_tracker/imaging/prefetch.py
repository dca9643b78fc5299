"""Requests rows of an image from memory before a kernel reads them.

A window of an image is many short rows, far apart in memory. The processor requests by itself what
follows in a long row, but not the next short one, for which the kernel would wait. Results do not
depend on these requests.
"""

from typing import Any

# What numba itself builds its code with.
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from markerless_tracker.compiled import inlined

ROWS_AHEAD = 2
"""Number of rows between the one that is read and the one that is requested."""
_LINE_BYTES = 64


@intrinsic  # type: ignore[untyped-decorator]
def _request(typing_context, row, index):  # type: ignore[no-untyped-def]
    """Request the cache line of row[index]; LLVM's `llvm.prefetch` (read, keep, data)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        address, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        function = builder.module.declare_intrinsic(
            "llvm.prefetch",
            (address,),
            ir.FunctionType(ir.VoidType(), [address, number, number, number]),
        )
        place = builder.bitcast(builder.gep(array.data, [arguments[1]]), address)
        builder.call(function, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(row, types.intp), generate


@inlined
def prefetch(row):  # type: ignore[no-untyped-def]
    """Request a row (n,) of adjacent values, which a kernel reads soon."""
    for j in range(0, row.size, _LINE_BYTES // row.itemsize):
        _request(row, j)
    if row.size > 0:
        _request(row, row.size - 1)
