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


class Likeness:
    """Hears of the light along one kind of rays: compares it with what it was, keeps it, or both.

    `of` (V,) is ρ, at least 0: 0 where nothing is known of then, where either light was the same along all
    rays, and for other numbers of rays. `packed` (C, N), by the places of `keep_at`, is the light now.
    """

    def __init__(
        self, rays: int, then: U8 | None, then_at: I32 | None, keep_at: I32 | None, vertices: int
    ) -> None:
        """Light `then` (B, rays), packed; then_at, keep_at (V,) are places of vertices, or −1."""
        self.of: F32 = np.zeros(vertices, np.float32)
        kept = 0 if keep_at is None else int(keep_at.max(initial=-1)) + 1
        self.packed: U8 = np.zeros((kept, rays), np.uint8)
        self._keep_at = keep_at
        self._then, self._then_at = then, then_at
        if then is not None and then.shape[1] != rays:
            self._then = None

    def __call__(self, vertices: I64, light: F32) -> None:
        """The light (C, N) along the rays of some vertices; any thread may tell."""
        if self._then is not None and self._then_at is not None:
            correlate(vertices, light, self._then, self._then_at, self.of)
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
    """out (V,) of vertices (C,) that have a place: ρ of light (C, N) and the squares of `then` there."""
    many = light.shape[1]
    for i in range(len(vertices)):
        place = place_of[vertices[i]]
        if place < 0:
            continue
        a_sum, b_sum, aa, bb, ab = 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(many):
            a, b = float(then[place, j]), float(light[i, j])
            a *= a
            a_sum += a
            b_sum += b
            aa += a * a
            bb += b * b
            ab += a * b
        one, other = aa - a_sum * a_sum / many, bb - b_sum * b_sum / many
        if one > 1e-9 * aa and other > 1e-9 * bb:
            out[vertices[i]] = min(max((ab - a_sum * b_sum / many) / np.sqrt(one * other), 0.0), 1.0)
