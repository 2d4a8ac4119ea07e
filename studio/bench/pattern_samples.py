"""Small samples of surfaces, none of which tiles: woven cloth, marble, bricks, felt. (N, N, 3) in 0 … 1."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]


def waves(rng: np.random.Generator, size: int, slope: float, low: float = 1.0) -> npt.NDArray[np.float64]:
    """Noise (N, N), mean 0 and spread 1, its amplitudes as frequency^−slope; cut from a larger one."""
    whole = 2 * size
    fy, fx = np.meshgrid(np.fft.fftfreq(whole) * whole, np.fft.rfftfreq(whole) * whole, indexing="ij")
    f = np.hypot(fy, fx)
    amplitude = np.where(f >= low, np.maximum(f, 1e-9) ** -slope, 0)
    noise = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((whole, whole))) * amplitude, (whole, whole))
    cut = noise[:size, :size]
    return np.asarray((cut - cut.mean()) / cut.std())


def weave(size: int = 256, period: float = 16.0, seed: int = 0) -> F32:
    """Plain weave: threads over and under each other, each of its own shade."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size].astype(float)
    i, j = np.floor(2 * x / period).astype(int), np.floor(2 * y / period).astype(int)
    u, v = (2 * x / period) % 1 - 0.5, (2 * y / period) % 1 - 0.5
    over = (i + j) % 2 == 0
    across = np.where(over, u, v)
    along = np.where(over, v, u)
    shade = np.cos(np.pi * across) * (0.7 + 0.3 * np.cos(np.pi * along))
    warp, weft = (1 + 0.06 * rng.standard_normal((2, 400))).reshape(2, 400)
    shade *= np.where(over, warp[i], weft[j]) * (1 + 0.03 * rng.standard_normal((size, size)))
    colour = np.where(over[..., None], (0.55, 0.2, 0.15), (0.75, 0.6, 0.4))
    return np.asarray(np.clip(colour * shade[..., None], 0, 1).astype(np.float32))


def marble(size: int = 256, seed: int = 0) -> F32:
    """Dark veins through light stone."""
    rng = np.random.default_rng(seed)
    clouds = waves(rng, size, 1.6, 3.0)
    veins = np.exp(-12 * np.abs(waves(rng, size, 1.7, 4.0)))
    made = 0.8 + 0.05 * clouds - 0.45 * veins
    return np.asarray(np.clip(made[..., None] * (1.0, 0.97, 0.92), 0, 1).astype(np.float32))


def bricks(size: int = 256, length: int = 64, height: int = 24, seed: int = 0) -> F32:
    """Rows of bricks, each moved by half a brick and of its own shade, with mortar between."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    row = y // height
    moved = x + (row % 2) * (length // 2)
    column = moved // length
    mortar = ((y % height) < 3) | ((moved % length) < 3)
    shade = (0.45 + 0.06 * rng.standard_normal((99, 99)))[row, column] + 0.02 * waves(rng, size, 0.6)
    brick = shade[..., None] * (1.0, 0.55, 0.4)
    made = np.where(mortar[..., None], 0.6 + 0.02 * waves(rng, size, 0.3)[..., None], brick)
    return np.asarray(np.clip(made, 0, 1).astype(np.float32))


def felt(size: int = 256, seed: int = 0) -> F32:
    """Short fibres in all directions."""
    rng = np.random.default_rng(seed)
    made = np.zeros((size, size))
    t = np.arange(-12, 13)
    for _ in range(size * size // 40):
        y, x, angle, bend = *rng.uniform(0, size, 2), rng.uniform(0, np.pi), rng.normal(0, 0.02)
        turn = angle + bend * t
        rows, columns = np.rint(y + t * np.sin(turn)).astype(int), np.rint(x + t * np.cos(turn)).astype(int)
        inside = (rows >= 0) & (rows < size) & (columns >= 0) & (columns < size)
        made[rows[inside], columns[inside]] += rng.uniform(0.5, 1.0)
    made = 0.3 + 0.06 * (made - made.mean()) / made.std()
    return np.asarray(np.clip(made[..., None] * (0.9, 1.0, 0.8), 0, 1).astype(np.float32))


SAMPLES: Mapping[str, Callable[[], F32]] = {"weave": weave, "marble": marble, "bricks": bricks, "felt": felt}
