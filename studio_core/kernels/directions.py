"""The S = 2^k directions of the sphere, ordered as a binary tree with analytic lookup both ways.

Each hemisphere (y ≥ 0 first) is a square of equal-area cells under the concentric map of Shirley and
Chiu 1997 ("A low distortion map between disk and square") lifted to the hemisphere by y = 1 − r².
Cells are numbered in Morton order, so leaf j of 2^k is a child of leaf j >> 1 of 2^(k−1), and every
node of the tree is a cell of a coarser set. Odd k: square cells; even k: cells of 2:1. Nodes are
numbered as in a heap: root 1, hemispheres 2 and 3, children of i at 2i and 2i+1, leaf j at S + j.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

SMALLEST, LARGEST = 10, 17

_ONE, _TWO, _HALF = np.float32(1), np.float32(2), np.float32(0.5)
_EIGHTH_TURN = np.float32(math.pi / 4)
_FOUR_OVER_PI = np.float32(4 / math.pi)


@kernel
def arctangent(q: np.float32) -> np.float32:
    """atan(q) for |q| ≤ 1 within 1e-7 (Abramowitz and Stegun 1964, 4.4.49)."""
    w = q * q
    series = np.float32(0.0028662257)
    series = series * w - np.float32(0.0161657367)
    series = series * w + np.float32(0.0429096138)
    series = series * w - np.float32(0.0752896400)
    series = series * w + np.float32(0.1065626393)
    series = series * w - np.float32(0.1420889944)
    series = series * w + np.float32(0.1999355085)
    series = series * w - np.float32(0.3333314528)
    return q + q * w * series


@kernel
def _cosine_sine(angle: np.float32) -> tuple[np.float32, np.float32]:
    """cos and sin for |angle| ≤ π/4 by their series, within 1e-7."""
    w = angle * angle
    cosine = ((w / np.float32(40320) - _ONE / np.float32(720)) * w + _ONE / np.float32(24)) * w - _HALF
    sine = ((w / np.float32(-5040) + _ONE / np.float32(120)) * w - _ONE / np.float32(6)) * w
    return _ONE + cosine * w, angle + angle * sine


@kernel
def direction_at(hemisphere: int, s: np.float32, t: np.float32) -> tuple[np.float32, np.float32, np.float32]:
    """The unit direction of point (s, t) in [0, 1]² of a hemisphere (0: y ≥ 0, 1: y ≤ 0)."""
    a, b = _TWO * s - _ONE, _TWO * t - _ONE
    first = abs(a) > abs(b)
    r = a if first else b
    other = b if first else a
    cosine, sine = _cosine_sine(_EIGHTH_TURN * (other / (r if r != 0 else _ONE)))
    square = r * r
    lift = np.float32(math.sqrt(_TWO - square)) * r
    y = _ONE - square
    x, z = cosine if first else sine, sine if first else cosine
    return lift * x, y if hemisphere == 0 else -y, lift * z


@kernel
def square_of(x: np.float32, y: np.float32, z: np.float32) -> tuple[int, np.float32, np.float32]:
    """Hemisphere and point (s, t) in [0, 1]² of a unit direction: the inverse of `direction_at`."""
    around = x * x + z * z
    r = np.float32(math.sqrt(around / (_ONE + abs(y))))
    first = abs(x) > abs(z)  # no branches: loops over many points become vector code
    larger, smaller = x if first else z, z if first else x
    c = r if larger > 0 else -r
    d = c * _FOUR_OVER_PI * arctangent(smaller / (larger if larger != 0 else _ONE))
    return (0 if y >= 0 else 1), _HALF * ((c if first else d) + _ONE), _HALF * ((d if first else c) + _ONE)


@kernel
def _spread(bits: int) -> int:
    """Puts a zero between each two of the lowest 16 bits."""
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


@kernel
def _gather(bits: int) -> int:
    """Keeps every other bit: the inverse of `_spread`."""
    bits &= 0x55555555
    bits = (bits | (bits >> 1)) & 0x33333333
    bits = (bits | (bits >> 2)) & 0x0F0F0F0F
    bits = (bits | (bits >> 4)) & 0x00FF00FF
    return (bits | (bits >> 8)) & 0x0000FFFF


@kernel
def leaf_of_cell(hemisphere: int, column: int, row: int, k: int) -> int:
    """Leaf number of a cell; columns count along s, of which there are 2^(k/2), rows along t."""
    if k & 1:
        return (hemisphere << (k - 1)) | (_spread(column) << 1) | _spread(row)
    return (hemisphere << (k - 1)) | _spread(column) | (_spread(row) << 1)


@kernel
def cell_of_leaf(leaf: int, k: int) -> tuple[int, int, int]:
    """Hemisphere, column and row of a leaf: the inverse of `leaf_of_cell`."""
    code = leaf & ((1 << (k - 1)) - 1)
    if k % 2 == 1:
        return leaf >> (k - 1), _gather(code >> 1), _gather(code)
    return leaf >> (k - 1), _gather(code), _gather(code >> 1)


@kernel
def leaf_of(x: np.float32, y: np.float32, z: np.float32, k: int) -> int:
    """The leaf of 2^k whose cell holds a unit direction."""
    columns, rows = 1 << (k // 2), 1 << ((k - 1) // 2)
    hemisphere, s, t = square_of(x, y, z)
    column = min(max(int(s * np.float32(columns)), 0), columns - 1)
    row = min(max(int(t * np.float32(rows)), 0), rows - 1)
    return leaf_of_cell(hemisphere, column, row, k)


@kernel
def _leaves_of(directions: F32, k: int, out: I32) -> None:
    for i in range(len(directions)):
        out[i] = leaf_of(directions[i, 0], directions[i, 1], directions[i, 2], k)


@kernel
def _points_of_cells(k: int, offset_s: np.float32, offset_t: np.float32, out: F32) -> None:
    """Directions of the points (offset_s, offset_t) in [0, 1]² of every cell."""
    columns, rows = np.float32(1 << (k // 2)), np.float32(1 << ((k - 1) // 2))
    for leaf in range(len(out)):
        hemisphere, column, row = cell_of_leaf(leaf, k)
        s = (np.float32(column) + offset_s) / columns
        t = (np.float32(row) + offset_t) / rows
        out[leaf, 0], out[leaf, 1], out[leaf, 2] = direction_at(hemisphere, s, t)


@dataclass(frozen=True, eq=False)
class NodeCones:
    """For every node of the tree a cone that holds all directions of its leaves.

    axis (2S, 3) unit float32, cos_half_angle (2S,) float32, at the heap's node numbers; item 0 is unused.
    """

    axis: F32
    cos_half_angle: F32


@dataclass(frozen=True, eq=False)
class DirectionSet:
    """2^k directions, k from 10 to 17; get it from `direction_set`."""

    k: int
    directions: F32
    """(S, 3) unit float32: the middles of the cells, in leaf order."""

    @property
    def size(self) -> int:
        """S = 2^k."""
        return 1 << self.k

    @property
    def solid_angle(self) -> float:
        """Of each cell, in steradians."""
        return 4 * math.pi / self.size

    def leaf_of(self, directions: npt.ArrayLike) -> I32:
        """The leaves (N,) whose cells hold unit directions (N, 3)."""
        given = np.ascontiguousarray(directions, np.float32).reshape(-1, 3)
        out = np.empty(len(given), np.int32)
        _leaves_of(given, self.k, out)
        return out

    def points(self, s: float, t: float) -> F32:
        """(S, 3) directions of the point (s, t) in [0, 1]² of every cell; (0.5, 0.5) is the middle."""
        out = np.empty((self.size, 3), np.float32)
        _points_of_cells(self.k, np.float32(s), np.float32(t), out)
        return out

    @cached_property
    def cones(self) -> NodeCones:
        """Bounding cones of all nodes."""
        size, k = self.size, self.k
        axis = np.zeros((2 * size, 3))
        axis[size:] = self.directions
        for level in range(k - 1, -1, -1):
            first = 1 << level
            axis[first : 2 * first] = axis[2 * first : 4 * first].reshape(first, 2, 3).sum(axis=1)
        axis[0:2] = 0.0, 1.0, 0.0  # the whole sphere has no middle
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        axes: F32 = axis.astype(np.float32)
        # A cell's edges bend less than a tenth of their length: corners, middles of edges and a margin
        # of a tenth of the leaf's size hold them.
        ring = [(0, 0), (0.5, 0), (1, 0), (1, 0.5), (1, 1), (0.5, 1), (0, 1), (0, 0.5)]
        rim = np.stack([self.points(s, t) for s, t in ring], axis=1).astype(np.float32)
        cosine = np.full(2 * size, -1.0)
        for level in range(1, k + 1):
            first = 1 << level
            leaves = rim.reshape(first, -1, 3)
            cosine[first : 2 * first] = np.einsum("npc,nc->np", leaves, axes[first : 2 * first]).min(axis=1)
        margin = 0.1 * math.sqrt(self.solid_angle)
        cosine = np.cos(np.minimum(np.arccos(np.clip(cosine, -1, 1)) + margin, math.pi))
        cones = NodeCones(axes, cosine.astype(np.float32))
        cones.axis.flags.writeable = cones.cos_half_angle.flags.writeable = False
        return cones

    @cached_property
    def packet_cones(self) -> tuple[F32, F32]:
        """Axes (9 S/64, 3) and sines of the half angles of the nodes of 64 leaves, then of 8."""
        groups = self.size // 64
        cones, tops, packets = self.cones, slice(groups, 2 * groups), slice(8 * groups, 16 * groups)
        axes = np.concatenate([cones.axis[tops], cones.axis[packets]])
        cosines = np.concatenate([cones.cos_half_angle[tops], cones.cos_half_angle[packets]])
        return axes, np.sqrt(np.maximum(1.0 - cosines.astype(np.float64) ** 2, 0.0)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class DirectionList:
    """Directions of our own choosing, such as those where the light is: zeros fill up to 64."""

    given: F32
    """(N, 3) unit float32, neighbours near each other."""
    solid_angle: float = 1.0
    """Of each, in steradians."""

    @staticmethod
    def of_leaves(k: int, leaves: I64) -> DirectionList:
        """The middles of some cells (N,) of the set of 2^k directions, in tree order."""
        found = direction_set(k)
        return DirectionList(found.directions[leaves], found.solid_angle)

    @property
    def size(self) -> int:
        """N rounded up to a multiple of 64."""
        return -(-len(self.given) // 64) * 64

    @cached_property
    def directions(self) -> F32:
        """(size, 3): unit directions, then zeros, which no ray follows."""
        made = np.zeros((self.size, 3), np.float32)
        made[: len(self.given)] = self.given
        return made

    @cached_property
    def packet_cones(self) -> tuple[F32, F32]:
        """Axes and sines of cones about every 64 directions, then about every 8."""
        axes, sines = [], []
        for block in (64, 8):
            groups = self.directions.astype(np.float64).reshape(-1, block, 3)
            axis = groups.sum(axis=1)
            length = np.linalg.norm(axis, axis=1, keepdims=True)
            axis = np.where(length > 1e-9, axis / np.maximum(length, 1e-9), (0.0, 1.0, 0.0))
            there = groups.any(axis=2)
            cosine = np.where(there, np.einsum("gnc,gc->gn", groups, axis), 1.0).min(axis=1)
            sine = np.sqrt(np.maximum(1 - cosine**2, 0.0)) + 1e-4
            axes.append(axis)
            sines.append(np.where(cosine > 0, sine, 2.0))  # more than a half sphere is never skipped
        return np.concatenate(axes).astype(np.float32), np.concatenate(sines).astype(np.float32)


@functools.lru_cache(maxsize=LARGEST - SMALLEST + 1)
def direction_set(k: int) -> DirectionSet:
    """The set of 2^k directions; the same object for the same k."""
    if not SMALLEST <= k <= LARGEST:
        raise ValueError(f"there are 2^{SMALLEST} to 2^{LARGEST} directions, not 2^{k}")
    directions = np.empty((1 << k, 3), np.float32)
    _points_of_cells(k, _HALF, _HALF, directions)
    directions.flags.writeable = False
    return DirectionSet(k, directions)
