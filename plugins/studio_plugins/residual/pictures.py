"""A folder of photographs of one sample under one lamp each, as light: developed, balanced, made smaller.

Floating-point and raw files are linear; whole numbers are taken for sRGB, unless brackets tell the camera's
curve (`brackets`). Pictures of one lamp that differ in exposure are merged. What a picture without any lamp
shows is taken off. Large pictures are averaged down, so that all lamps fit into memory together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.photograph_read import read_photograph
from studio_core.shading.job import Job
from studio_plugins.residual.brackets import AUTOMATIC, Developer, Light, with_told
from studio_plugins.residual.folder import Group, look_through
from studio_plugins.residual.lights import LightList
from studio_plugins.residual.samples import F32, F64, Flags, Lights

_MOST = 900_000_000  # bytes of all lamps together
_UNREADABLE = 1 / 3  # of all pictures: more, and it is no longer this folder's fault


@dataclass(frozen=True, eq=False)
class Pictures:
    """Linear light (n, H, W, 3), where all exposures clip (n, H, W), the lights, and what was noticed.

    `mask` (H, W): where the sample is, if a picture says so; `factor`: pixels of the files along one here;
    `size`: height and width of the files.
    """

    light: F32
    clipped: Flags
    lights: Lights
    notes: tuple[str, ...] = ()
    mask: Flags | None = None
    factor: int = 1
    size: tuple[int, int] = (0, 0)

    def with_lights(self, lights: Lights) -> Pictures:
        """The same under lamps whose places became known."""
        return replace(self, lights=lights)

    def balanced(self, white: Sequence[float]) -> Pictures:
        """As if what shows the colour `white` were neutral; of the same luminance. InputError for no colour.

        Only ratios count: (0.9, 1, 1.2), the numbers of a grey card's picture, or a camera's multipliers
        inverted.
        """
        colour = np.asarray(white, np.float64)
        if colour.shape != (3,) or not (np.isfinite(colour).all() and (colour > 0).all()):
            raise InputError("a white has three numbers above zero")
        gains = float(colour @ np.asarray(LUMINANCE)) / colour
        return replace(self, light=self.light * gains.astype(np.float32))

    def spot(self, x: float, y: float, radius: float) -> F64:
        """(3,) mean colour of a round place, in pixels of the files, over all lamps where it is not clipped.

        InputError when nothing is there.
        """
        height, width = self.light.shape[1:3]
        at_x, at_y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        near = np.hypot(at_x - x / self.factor, at_y - y / self.factor) <= max(radius / self.factor, 0.75)
        use = near[None] & ~self.clipped
        colours = self.light[use].astype(np.float64)
        mean = colours.mean(axis=0) if len(colours) else np.zeros(3)
        if not (mean > 1e-6).all():
            raise InputError(f"the white at {x:g}, {y:g} cannot be used: the pictures show no light there")
        return np.asarray(mean, np.float64)


def read_folder(
    folder: str | Path,
    listed: LightList | Mapping[str, F64] | None = None,
    job: Job | None = None,
    *,
    response: str = AUTOMATIC,
    directions: bool = True,
    most: int = _MOST,
) -> Pictures:
    """All photographs of a folder by lamp; see `folder.look_through` for where lamps are told.

    `response`: one of `brackets.RESPONSES`; `directions`: False where they come from elsewhere (they are then
    towards the camera); `most`: bytes that all lamps may take. Pictures that cannot be read, or have another
    size, are left out and said, as long as they are few. InputError in one sentence.
    """
    found = look_through(folder, listed, directions)
    made: list[tuple[Group, Light, tuple[int, int]]] = []
    with ImageDecoder() as decoder:
        reader = _Reader(decoder, sum(len(group.paths) for group in found.groups))
        developer = Developer(found.groups, reader.shots, response)
        dark = developer.light(found.dark) if found.dark is not None else None
        for done, group in enumerate(found.groups):
            if job is not None:
                job.checkpoint(done, len(found.groups))
            light = developer.light(group)
            if light is not None:
                size = light.pixels.shape[:2]
                if dark is not None and dark.pixels.shape == light.pixels.shape:
                    light = Light(np.maximum(light.pixels - dark.pixels, np.float32(0)), light.clipped)
                made.append((group, _smaller(light, _factor(size, len(found.groups), most)), size))
        if not made:
            raise InputError(reader.last or f"{folder} cannot be used: it holds no photographs with a light")
        sizes = [size for _, _, size in made]
        usual = max(dict.fromkeys(sizes), key=sizes.count)
        for group, _, size in made:
            if size != usual:
                reader.leave_out(
                    f"{group.name} is left out: it is {size[1]} × {size[0]} pixels,"
                    f" the others are {usual[1]} × {usual[0]}",
                    len(group.paths),
                )
        made = [one for one in made if one[2] == usual]
        factor = _factor(usual, len(found.groups), most)
        mask = None
        if found.mask is not None:
            mask = reader.mask(found.mask, usual, factor)
    towards = [np.array([0.0, 0.0, 1.0]) if g.direction is None else g.direction for g, _, _ in made]
    lights = Lights.of(np.stack(towards), found.source, tuple(group.name for group, _, _ in made))
    return Pictures(
        np.stack([light.pixels for _, light, _ in made]),
        np.stack([light.clipped for _, light, _ in made]),
        lights,
        (*found.notes, *developer.notes, *reader.notes),
        mask,
        factor,
        usual,
    )


def read_mask(path: str | Path, size: tuple[int, int], factor: int = 1) -> Flags:
    """(H, W) of a picture of `size` (height, width) that is bright where the sample is, made smaller.

    InputError when it cannot be read or has another size.
    """
    with ImageDecoder() as decoder:
        return _Reader(decoder, 1).mask(Path(path), size, factor)


class _Reader:
    """Reads photographs, and keeps account of what cannot be used."""

    def __init__(self, decoder: ImageDecoder, total: int) -> None:
        self.notes: list[str] = []
        self.last = ""
        self._decoder, self._total = decoder, total
        self._bad: dict[object, int] = {}

    def shots(self, group: Group) -> list[Photograph]:
        """Those of a group that can be read."""
        made = []
        for path, told in zip(group.paths, group.told, strict=True):
            try:
                made.append(with_told(read_photograph(path, decoder=self._decoder), told))
            except InputError as error:
                self.leave_out(f"{str(error).rstrip('.')}: it is left out")
        return made

    def leave_out(self, why: str, count: int = 1) -> None:
        """Say it; InputError when it is too many."""
        if why not in self._bad:
            self._bad[why] = count
            self.notes.append(why)
            self.last = self.last or why.removesuffix(": it is left out")
        if sum(self._bad.values()) > _UNREADABLE * self._total:
            raise InputError(self.last)

    def mask(self, path: Path, size: tuple[int, int], factor: int) -> Flags:
        """The sample's place."""
        pixels = read_photograph(path, decoder=self._decoder).pixels
        if pixels.shape[:2] != size:
            raise InputError(
                f"{path.name} cannot be used: the mask is {pixels.shape[1]} × {pixels.shape[0]} pixels,"
                f" the pictures are {size[1]} × {size[0]}"
            )
        grey = pixels.astype(np.float32).mean(axis=-1)
        made = (grey > 0.5 * float(grey.max(initial=0.0))).astype(np.float32)
        if not 0 < made.mean() < 1:
            raise InputError(
                f"{path.name} cannot be used: a mask is bright where the sample is, dark elsewhere"
            )
        return np.asarray(_averaged(made, factor) > 0.5)


def _factor(size: tuple[int, int], count: int, most: int) -> int:
    return max(int(np.ceil(np.sqrt(size[0] * size[1] * 12.0 * count / most))), 1)


def _smaller(light: Light, factor: int) -> Light:
    if factor == 1:
        return light
    return Light(_averaged(light.pixels, factor), _averaged(light.clipped.astype(np.float32), factor) > 0)


def _averaged(picture: F32, factor: int) -> F32:
    import cv2

    if factor == 1:
        return picture
    height, width = (n // factor for n in picture.shape[:2])
    some = picture[: height * factor, : width * factor]
    return np.asarray(cv2.resize(some, (width, height), interpolation=cv2.INTER_AREA), np.float32)
