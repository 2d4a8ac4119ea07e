"""From a photograph's numbers to exposure and its noise, by tables for whole numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Response

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Look = Callable[[npt.NDArray[Any]], F32]


class Numbers:
    """A response to be looked up. Exposure is 1 at the middle level and 0 at and under black."""

    def __init__(self, response: Response) -> None:
        self.response = response
        self.top = response.top
        self._tables: dict[int, tuple[F32, F32, F32]] = {}

    def light(self, pixels: npt.NDArray[Any]) -> F32:
        """(..., 3) exposure of numbers, uint8, uint16 or float32 (linear)."""
        if pixels.dtype == np.float32:
            return self._linear(pixels)
        return _looked_up(pixels, self._table(pixels.dtype)[0])

    def variance(self, pixels: npt.NDArray[Any]) -> F32:
        """(..., 3) variance of that exposure; > 0."""
        if pixels.dtype == np.float32:
            _, slope, _ = self._straight()
            light = self._linear(pixels)
            compression, reading, photons = self.response.noise
            light *= np.float32(photons)
            light += (compression / slope**2 + reading).astype(np.float32)
            return np.maximum(light, np.float32(1e-14), out=light)
        return _looked_up(pixels, self._table(pixels.dtype)[1])

    def weighing(self, dtype: npt.DTypeLike, gain: npt.NDArray[Any]) -> tuple[Look, Look]:
        """Functions from numbers to light = exposure · gain (3,), and to 1 / its variance."""
        if np.dtype(dtype) == np.float32:
            own = gain.astype(np.float32)
            return (lambda n: self.light(n) * own), (lambda n: np.reciprocal(self.variance(n) * own**2))
        exposure, variance, _ = self._table(dtype)
        light, weight = exposure * gain, 1 / (variance * gain**2)
        return (lambda n: _looked_up(n, light)), (lambda n: _looked_up(n, weight))

    def stubborn(self, pixels: npt.NDArray[Any], least: float = 0.0) -> F32:
        """(..., 3) the part of that variance which neighbours share: rounding and compression.

        `least`: of bytes, the least standard deviation that compression has, of numbers 0 … 1.
        """
        if pixels.dtype == np.uint8:
            factor = max(least**2 / self.response.noise[0], 1.0)
            return _looked_up(pixels, self._table(pixels.dtype)[2] * np.float32(factor))
        if pixels.dtype == np.float32:
            _, slope, _ = self._straight()
            part = (self.response.noise[0] / slope**2).astype(np.float32)
            return np.broadcast_to(part, pixels.shape)
        return _looked_up(pixels, self._table(pixels.dtype)[2])

    def clipped(self, pixels: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
        """(H, W) 255 where any channel is clipped or no number, else 0."""
        made = np.zeros(pixels.shape[:2], np.bool_)
        for channel in range(3):
            # what is no number compares false
            made |= ~(pixels[..., channel] < self._white(pixels.dtype, channel))
        return made.astype(np.uint8) * np.uint8(255)

    def _white(self, dtype: npt.DTypeLike, channel: int) -> Any:
        white = self.response.white[channel]
        return np.float32(white) if np.dtype(dtype) == np.float32 else int(np.ceil(white))

    def _straight(self) -> tuple[F64, F64, F64]:
        """Exposure per number, dn / dE (n in 0 … 1) and black, of linear numbers."""
        black = np.asarray(self.response.black)
        per_number = 1 / (self.top / 2 - black)
        return per_number, 1 / (per_number * self.top), black

    def _linear(self, pixels: npt.NDArray[Any]) -> F32:
        per_number, _, black = self._straight()
        made: F32 = np.nan_to_num(pixels, nan=0.0, posinf=self.top, neginf=0.0)
        made -= black.astype(np.float32)
        np.maximum(made, np.float32(0), out=made)
        made *= per_number.astype(np.float32)
        return made

    def _table(self, dtype: npt.DTypeLike) -> tuple[F32, F32, F32]:
        """(N, 3) exposure, its variance, and the stubborn part of that, of every whole number."""
        size = int(np.iinfo(dtype).max) + 1
        if size not in self._tables:
            number = np.linspace(0.0, self.top, size)
            made = np.empty((3, size, 3), np.float32)
            for c in range(3):
                made[:, :, c] = self._channel(number, c)
            self._tables[size] = made[0], made[1], made[2]
        return self._tables[size]

    def _channel(self, number: F64, channel: int) -> tuple[F64, F64, F64]:
        curve, black = self.response.curve[channel], self.response.black[channel]
        level = np.linspace(0, self.top, len(curve))
        if self.response.linear:
            light = np.maximum(number - black, 0) / (self.top / 2 - black)
        else:
            light = np.interp(number, level, np.exp2(curve))
            light[number <= black] = 0.0
        step = self.top / 255  # differences over less follow the steps between levels
        low, high = np.maximum(number - step / 2, 0), np.minimum(number + step / 2, self.top)
        rise = np.maximum(np.interp(high, number, light) - np.interp(low, number, light), 1e-9)
        slope = rise / ((high - low) / self.top)  # dE / dn
        compression, reading, photons = self.response.noise
        stubborn = np.maximum(compression * slope**2, 1e-14)
        return light, stubborn + reading + photons * light, stubborn


def _looked_up(pixels: npt.NDArray[Any], table: npt.NDArray[Any]) -> F32:
    if pixels.dtype == np.uint8:
        import cv2

        return np.asarray(cv2.LUT(pixels, table[None]), np.float32)
    return np.stack([table[:, c][pixels[..., c]] for c in range(3)], axis=-1)
