"""Writing pictures: PNG, OpenEXR and Radiance files, and their bytes for the project file.

A file appears whole or not at all: it is written beside its place, then put there.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.rows import Numbers, RowWriter

Pixels = npt.NDArray[Any]
_NAMES = {1: ("Y",), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}


def write_png(path: str | os.PathLike[str], pixels: Pixels) -> None:
    """Write uint8 (H, W, 1, 3 or 4), sRGB with straight alpha. InputError when the disk refuses."""
    _write(Path(path), ".png", _bytes_of(pixels), _NAMES[pixels.shape[2]], {"oiio:UnassociatedAlpha": 1})


def write_hdr(path: str | os.PathLike[str], pixels: Pixels) -> None:
    """Write radiance (H, W, 1 or 3) as Radiance RGBE; below 0 becomes 0. InputError likewise."""
    colour = np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[:, :, :3]
    _write(Path(path), ".hdr", np.maximum(colour.astype(np.float32), 0), _NAMES[3], {})


def write_exr(
    path: str | os.PathLike[str],
    layers: Pixels | Mapping[str, Pixels],
    metadata: Mapping[str, str | float | int] | None = None,
) -> None:
    """Write float32 OpenEXR, lossless: one picture, or several of one size as layers by name.

    A layer of name "" holds the channels R, G, B, A; others are called `name.R` and so on. ValueError
    when the layers differ in size; InputError when the disk refuses.
    """
    parts = layers if isinstance(layers, Mapping) else {"": layers}
    if len({picture.shape[:2] for picture in parts.values()}) != 1:
        raise ValueError("the layers of a picture must have one size")
    names = tuple(
        f"{layer}.{channel}" if layer else channel
        for layer, picture in parts.items()
        for channel in _NAMES[picture.shape[2]]
    )
    stacked = np.concatenate([np.asarray(p, dtype=np.float32) for p in parts.values()], axis=2)
    _write(Path(path), ".exr", stacked, names, {"compression": "zip", **(metadata or {})})


def encode_png(pixels: Pixels) -> bytes:
    """The bytes of a PNG file of uint8 (H, W, 1, 3 or 4): what `write_png` writes."""
    return _encode(".png", lambda path: write_png(path, pixels))


def encode_exr(pixels: Pixels) -> bytes:
    """The bytes of an OpenEXR file of float32 (H, W, 1, 3 or 4), bit for bit."""
    return _encode(".exr", lambda path: write_exr(path, pixels))


def _encode(suffix: str, write: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
        path = Path(folder) / f"picture{suffix}"
        write(path)
        return path.read_bytes()


def _bytes_of(pixels: Pixels) -> Pixels:
    if pixels.dtype != np.uint8:
        raise ValueError("PNG files are written from bytes")
    return pixels


def _write(
    path: Path, suffix: str, pixels: Pixels, names: tuple[str, ...], metadata: Mapping[str, str | float | int]
) -> None:
    height, width, _ = pixels.shape
    numbers: Numbers = "uint8" if pixels.dtype == np.uint8 else "float"
    with RowWriter(path, width, height, names, numbers, metadata, suffix=suffix) as rows:
        rows.write(pixels)
