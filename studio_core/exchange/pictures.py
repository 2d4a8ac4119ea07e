"""Pictures that models name: found beside the model, decoded, reduced to what our materials use."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studio_core.errors import InputError
from studio_core.imaging.io import ImageDecoder
from studio_core.scene.geometry import Image

LEAST_SPREAD = 0.01  # of a channel that is more than noise about its mean


class Pictures:
    """Pictures that a model names, each read once; what cannot be read becomes a note."""

    def __init__(self, path: Path, say: Callable[[str], object]) -> None:
        self.folder = path.parent
        self._say = say
        self._decoder: ImageDecoder | None = None
        self._found: dict[object, Image | None] = {}

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *_: object) -> None:
        if self._decoder is not None:
            self._decoder.close()

    def file(self, name: str, *, plain: bool = False) -> Image | None:
        """The picture of that name near the model; `plain`: of numbers that are no colours."""
        found = beside(self.folder, name)
        if found is None:
            self._say(f"The picture {name!r} is missing; its surface has a plain colour.")
            return None
        return self._once((found, plain), lambda decoder: decoder.read(found, plain=plain))

    def data(self, key: object, data: bytes, name: str, *, plain: bool = False) -> Image | None:
        """The picture in bytes of the model itself; equal keys are one picture. `plain` as above."""
        return self._once((key, plain), lambda decoder: decoder.decode(data, name, plain=plain))

    def _once(self, key: object, read: Callable[[ImageDecoder], Image]) -> Image | None:
        if key not in self._found:
            if self._decoder is None:
                self._decoder = ImageDecoder()
            try:
                self._found[key] = read(self._decoder)
            except InputError as error:
                self._found[key] = None
                self._say(f"{error}.")
        return self._found[key]


def opaque(image: Image) -> Image:
    """The picture in red, green and blue alone."""
    if image.pixels.shape[2] == 3:
        return image
    wanted = [0, 0, 0] if image.pixels.shape[2] == 1 else [0, 1, 2]
    return replace(image, pixels=image.pixels[:, :, wanted])


def channel_of(image: Image, channel: int) -> Image | None:
    """One channel as plain numbers (no transfer curve), grey has all; None where it is the same all over."""
    chosen = min(channel, image.pixels.shape[2] - 1)
    pixels = image.pixels[:, :, chosen : chosen + 1]
    scale = 255.0 if pixels.dtype == np.uint8 else 1.0
    if float(pixels.std(dtype=np.float64)) < LEAST_SPREAD * scale:
        return None
    return Image(pixels, "data")


def mean_of(image: Image, channel: int) -> float:
    """Mean of a channel as plain numbers in 0…1 (no transfer curve); grey has all channels."""
    chosen = image.pixels[:, :, min(channel, image.pixels.shape[2] - 1)]
    scale = 255.0 if image.pixels.dtype == np.uint8 else 1.0
    return float(np.clip(chosen.astype(np.float64) / scale, 0, 1).mean())


def beside(folder: Path, name: str) -> Path | None:
    """The file that a model in `folder` calls `name`: any slashes, any case, no farther than the parent.

    A path of another machine is looked for by its last part.
    """
    cleaned = name.strip().strip('"').replace("\\", "/")
    if not cleaned or "\0" in cleaned or len(cleaned) > 4096:
        return None
    reach = folder.resolve()
    if reach.parent != reach.parent.parent:  # never the whole disk
        reach = reach.parent
    tries = [cleaned, cleaned.rsplit("/", 1)[-1]]
    if cleaned.startswith("/") or re.match(r"[A-Za-z]:", cleaned):
        del tries[0]
    for attempt in tries:
        try:
            found = _any_case(folder, attempt)
            if found is not None and found.is_file() and found.resolve().is_relative_to(reach):
                return found
        except (OSError, ValueError, RuntimeError):
            continue
    return None


def _any_case(folder: Path, name: str) -> Path | None:
    direct = folder / name
    if direct.is_file():
        return direct
    at = folder
    for piece in name.split("/"):
        if piece in ("", "."):
            continue
        if piece == "..":
            at = at / piece
            continue
        names = {entry.name.lower(): entry.name for entry in os.scandir(at)} if at.is_dir() else {}
        if piece.lower() not in names:
            return None
        at = at / names[piece.lower()]
    return at
