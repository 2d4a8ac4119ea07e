"""Environment light on the tree of directions: turned, summed over nodes and ranges of leaves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_core.jit import kernel
from studio_core.kernels.directions import cell_of_leaf, direction_at, direction_set, leaf_of_cell, square_of
from studio_core.kernels.environment import checked_rotation, scaled_to
from studio_core.parallel import Body, Checkpoints, Workers

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

POINTS = 4
"""Lookups across a leaf that is turned."""
_SUBTREES = 64  # chunks of a build, whatever the number of threads
_ONE, _HALF, _ZERO = np.float32(1), np.float32(0.5), np.float32(0)
_RED, _GREEN, _BLUE = LUMINANCE


@kernel
def _rotate(
    leaves: F32, from_k: int, to_environment: F32, k: int, offsets: F32, out: F32, start: int, stop: int
) -> None:
    """Leaves start … stop: the mean over what lies at `offsets` (N, 2) of each cell."""
    columns, rows = np.float32(1 << (k // 2)), np.float32(1 << ((k - 1) // 2))
    m = to_environment
    xx, xy, xz = m[0, 0], m[0, 1], m[0, 2]
    yx, yy, yz = m[1, 0], m[1, 1], m[1, 2]
    zx, zy, zz = m[2, 0], m[2, 1], m[2, 2]
    from_columns, from_rows = 1 << (from_k >> 1), 1 << ((from_k - 1) >> 1)
    wide, tall = np.float32(from_columns), np.float32(from_rows)
    points = len(offsets)
    share = _ONE / np.float32(points)
    across, along = offsets[:, 0].copy() / columns, offsets[:, 1].copy() / rows
    source = np.empty(points, np.int32)
    for leaf in range(start, stop):
        hemisphere, column, row = cell_of_leaf(leaf, k)
        left, top = np.float32(column) / columns, np.float32(row) / rows
        for q in range(points):
            x, y, z = direction_at(hemisphere, left + across[q], top + along[q])
            ex = xx * x + xy * y + xz * z
            ey = yx * x + yy * y + yz * z
            ez = zx * x + zy * y + zz * z
            half, s, t = square_of(ex, ey, ez)  # in parts: `leaf_of` is too long to be inlined
            s_cell = min(max(int(np.int32(s * wide)), 0), from_columns - 1)
            t_cell = min(max(int(np.int32(t * tall)), 0), from_rows - 1)
            source[q] = leaf_of_cell(half, s_cell, t_cell, from_k)
        red, green, blue = _ZERO, _ZERO, _ZERO
        for q in range(points):
            at = source[q]
            red += leaves[at, 0]
            green += leaves[at, 1]
            blue += leaves[at, 2]
        out[leaf, 0], out[leaf, 1], out[leaf, 2] = red * share, green * share, blue * share


def rotate_radiance(
    leaves: F32, rotation: npt.ArrayLike, k: int, workers: Workers, job: Checkpoints | None = None
) -> F32:
    """Leaf radiance (2^k, 3) of an environment turned by `rotation`, from its leaves before (2^j, 3).

    For the time while a hand turns it: 16 lookups a leaf in milliseconds. Light moves by up to half a
    source leaf and power is kept per colour; `EnvironmentMap.over_leaves` is exact.
    """
    from_k = len(leaves).bit_length() - 1
    to_environment = np.ascontiguousarray(checked_rotation(rotation).T, np.float32)
    source = np.ascontiguousarray(leaves, np.float32)
    grid = (np.arange(POINTS, dtype=np.float32) + _HALF) / np.float32(POINTS)
    offsets = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    out = np.empty((1 << k, 3), np.float32)
    workers.run(
        len(out),
        2048,
        lambda start, stop: _rotate(source, from_k, to_environment, k, offsets, out, start, stop),
        job,
    )
    scaled_to(out, source.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(source))
    return out


@kernel
def _node_sums(
    leaves: F32, directions: F32, sums: F32, moments: F32, roots: F64, start: int, stop: int
) -> None:
    """Nodes of the subtrees start … stop, added up in float64, in float32.

    roots (subtrees, 15) get radiance (3), moment (3) and vector irradiance [channel, axis] (9) in float64.
    """
    size = len(leaves)
    count = size // len(roots)
    wide = np.empty((count, 6))
    for subtree in range(start, stop):
        vector = np.zeros(9)
        for i in range(count):
            leaf = subtree * count + i
            x, y, z = (
                np.float64(directions[leaf, 0]),
                np.float64(directions[leaf, 1]),
                np.float64(directions[leaf, 2]),
            )
            red, green, blue = (
                np.float64(leaves[leaf, 0]),
                np.float64(leaves[leaf, 1]),
                np.float64(leaves[leaf, 2]),
            )
            light = _RED * red + _GREEN * green + _BLUE * blue
            wide[i, 0], wide[i, 1], wide[i, 2] = red, green, blue
            wide[i, 3], wide[i, 4], wide[i, 5] = light * x, light * y, light * z
            vector[0] += red * x
            vector[1] += red * y
            vector[2] += red * z
            vector[3] += green * x
            vector[4] += green * y
            vector[5] += green * z
            vector[6] += blue * x
            vector[7] += blue * y
            vector[8] += blue * z
        nodes, first = count, size + subtree * count
        while True:
            for i in range(nodes):
                for c in range(3):
                    sums[first + i, c] = wide[i, c]
                    moments[first + i, c] = wide[i, 3 + c]
            if nodes == 1:
                break
            nodes, first = nodes // 2, first // 2
            for i in range(nodes):
                for c in range(6):
                    wide[i, c] = wide[2 * i, c] + wide[2 * i + 1, c]
        roots[subtree, :6] = wide[0]
        roots[subtree, 6:] = vector


@kernel
def _prefixes(
    leaves: F32,
    directions: F32,
    before: F64,
    solid_angle: float,
    power: F64,
    vector: F64,
    start: int,
    stop: int,
) -> None:
    """Running sums over the subtrees start … stop; before (subtrees, 12) is what lies in front of each."""
    count = len(leaves) // len(before)
    for subtree in range(start, stop):
        own = before[subtree].copy()
        for leaf in range(subtree * count, (subtree + 1) * count):
            for c in range(3):
                light = np.float64(leaves[leaf, c])
                own[c] += light
                power[leaf + 1, c] = own[c] * solid_angle
                for a in range(3):
                    own[3 + 3 * c + a] += light * np.float64(directions[leaf, a])
                    vector[leaf + 1, c, a] = own[3 + 3 * c + a] * solid_angle


@dataclass(frozen=True, eq=False)
class LightTree:
    """Radiance of the leaves with the sums that shading needs; get it from `LightTree.build`.

    The light of leaves a … b−1 is prefix_power[b] − prefix_power[a], the vector irradiance of a
    channel likewise from prefix_vector: exact for any interval of leaves.
    """

    k: int
    radiance: F32
    """(S, 3) mean radiance of the leaves."""
    node_sum: F32
    """(2S, 3) sum of the leaves' radiance below each node, in heap order (root 1, leaf j at S + j)."""
    node_moment: F32
    """(2S, 3) luminance-weighted sum of directions below each node; its direction is the light's centroid."""
    prefix_power: F64
    """(S + 1, 3) sums of L·Δω over leaves before each."""
    prefix_vector: F64
    """(S + 1, 3, 3) sums of L_c·ω·Δω over leaves before each: [leaf, channel, axis]."""
    _coarser: dict[int, LightTree] = field(default_factory=dict, repr=False)

    @property
    def solid_angle(self) -> float:
        """Of a leaf."""
        return 4 * math.pi / (1 << self.k)

    @staticmethod
    def build(radiance: npt.ArrayLike, workers: Workers | None = None) -> LightTree:
        """The tree over leaf radiance (2^k, 3), finite and not negative; the same with any workers."""
        leaves = np.array(radiance, np.float32, order="C")
        size = len(leaves)
        k = size.bit_length() - 1
        if leaves.shape != (1 << k, 3):
            raise InputError(f"leaf radiance needs 2^k rows of three colours, not {leaves.shape}")
        directions = direction_set(k).directions
        least, most = leaves.min(), leaves.max()
        if not (np.isfinite(least) and np.isfinite(most)):
            raise InputError("the light holds radiance that is not finite")
        if least < 0:
            raise InputError("the light holds negative radiance")
        sums, moments = np.empty((2 * size, 3), np.float32), np.empty((2 * size, 3), np.float32)
        roots = np.empty((_SUBTREES, 15))
        _run(workers, lambda a, b: _node_sums(leaves, directions, sums, moments, roots, a, b))
        sums[0] = moments[0] = 0
        above = roots[:, :6]
        while len(above) > 1:
            above = above[::2] + above[1::2]
            sums[len(above) : 2 * len(above)] = above[:, :3]
            moments[len(above) : 2 * len(above)] = above[:, 3:]
        before = np.zeros((_SUBTREES, 12))
        np.cumsum(roots[:-1, [0, 1, 2, *range(6, 15)]], axis=0, out=before[1:])
        power, vector = np.empty((size + 1, 3)), np.empty((size + 1, 3, 3))
        power[0] = vector[0] = 0
        angle = 4 * math.pi / size
        _run(workers, lambda a, b: _prefixes(leaves, directions, before, angle, power, vector, a, b))
        arrays = (leaves, sums, moments, power, vector)
        for array in arrays:
            array.flags.writeable = False
        return LightTree(k, *arrays)

    def coarsened(self, k: int) -> LightTree:
        """The tree over 2^k fewer leaves: means of this one's. Made once and kept."""
        if not k <= self.k:
            raise ValueError(f"2^{self.k} leaves cannot be made 2^{k}")
        if k == self.k:
            return self
        if k not in self._coarser:
            share = np.float32(1 / (1 << (self.k - k)))
            self._coarser[k] = LightTree.build(self.node_sum[1 << k : 2 << k] * share)
        return self._coarser[k]


def _run(workers: Workers | None, body: Body) -> None:
    if workers is None:
        body(0, _SUBTREES)
    else:
        workers.run(_SUBTREES, 4, body)
