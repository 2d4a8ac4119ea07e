"""How alike the light along receivers' rays is then and now: what an error then says about the error now.

Rays of a receiver stay, so the light along ray j then, a_j, and now, b_j, are samples of the same place of
their sum. Where b is a multiple of a, the errors of both sums are the same share of them; where b has nothing
to do with a, neither have the errors. Between these the correlation

    ρ = Σ (a_j − ā)(b_j − b̄) / √(Σ (a_j − ā)² Σ (b_j − b̄)²)

tells how much of the error is still the same (as of control variates, Owen 2013, chapter 8.9), whatever it
was that changed: an object, a lamp, the sky, a colour.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]

EVEN = np.float32(1e-6)
"""Variance of light in squares of its mean below which it counts as the same along all rays."""


class Likeness:
    """Hears of the light along one kind of rays: compares it with what it was, keeps it, or both.

    `of` (V,) is ρ, at least 0: 0 where nothing is known of then, where either light was the same along all
    rays, and for other numbers of rays; −1 where nothing was told. `packed` (C, N), by the places of
    `keep_at`, is the light now.
    """

    def __init__(
        self, rays: int, then: U8 | None, then_at: I32 | None, keep_at: I32 | None, vertices: int
    ) -> None:
        """Light `then` (B, rays), packed; then_at, keep_at (V,) are places of vertices, or −1."""
        self.of: F32 = np.full(vertices, -1, np.float32)
        kept = 0 if keep_at is None else int(keep_at.max(initial=-1)) + 1
        self.packed: U8 = np.zeros((kept, rays), np.uint8)
        self._keep_at, self._then_at = keep_at, then_at
        self._then = then if then is not None and then.shape[1] == rays else None

    def __call__(self, vertices: I64, light: F32) -> None:
        """The light (C, N) along the rays of some vertices; any thread may tell."""
        if self._then is not None and self._then_at is not None:
            correlate(vertices, light, self._then, self._then_at, self.of)
        else:
            self.of[vertices] = 0
        if self._keep_at is not None:
            pack_light(vertices, light, self._keep_at, self.packed)


@kernel
def pack_light(vertices: I64, light: F32, place_of: I32, out: U8) -> None:
    """Rows of out at the vertices' places: 255 √(light / the most of its row), of light (C, N)."""
    for i in range(len(vertices)):
        place = place_of[vertices[i]]
        most = np.float32(0)
        for j in range(light.shape[1]):
            most = max(most, light[i, j])
        if place >= 0 and most > 0:
            for j in range(light.shape[1]):
                out[place, j] = np.uint8(np.sqrt(max(light[i, j], np.float32(0)) / most) * 255 + 0.5)


@kernel
def correlate(vertices: I64, light: F32, then: U8, place_of: I32, out: F32) -> None:
    """out (V,) of vertices (C,): ρ of light (C, N) and the squares of `then` (B, N) at their places."""
    many = light.shape[1]
    zero, each = np.float32(0), np.float32(1 / many)
    for i in range(len(vertices)):
        place = place_of[vertices[i]]
        out[vertices[i]] = zero
        if place < 0:
            continue
        a_mean, b_mean = zero, zero
        for j in range(many):
            a = np.float32(then[place, j])
            a_mean += a * a
            b_mean += light[i, j]
        a_mean, b_mean = a_mean * each, b_mean * each
        aa, bb, ab = zero, zero, zero
        for j in range(many):
            a, b = np.float32(then[place, j]), light[i, j] - b_mean
            a = a * a - a_mean
            aa += a * a
            bb += b * b
            ab += a * b
        if aa > EVEN * many * a_mean * a_mean and bb > EVEN * many * b_mean * b_mean:
            out[vertices[i]] = min(max(ab / (np.sqrt(aa) * np.sqrt(bb)), zero), np.float32(1))
