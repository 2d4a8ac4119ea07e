"""Measured tables as kernels see them: a model's shape names a table by address and content.

A shape is a short float32 array, compared and copied at every edit, and a table may have 17 MB. So the shape
holds the table's address, its size and its content hash, all in whole numbers that float32 keeps: equal
shapes mean equal tables, and a table made at an address that another had is told apart. Whoever holds the
shape must keep the `Table` alive (`studio_core.shading.artifacts.Shapes.tables` does).
"""

from __future__ import annotations

from typing import Any, cast

import numba
import numpy as np
import numpy.typing as npt

from studio_core.jit import carray, kernel, pointer
from studio_core.scene.geometry import Table

REFERENCE = 16
"""Numbers of a reference: 4 of the address, 4 sides, 8 of the content hash."""
_BITS = 16
_FLOAT = cast(Any, numba).float32


def reference(table: Table) -> npt.NDArray[np.float32]:
    """(REFERENCE,) of a table; valid while it lives."""
    address = table.values.ctypes.data
    places = [(address >> _BITS * k) & 0xFFFF for k in range(4)]
    content = [int(table.key[4 * k : 4 * k + 4], 16) for k in range(8)]
    made = np.array([*places, *table.values.shape, *content], np.float32)
    if (made[4:8] != table.values.shape).any():
        raise ValueError(f"a table of shape {table.values.shape} is too large")
    return made


@kernel
def referred(shape: Any) -> Any:
    """The flat numbers of the table that the first REFERENCE numbers of a shape name."""
    address = np.int64(0)
    for k in range(4):
        address |= np.int64(shape[k]) << np.int64(_BITS * k)
    count = np.int64(shape[4]) * np.int64(shape[5]) * np.int64(shape[6]) * np.int64(shape[7])
    return carray(pointer(address), count, _FLOAT)  # type: ignore[arg-type]
