"""A little camera for tests of radiometry: a known light, a known curve, noise, numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Bracket, Motion
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.warping import moved_points

F64 = npt.NDArray[np.float64]


def srgb(x: F64) -> F64:
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def footed(gamma: float) -> Callable[[F64], F64]:
    """A power with a straight foot."""

    def encode(x: F64) -> F64:
        foot = 0.004
        slope = foot ** (1 / gamma - 1) / gamma
        start = foot ** (1 / gamma) - slope * foot
        made = np.where(x < foot, slope * x, np.maximum(x, foot) ** (1 / gamma) - start)
        return np.asarray(made / (1 - start))

    return encode


def s_shaped(gamma: float, contrast: float) -> Callable[[F64], F64]:
    def encode(x: F64) -> F64:
        y = footed(gamma)(x)
        return np.asarray((1 - contrast) * y + contrast * y * y * (3 - 2 * y))

    return encode


FAMILIES: dict[str, tuple[Callable[[F64], F64], ...]] = {
    "sRGB": (srgb,) * 3,
    "gamma 1.8": (footed(1.8),) * 3,
    "gamma 2.6": (footed(2.6),) * 3,
    "film": (s_shaped(2.2, 0.5),) * 3,
    "a colour each": (s_shaped(2.2, 0.3), s_shaped(2.0, 0.15), s_shaped(2.4, 0.4)),
}


@dataclass(frozen=True)
class Camera:
    """`curve` by channel from exposure 0 … 1 to numbers; `floor` and `ceiling` of the numbers, 0 … 1."""

    curve: tuple[Callable[[F64], F64], ...] = FAMILIES["sRGB"]
    bits: int = 8
    electrons: float = 8000.0
    reading: float = 4.0
    floor: float = 0.0
    ceiling: float = 1.0
    jpeg: int | None = None

    def shoot(self, light: F64, ev: float, seed: int) -> npt.NDArray[Any]:
        rng = np.random.default_rng(seed)
        exposure = light * 2.0**ev
        if self.electrons:
            mean = np.minimum(exposure, 2.0) * self.electrons
            exposure = (rng.poisson(mean) + rng.normal(0, self.reading, light.shape)) / self.electrons
        made = np.stack([self.curve[c](np.clip(exposure[..., c], 0, 1)) for c in range(3)], axis=-1)
        made = np.minimum(self.floor + (1 - self.floor) * made, self.ceiling)
        if self.bits == 32:
            return made.astype(np.float32)
        if self.bits == 16:
            return np.rint(made * 65535).astype(np.uint16)
        numbers = np.rint(made * 255).astype(np.uint8)
        return numbers if self.jpeg is None else _through_jpeg(numbers, self.jpeg)

    def truth(self, levels: int, number: F64) -> F64:
        """(3, N) log2 exposure of numbers, 0 at one half."""
        dense = np.linspace(0, 1, 1 << 16) ** 3
        made = []
        for curve in self.curve:
            shown = self.floor + (1 - self.floor) * curve(dense)
            at = np.interp([0.5], shown, dense)
            made.append(np.log2(np.maximum(np.interp(number, shown, dense), 1e-9) / at))
        return np.array(made)


def _through_jpeg(numbers: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    import cv2

    _, code = cv2.imencode(".jpg", numbers[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    made: npt.NDArray[np.uint8] = np.ascontiguousarray(cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1])
    return made


def room(seed: int, width: int = 320, height: int = 240, stops: float = 10.0) -> F64:
    """Light (H, W, 3) of flat and shaded things, texture, and lamps: about `stops` from dark to bright."""
    import cv2

    rng = np.random.default_rng(seed)
    made = np.full((height, width, 3), 0.15)
    y, x = np.mgrid[0:height, 0:width]
    for _ in range(70):
        level = 2.0 ** rng.uniform(-stops * 0.65, stops * 0.35) * 0.15
        colour = level * rng.uniform(0.5, 1.5, 3)
        corner = rng.integers(0, [width, height])
        size = rng.integers([width // 16, height // 16], [width // 3, height // 3])
        inside = (abs(x - corner[0]) < size[0] / 2) & (abs(y - corner[1]) < size[1] / 2)
        shade = 1 + rng.uniform(-0.5, 0.5) * (x - corner[0]) / size[0]
        made[inside] = (colour * shade[..., None])[inside]
    texture = cv2.GaussianBlur(rng.normal(0, 1, (height, width)), (0, 0), 2.0)
    made *= np.exp(0.3 * texture * (rng.uniform(size=(1, width)) < 0.3))[..., None]
    for _ in range(3):
        centre = rng.integers([width // 8, height // 8], [7 * width // 8, 7 * height // 8])
        made[np.hypot(x - centre[0], y - centre[1]) < width / 60] = 0.15 * 2.0 ** (stops * 0.5)
    return np.asarray(cv2.GaussianBlur(made, (0, 0), 0.7))


def moved(light: F64, motion: Motion) -> F64:
    """The light as a frame with this motion shows it."""
    import cv2

    height, width = light.shape[:2]
    back = Motion(-motion.dx, -motion.dy, -motion.degrees)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    at = moved_points(
        np.stack([x, y], axis=-1) - (motion.dx, motion.dy), Motion(degrees=back.degrees), (width, height)
    )
    at = at.astype(np.float32) - np.float32(0.5)
    return np.asarray(
        cv2.remap(light, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE).clip(0)
    )


def bracket(frames: Sequence[npt.NDArray[Any]], listed: Sequence[float], certain: bool = True) -> Bracket:
    shots = tuple(Photograph(frame, ShotFacts(f"shot {i + 1}"), f"{i}") for i, frame in enumerate(frames))
    return Bracket(shots, tuple(listed), (certain,) * len(shots))


def taken(
    camera: Camera, light: F64, evs: Sequence[float], listed: Sequence[float] | None = None, seed: int = 0
) -> Bracket:
    frames = [camera.shoot(light, ev, seed * 100 + i) for i, ev in enumerate(evs)]
    return bracket(frames, listed or evs)
