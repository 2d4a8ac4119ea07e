"""Fixed patterns of local rays: what a receiver looks along, chosen once and kept.

A pattern has several variants, so that neighbours do not err alike; which one a vertex uses is a hash of its
number. Rays lie in Morton order of the square that the hemisphere is made from: ray i of one variant points
about where ray i of another does, and eight neighbours looking along it make one coherent packet.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash, readonly
from studio_core.kernels.directions import direction_set

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U32 = npt.NDArray[np.uint32]

VARIANTS = 256
MOST_RAYS = 1 << 14


@dataclass(frozen=True, eq=False)
class Pattern:
    """P variants of N unit rays in a surface's frame (z is the normal), and what each stands for.

    directions (P, N, 3) float32; projected (P, N) float32: steradians times the cosine, so that
    Σ projected · L is the irradiance. `key` tells patterns apart by content.
    """

    directions: F32
    projected: F32
    key: str

    @staticmethod
    def of(directions: npt.ArrayLike, projected: npt.ArrayLike) -> Pattern:
        """A pattern with these rays; `projected` is broadcast to them."""
        rays = readonly(directions, np.float32, -1, -1, 3)
        each = np.broadcast_to(np.asarray(projected, np.float32), rays.shape[:2])
        return Pattern(rays, each, content_hash(rays, np.asarray(projected, np.float32)))

    @property
    def variants(self) -> int:
        """P."""
        return int(self.directions.shape[0])

    @property
    def rays(self) -> int:
        """N, of each variant."""
        return int(self.directions.shape[1])


def variants_of(vertices: npt.NDArray[np.int64], variants: int) -> npt.NDArray[np.int32]:
    """Which of the variants each of the vertices uses, by a hash of its number."""
    z = vertices.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    return np.asarray((z >> np.uint64(33)) % np.uint64(variants), np.int32)


@functools.lru_cache(maxsize=12)
def cosine_pattern(rays: int, variants: int = VARIANTS, seed: int = 0) -> Pattern:
    """Cosine-distributed rays: each stands for π / N, and the mean over them of L is irradiance / π.

    Every variant is a Sobol' (0, 2)-sequence with nested uniform scrambling of its own (Owen 1995, by the
    hash of Laine and Karras 2011 as in Burley 2020, "Practical Hash-based Owen Scrambling"), put onto the
    disc by the concentric map of Shirley and Chiu 1997 and lifted to the hemisphere. Variants, and patterns
    of other seeds or sizes, are independent of each other. ValueError for less than one or too many.
    """
    if not (1 <= rays <= MOST_RAYS and variants >= 1):
        raise ValueError(f"a pattern has 1 to {MOST_RAYS} rays and at least one variant")
    rng = np.random.default_rng((seed, rays, variants))
    seeds = rng.integers(0, 1 << 32, (2, variants, 1), dtype=np.uint32)
    first, second = _sobol(rays)
    x, y = _owen(first, seeds[0]), _owen(second, seeds[1])
    order = np.argsort(_morton(x, y), axis=1, kind="stable")
    square = np.stack([np.take_along_axis(axis, order, axis=1) for axis in (x, y)])
    disc = _concentric((square.astype(np.float64) + 0.5) / 2.0**32)
    up = np.sqrt(np.maximum(1 - (disc**2).sum(axis=0), 0))
    return Pattern.of(np.stack([*disc, up], axis=2), np.pi / rays)


@functools.lru_cache(maxsize=4)
def grid_pattern(side: int = 32) -> Pattern:
    """One variant: the middles of side × side cells of equal solid angle.

    Ray i is leaf i of a `direction_set` whose y is the normal here, and whose z and x are the first two axes.
    `side` is a power of 2 from 32 to 256, else ValueError.
    """
    level = side.bit_length() - 1
    if side not in (32, 64, 128, 256):
        raise ValueError(f"a grid of rays has 32, 64, 128 or 256 cells a side, not {side}")
    upper = direction_set(2 * level + 1).directions[: side * side]
    rays = upper[:, [2, 0, 1]]
    up = rays[None, :, 2].astype(np.float64)
    return Pattern.of(rays[None], np.pi * up / up.sum())


def _sobol(count: int) -> tuple[U32, U32]:
    """The first points of the (0, 2)-sequence, 32 bits a coordinate."""
    index = np.arange(count, dtype=np.uint32)
    second = np.zeros(count, np.uint32)
    column = np.uint32(1 << 31)
    for bit in range(32):
        second ^= np.where(index >> np.uint32(bit) & np.uint32(1), column, np.uint32(0))
        column ^= column >> np.uint32(1)
    return _reversed(index), second


def _reversed(bits: U32) -> U32:
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF)):
        low = np.uint32(mask)
        bits = (bits & low) << np.uint32(shift) | bits >> np.uint32(shift) & low
    return bits << np.uint32(16) | bits >> np.uint32(16)


def _owen(values: U32, seeds: U32) -> U32:
    """Nested uniform scrambling of (N,) by each of (P, 1) seeds."""
    bits = _reversed(values)[None, :] + seeds
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        bits = bits ^ bits * np.uint32(factor)
    return _reversed(bits)


def _morton(x: U32, y: U32) -> npt.NDArray[np.int64]:
    code = np.zeros(x.shape, np.int64)
    for bit in range(16):
        for axis, values in enumerate((y, x)):
            code |= (values.astype(np.int64) >> (16 + bit) & 1) << (2 * bit + axis)
    return code


def _concentric(square: F64) -> F64:
    """Points (2, …) of the unit disc for points of the unit square, areas in proportion."""
    a, b = 2 * square - 1
    wide = np.abs(a) > np.abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    angle = np.pi / 4 * other / np.where(radius == 0, 1.0, radius)
    along, across = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([np.where(wide, along, across), np.where(wide, across, along)])


__all__ = ["VARIANTS", "Pattern", "cosine_pattern", "grid_pattern", "variants_of"]
