"""A queue that compiled loops on several threads take from without the GIL.

The queue is a counter of one element. Taking is one atomic instruction of the processor. If Python gave out the
numbers, a worker would have to wait for the GIL before every push.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from metaid.compiled.decorator import compiled

Queue = NDArray[np.int64]


def new_queue() -> Queue:
    """A queue of the numbers 0, 1, 2 and so on, none of them taken yet."""
    return np.zeros(1, dtype=np.int64)


@intrinsic
def _add_one(_typing: Any, counter: Any) -> Any:
    """The counter before one is added to it, as one atomic operation."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """The LLVM value that the call becomes.

        Args:
            context: of numba, which knows how an array is laid out.
            builder: of LLVM's instructions.
            signature: the numba types of the call.
            arguments: their LLVM values.
        """
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), generate


@compiled
def take(queue):  # type: ignore[no-untyped-def]
    """The next number of the `queue`; each is given to one taker only."""
    return _add_one(queue)  # type: ignore[call-arg]
