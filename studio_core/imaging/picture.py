"""Rendered pictures as files: scene-linear EXR, or PNG as the display shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.rows import Facts, Numbers, RowWriter
from studio_core.kernels.tonemap import Kind, tonemap, tonemap16

F32 = npt.NDArray[np.float32]
SUFFIXES = (".png", ".exr")


@dataclass(frozen=True)
class Finish:
    """How linear light becomes a file.

    exposure (EV) and tonemap act on PNG alone; depth is 8 or 16 bits a channel there, and 16 or 32 in EXR
    (0: 8 in PNG, 32 in EXR). dpi: dots per inch that the file names; 0: none.
    """

    exposure: float = 0.0
    tonemap: Kind = "srgb"
    depth: int = 0
    dpi: float = 0.0


class PictureFile:
    """A picture that is written from the top down in bands; see `RowWriter`.

    `lights` are the names of further layers of an EXR, (h, W, 3) each. InputError where the name's suffix or
    the depth is none that there is, or PNG is to have layers.
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        finish: Finish | None = None,
        *,
        alpha: bool = False,
        lights: tuple[str, ...] = (),
        facts: Facts | None = None,
    ) -> None:
        self.finish, self.alpha, self.lights = finish or Finish(), alpha, lights
        self._linear = path.suffix.lower() == ".exr"
        numbers = check_finish(path, self.finish, bool(lights))
        names = ("R", "G", "B", "A") if alpha else ("R", "G", "B")
        layers = tuple(f"{light}.{channel}" for light in channel_names(lights) for channel in "RGB")
        told: dict[str, str | float | int] = {"Software": "Lucarne Studio", **(facts or {})}
        if self._linear:
            told["compression"] = "zip"
        elif alpha:
            told["oiio:UnassociatedAlpha"] = 1
        if self.finish.dpi:
            told |= {"XResolution": self.finish.dpi, "YResolution": self.finish.dpi, "ResolutionUnit": "in"}
        self._rows = RowWriter(path, *size, names + layers, numbers, told)

    def __enter__(self) -> PictureFile:
        self._rows.__enter__()
        return self

    def __exit__(self, *problem: Any) -> None:
        self._rows.__exit__(*problem)

    def write(self, linear: F32, alpha: F32 | None = None, lights: Mapping[str, F32] | None = None) -> None:
        """The next rows (h, W, 3), premultiplied where there is alpha (h, W); `lights` by name."""
        if (alpha is not None) != self.alpha or set(lights or ()) != set(self.lights):
            raise ValueError("a band has other layers than its picture")
        if self._linear:
            layers = [linear] if alpha is None else [linear, alpha[:, :, None]]
            layers += [(lights or {})[name] for name in self.lights]
            self._rows.write(np.concatenate(layers, axis=2))
        else:
            self._rows.write(displayed(linear, self.finish, alpha))


def displayed(linear: F32, finish: Finish, alpha: F32 | None = None) -> npt.NDArray[Any]:
    """What a PNG holds of linear (h, W, 3): 8 or 16 bits, with straight alpha where there is any."""
    wide = finish.depth == 16
    if alpha is None:
        show = tonemap16 if wide else tonemap
        made: npt.NDArray[Any] = show(linear, finish.exposure, finish.tonemap)
        return made
    straight = np.divide(linear, alpha[:, :, None], out=np.zeros_like(linear), where=alpha[:, :, None] > 0)
    colour = displayed(straight, finish)
    most = 65535 if wide else 255
    opacity = np.rint(np.clip(alpha, 0, 1) * most).astype(colour.dtype)
    return np.concatenate([colour, opacity[:, :, None]], axis=2)


def check_finish(path: Path, finish: Finish, lights: bool = False) -> Numbers:
    """What numbers the file will have; InputError where it cannot be so."""
    depths: dict[int, Numbers]
    match path.suffix.lower():
        case ".exr":
            depths = {0: "float", 16: "half", 32: "float"}
        case ".png":
            depths = {0: "uint8", 8: "uint8", 16: "uint16"}
            if lights:
                raise InputError(f"{path.name}: a layer for every light needs OpenEXR (.exr)")
        case _:
            raise InputError(f"{path.name}: pictures are written as .png or .exr")
    if finish.depth not in depths:
        known = " or ".join(str(depth) for depth in depths if depth)
        raise InputError(f"{path.name}: {finish.depth} bits; {path.suffix.lower()} files have {known}")
    return depths[finish.depth]


def channel_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of layers as EXR and those who read it can have them: no dots, none twice, none empty."""
    made: list[str] = []
    for name in names:
        plain = "".join(c if c.isalnum() or c in "-_ " else "_" for c in name).strip() or "light"
        number, unique = 1, plain
        while unique in made:
            number += 1
            unique = f"{plain} {number}"
        made.append(unique)
    return tuple(made)


def write_picture(path: Path, linear: F32, *, exposure: float = 0.0, kind: Kind = "srgb") -> None:
    """Write (H, W, 3) scene-linear radiance; exposure (EV) and tone curve act on PNG only."""
    with PictureFile(path, (linear.shape[1], linear.shape[0]), Finish(exposure, kind)) as file:
        file.write(linear)
