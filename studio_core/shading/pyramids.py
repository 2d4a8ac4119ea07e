"""Mip levels of pictures as kernels read them: halved down to one texel, rows from v = 0 up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

LEVELS = 12


@dataclass(eq=False)
class Pyramid:
    """Levels (h, w, C) from the finest, and the least and largest value of each channel.

    Once stored, the levels are views of the one array that kernels read.
    """

    levels: tuple[F32, ...]
    low: F32
    high: F32


def pyramid(base: F32) -> Pyramid:
    """Halved down to one texel, at most LEVELS times."""
    level = np.ascontiguousarray(base)
    levels = [level]
    while max(level.shape[:2]) > 1 and len(levels) < LEVELS:
        height, width = max(level.shape[0] // 2, 1), max(level.shape[1] // 2, 1)
        y, x = level.shape[0] // height, level.shape[1] // width
        cut = level[: height * y, : width * x].reshape(height, y, width, x, level.shape[2])
        level = cut.mean(axis=(1, 3), dtype=np.float32)
        levels.append(level)
    return Pyramid(tuple(levels), base.min(axis=(0, 1)), base.max(axis=(0, 1)))


def joined(pyramids: Sequence[Pyramid], channels: int) -> tuple[F32, list[int]]:
    """All levels of some pyramids as rows (R, channels), and where each pyramid starts."""
    rows = [_columns(level, channels) for one in pyramids for level in one.levels]
    lengths = [sum(level.shape[0] * level.shape[1] for level in one.levels) for one in pyramids]
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64).tolist()[:-1]
    every = np.concatenate(rows) if rows else np.zeros((1, channels), np.float32)
    for one, start in zip(pyramids, starts, strict=True):
        one.levels = _views(every, start, one.levels)
    return every, starts


def lay_out(one: Pyramid, start: int, first: I64, size: I64) -> None:
    """Fills in where levels of a stored pyramid begin, first (LEVELS,), and their (height, width), size."""
    for level, values in enumerate(one.levels):
        first[level], size[level] = start, values.shape[:2]
        start += values.shape[0] * values.shape[1]


def _columns(level: F32, channels: int) -> F32:
    """A level as rows of as many channels as the material with most terms has."""
    own = level.reshape(-1, level.shape[2])
    if own.shape[1] == channels:
        return own
    made = np.zeros((len(own), channels), np.float32)
    made[:, : own.shape[1]] = own[:, :channels]
    return made


def _views(rows: F32, start: int, levels: tuple[F32, ...]) -> tuple[F32, ...]:
    """The same levels as parts of the rows that they were joined to."""
    made = []
    for level in levels:
        stop = start + level.shape[0] * level.shape[1]
        made.append(rows[start:stop].reshape(*level.shape[:2], rows.shape[1]))
        start = stop
    return tuple(made)


__all__ = ["LEVELS", "Pyramid", "joined", "lay_out", "pyramid"]
