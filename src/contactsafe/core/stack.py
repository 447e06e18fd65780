"""Small arrays on the stack: a control tick that asks the heap for memory may wait for it.

Such an array is gone when the function that made it returns. It may be handed down to others, which may hand it back,
but never out; and it is made at the top of a function, not in a loop, where each turn would take up more of the stack.
"""

from typing import Any

from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array


def _array_on_stack(context, builder, array, shape):
    """Make an uninitialised row-major array of float64 in the frame of the function being compiled."""
    itemsize, count = context.get_constant(types.intp, 8), context.get_constant(types.intp, 1)
    strides: list = []
    for length in reversed(shape):
        strides.insert(0, builder.mul(itemsize, count))
        count = builder.mul(count, length)
    data = builder.alloca(context.get_data_type(types.float64), size=count)
    made = context.make_array(array)(context, builder)
    populate_array(made, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return made._getvalue()


@intrinsic
def stack_vector(typing_context: Any, n: Any) -> Any:
    """Make n float64 for the time of the calling function, uninitialised, (n,)."""
    array = types.Array(types.float64, 1, "C")

    def codegen(context, builder, signature, args):
        return _array_on_stack(context, builder, array, args)

    return array(types.intp), codegen


@intrinsic
def stack_matrix(typing_context: Any, rows: Any, columns: Any) -> Any:
    """Make rows × columns float64 for the time of the calling function, uninitialised, (rows, columns)."""
    array = types.Array(types.float64, 2, "C")

    def codegen(context, builder, signature, args):
        return _array_on_stack(context, builder, array, args)

    return array(types.intp, types.intp), codegen
