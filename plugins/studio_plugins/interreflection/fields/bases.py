"""Few functions over an object's vertices that its radiance is made of (section 5.2, equations 6 and 7).

Principal components of the columns of `training`, of their second moments (a mean of its own would be one
more function). Vertices weigh as the area they stand for: the paper counts them alike, and a finely split
corner for more than a plain wall. Not by a decomposition of the columns themselves: the product of the
smaller side with itself (columns or vertices) has the same components and is quick.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, eigh

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST = 1e-9
"""Of the largest second moment, below which a component is rounding."""


@dataclass(frozen=True, eq=False)
class Basis:
    """N functions over V vertices: functions (V, N), and the area (V,) by which vertices weigh."""

    functions: F32
    area: F64

    def __len__(self) -> int:
        return int(self.functions.shape[1])

    @cached_property
    def _weighted(self) -> F64:
        return np.asarray(self.functions.astype(np.float64).T * self.area)

    @cached_property
    def _factor(self) -> tuple[Any, bool]:
        """Cholesky's of the matrix A of equation 7, in place of the paper's A⁻¹."""
        matrix = self._weighted @ self.functions.astype(np.float64)
        matrix[np.diag_indices_from(matrix)] += 1e-12 * max(float(np.trace(matrix)), 1e-300)
        made: tuple[Any, bool] = cho_factor(matrix, lower=True)
        return made

    def weights(self, values: npt.NDArray[np.floating[Any]]) -> F64:
        """(N, …) that make values (V, …) of least squared error, by area: equations 6 and 7."""
        flat = np.asarray(values, np.float64).reshape(len(values), -1)
        if not len(self):
            return np.zeros((0, *values.shape[1:]))
        found = cho_solve(self._factor, self._weighted @ flat, check_finite=False)
        return np.asarray(found.reshape(len(self), *values.shape[1:]))

    def made(self, weights: npt.NDArray[np.floating[Any]]) -> F64:
        """(V, …) of weights (N, …)."""
        return np.asarray(np.tensordot(self.functions.astype(np.float64), weights, 1))


def principal_components(columns: F32, area: npt.NDArray[np.floating[Any]], count: int) -> Basis:
    """The `count` functions that make columns (V, C) with least error; fewer where fewer make them all."""
    weight = np.asarray(area, np.float64)
    root = np.sqrt(np.maximum(weight, 1e-12 * max(float(weight.max(initial=0.0)), 1e-300)))
    scaled = np.asarray(columns * root[:, None].astype(np.float32), np.float32)
    wide = scaled.shape[0] <= scaled.shape[1]
    moments = (scaled @ scaled.T if wide else scaled.T @ scaled).astype(np.float64)
    most = min(count, len(moments))
    if not most or not moments.any():
        return Basis(np.zeros((len(columns), 0), np.float32), root**2)
    sizes, vectors = eigh(moments, subset_by_index=[len(moments) - most, len(moments) - 1])
    sizes, vectors = sizes[::-1], vectors[:, ::-1]
    kept = sizes > LEAST * sizes[0]
    vectors = vectors[:, kept]
    if not wide:
        vectors = scaled @ vectors / np.sqrt(sizes[kept])
    # weights of area 1 make functions of about 1
    functions = vectors / root[:, None] * np.sqrt(weight.sum())
    return Basis(functions.astype(np.float32), root**2)


def spread(basis: Basis, some: npt.NDArray[np.int64], count: int) -> Basis:
    """The same over `count` vertices, of which it knows some: 0 at the others."""
    functions = np.zeros((count, len(basis)), np.float32)
    area = np.zeros(count)
    functions[some], area[some] = basis.functions, basis.area
    return Basis(functions, area)


__all__ = ["Basis", "principal_components", "spread"]
