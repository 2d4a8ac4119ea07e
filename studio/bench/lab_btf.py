"""A synthetic BTF: woven cloth whose yarns, colours and shine are known, made as it is asked for.

A plain weave on a torus: yarns go over and under each other; each has its own colour, and those across are
shinier. What a camera sees is shifted where yarns stand out (parallax), yarns throw shadows, and pictures may
be 8-bit sRGB that clip, as in real measurements. Nothing is kept but what depends on one direction.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from studio_core.imaging.transfer import linear_to_srgb, srgb_to_linear
from studio_plugins.residual.btf import Block, Indices, block_size, hemisphere_81, parts

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
_STEPS = 24


@dataclass(frozen=True, eq=False)
class Weave:
    """Cloth on `texels`² texels: `yarns` each way, `height` of a yarn over the middle, in widths of the
    sample; `shine`: strength and exponent of the highlight on yarns that run across; others have half of it.
    """

    texels: int = 256
    yarns: int = 16
    height: float = 0.006
    warp: tuple[float, float, float] = (0.45, 0.3, 0.16)
    weft: tuple[float, float, float] = (0.14, 0.2, 0.36)
    shine: tuple[float, float] = (0.05, 30.0)
    seed: int = 1

    def surface(self, x: F32, y: F32) -> F32:
        """Height at places in 0 … 1 (it repeats)."""
        return self._yarns(x, y)[0]

    def _yarns(self, x: F32, y: F32) -> tuple[F32, Flags]:
        """Height, and whether the yarn on top runs across."""
        n = self.yarns
        along, across = np.pi * n * x, np.pi * n * y
        over = np.sin(along) * np.sin(across)
        # a round back across the yarn, and up or down along it
        warp = np.abs(np.sin(along)) * 0.7 + 0.5 * over
        weft = np.abs(np.sin(across)) * 0.7 - 0.5 * over
        return np.asarray(self.height * np.maximum(warp, weft), np.float32), weft > warp

    @cached_property
    def _grid(self) -> tuple[F32, F32]:
        at = ((np.arange(self.texels) + 0.5) / self.texels).astype(np.float32)
        x, y = np.meshgrid(at, at[::-1])  # rows from the top: large y first
        return x, y

    @cached_property
    def _colours(self) -> tuple[F32, F32, F32, F32]:
        """Height (h, w), normals (h, w, 3), albedo (h, w, 3), strength of the highlight (h, w)."""
        x, y = self._grid
        height, across = self._yarns(x, y)
        step = np.float32(0.25 / self.texels)
        slope_x = (self.surface(x + step, y) - self.surface(x - step, y)) / (2 * step)
        slope_y = (self.surface(x, y + step) - self.surface(x, y - step)) / (2 * step)
        normals = np.stack([-slope_x, -slope_y, np.ones_like(x)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        rng = np.random.default_rng(self.seed)
        worn = rng.uniform(0.75, 1.25, (2, self.yarns)).astype(np.float32)
        column, row = ((a * self.yarns).astype(int) % self.yarns for a in (x, y))
        base = np.where(across[..., None], np.float32(self.weft), np.float32(self.warp))
        albedo = base * np.where(across, worn[0][row], worn[1][column])[..., None]
        strength = np.where(across, self.shine[0], 0.5 * self.shine[0])
        return height, normals.astype(np.float32), albedo.astype(np.float32), strength.astype(np.float32)

    def lit(self, light: F64) -> Flags:
        """(h, w) whether no yarn stands before a light."""
        x, y = self._grid
        height = self._colours[0]
        top = np.float32(1.2 * self.height)
        slope = max(float(light[2]), 0.05)
        free = np.ones(x.shape, np.bool_)
        reach = (top - height) / np.float32(slope)
        for step in range(1, _STEPS + 1):
            along = reach * np.float32((step / _STEPS) ** 1.5)
            over = height + along * np.float32(light[2])
            there = self.surface(x + along * np.float32(light[0]), y + along * np.float32(light[1]))
            free &= there <= over + np.float32(0.02 * self.height)
        return free

    def seen(self, view: F64) -> Indices:
        """(h · w,) which texel a camera sees at each texel of the plane at half height."""
        x, y = self._grid
        top = np.float32(1.2 * self.height)
        middle = np.float32(0.5 * self.height)
        tilt = view[:2] / max(float(view[2]), 0.05)
        at_x, at_y = x.copy(), y.copy()
        found = np.zeros(x.shape, np.bool_)
        for z in np.linspace(top, -0.5 * self.height, 2 * _STEPS, dtype=np.float32):
            px, py = x + (z - middle) * np.float32(tilt[0]), y + (z - middle) * np.float32(tilt[1])
            hit = ~found & (self.surface(px, py) >= z)
            at_x[hit], at_y[hit] = px[hit], py[hit]
            found |= hit
        n = self.texels
        column, row = np.floor(at_x * n).astype(np.intp) % n, np.floor((1 - at_y) * n).astype(np.intp) % n
        return np.asarray(row * n + column, np.intp).ravel()


class ClothBtf:
    """`Weave` under `directions` × `directions`. bits: 8 (sRGB, `full` becomes 255) or 0 (exact);
    `parallax`: off, and every texel stays where it is. `making`: seconds spent in making pictures."""

    def __init__(
        self,
        weave: Weave | None = None,
        directions: F64 | None = None,
        bits: int = 8,
        full: float = 0.8,
        parallax: bool = True,
    ) -> None:
        self.weave = weave or Weave()
        every = hemisphere_81() if directions is None else directions
        count = len(every)
        self.lights: F64 = np.tile(every, (count, 1))
        self.views: F64 = np.repeat(every, count, axis=0)
        self.size = self.weave.texels, self.weave.texels
        self.source = "synthetic"
        self.notes: tuple[str, ...] = ()
        self.making = 0.0
        self._bits, self._full, self._parallax = bits, full, parallax
        self._count = count
        self._lit: dict[int, Flags] = {}
        self._view: tuple[int, Indices, F32, F32, F32] | None = None

    def blocks(self, which: Indices) -> Iterator[Block]:
        """See `Btf`."""
        for part in parts(which, block_size(self.size)):
            started = time.perf_counter()
            made = [self.picture(int(i)) for i in part]
            values, clipped = (np.stack(one) for one in zip(*made, strict=True))
            self.making += time.perf_counter() - started
            yield Block(part, values, clipped if clipped.any() else None)

    def picture(self, index: int) -> tuple[F32, Flags]:
        """Linear light (h, w, 3) as the camera tells it, and where it is clipped."""
        light = self.exact(index)
        if not self._bits:
            return light, np.zeros(self.size, np.bool_)
        numbers = linear_to_srgb_fast(light / np.float32(self._full))
        return srgb_to_linear(numbers) * np.float32(self._full), (numbers == 255).any(axis=-1)

    def exact(self, index: int) -> F32:
        """Radiance (h, w, 3)."""
        which, v = index % self._count, index // self._count
        light, view = self.lights[index].astype(np.float32), self.views[index].astype(np.float32)
        place, normals, albedo, strength = self._seen(v)
        if which not in self._lit:
            self._lit[which] = self.weave.lit(self.lights[index]).ravel()
        nl = normals @ light
        nl = np.where((nl > 0) & self._lit[which][place], nl, np.float32(0))
        half = light + view
        half /= np.linalg.norm(half)
        exponent = np.float32(self.weave.shine[1])
        lobe = np.exp(exponent * np.log(np.maximum(normals @ half, np.float32(1e-3))))
        # Schlick's rim, for cloth has one
        rim = np.float32(1 + 4 * (1 - float(half @ view)) ** 5)
        lobe *= strength * np.float32((self.weave.shine[1] + 8) / 8) * rim
        made = (albedo + lobe[:, None]) * nl[:, None]
        return np.asarray(made.reshape(*self.size, 3), np.float32)

    def _seen(self, view: int) -> tuple[Indices, F32, F32, F32]:
        if self._view is None or self._view[0] != view:
            texels = self.weave.texels**2
            _, normals, albedo, strength = self.weave._colours
            place = np.arange(texels)
            if self._parallax:
                place = self.weave.seen(self.views[view * self._count])
            self._view = (
                *(view, place, normals.reshape(-1, 3)[place]),
                *(albedo.reshape(-1, 3)[place], strength.ravel()[place]),
            )
        return self._view[1:]


_TABLE = linear_to_srgb(np.linspace(0, 1, 1 << 15))


def linear_to_srgb_fast(light: F32) -> npt.NDArray[np.uint8]:
    """8-bit sRGB by a table of 32,768 steps."""
    at = np.clip(light * np.float32((1 << 15) - 1) + np.float32(0.5), 0, (1 << 15) - 1)
    return np.asarray(_TABLE[at.astype(np.uint16)], np.uint8)
