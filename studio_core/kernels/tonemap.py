"""From scene-linear light to what a display is sent: exposure, a curve, 8 bits.

`srgb` is colour-true: the display shows the radiance itself, up to where it clips. `filmic` bends highlights
like the ACES reference rendering (Stephen Hill's fit of RRT and ODT, BakingLab 2016). `raw` writes the
linear numbers without the display's curve.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

Kind = Literal["srgb", "filmic", "raw"]
KINDS: tuple[str, ...] = get_args(Kind)
LABELS = {"srgb": "Colour-true (sRGB)", "filmic": "Filmic (ACES)", "raw": "Raw (linear)"}

THUMBNAIL = 1 << 16  # pixels: up to here NumPy is quick enough, and no compiler need be loaded
_STEPS = 1 << 16  # entries of a curve's table: 0.05 of an 8-bit step where sRGB is steepest
_BLOCK = 1 << 14  # pixels at a time: stays in the cache
TO_FILM = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]], np.float32
)
FROM_FILM = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]], np.float32
)
_NO_FILM = np.zeros((0, 3), np.float32)


def tonemap(
    linear: npt.NDArray[np.floating[Any]], exposure: float = 0.0, kind: str = "srgb"
) -> npt.NDArray[np.uint8]:
    """8-bit (H, W, 3) of scene-linear Rec.709 (H, W, 3), made 2^exposure times brighter first.

    NaN and negative light give 0, infinite light gives 255. Raises ValueError for an unknown `kind`.
    """
    if kind not in KINDS:
        raise ValueError(f"there is no view {kind!r}; known: {', '.join(KINDS)}")
    flat = np.ascontiguousarray(linear, np.float32).reshape(-1, 3)
    made = np.empty(flat.shape, np.uint8)
    table = _table(kind == "raw")
    gain = np.float32(2.0**exposure)
    if len(flat) > THUMBNAIL:
        from studio_core.kernels.display import display

        bend = (TO_FILM, FROM_FILM) if kind == "filmic" else (_NO_FILM, _NO_FILM)
        display(flat, gain, *bend, table, made)
        return made.reshape(linear.shape)
    for start in range(0, len(flat), _BLOCK):
        light = flat[start : start + _BLOCK] * gain
        if kind == "filmic":
            light = film(light)
        # fmax and fmin drop NaN; the cast rounds
        np.fmin(np.fmax(light, np.float32(0), out=light), np.float32(1), out=light)
        light *= np.float32(_STEPS - 1)
        light += np.float32(0.5)
        np.take(table, light.astype(np.uint16), out=made[start : start + _BLOCK], mode="clip")
    return made.reshape(linear.shape)


def tonemap16(
    linear: npt.NDArray[np.floating[Any]], exposure: float = 0.0, kind: str = "srgb"
) -> npt.NDArray[np.uint16]:
    """The same with 16 bits: for pictures that somebody will grade or print."""
    if kind not in KINDS:
        raise ValueError(f"there is no view {kind!r}; known: {', '.join(KINDS)}")
    flat = np.ascontiguousarray(linear, np.float32).reshape(-1, 3)
    made = np.empty(flat.shape, np.uint16)
    for start in range(0, len(flat), _BLOCK):
        made[start : start + _BLOCK] = np.rint(65535 * shown(flat[start : start + _BLOCK], exposure, kind))
    return made.reshape(linear.shape)


def shown(linear: npt.NDArray[np.float32], exposure: float, kind: str) -> npt.NDArray[Any]:
    """(N, 3) what a display is sent, 0 … 1, of light (N, 3) in one of the `KINDS`."""
    light = linear * np.float32(2.0**exposure)
    if kind == "filmic":
        light = film(light)
    np.fmin(np.fmax(light, np.float32(0), out=light), np.float32(1), out=light)
    return _curve(light, kind == "raw")


def prepare() -> None:
    """Compiles or loads the kernel, on a thread that may take its time, before a window shows a picture."""
    tonemap(np.zeros((1, THUMBNAIL + 1, 3), np.float32))


def film(light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Hill's fit, (N, 3) linear Rec.709 to display-linear Rec.709, below 0 and above 1 too."""
    clipped = np.fmin(np.fmax(light, np.float32(0)), np.float32(1e6))
    x = clipped @ TO_FILM.T
    bent = (x * (x + np.float32(0.0245786)) - np.float32(0.000090537)) / (
        x * (np.float32(0.983729) * x + np.float32(0.4329510)) + np.float32(0.238081)
    )
    return np.asarray(bent @ FROM_FILM.T, np.float32)


@cache
def _table(raw: bool) -> npt.NDArray[np.uint8]:
    """(65536,) the byte of each linear value 0…1: plain, or through the sRGB curve (IEC 61966-2-1)."""
    made: npt.NDArray[np.uint8] = np.rint(_curve(np.arange(_STEPS) / (_STEPS - 1), raw) * 255).astype(
        np.uint8
    )
    return made


def _curve(x: npt.NDArray[Any], raw: bool) -> npt.NDArray[Any]:
    """Display values 0 … 1 of linear ones."""
    return x if raw else np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055)
