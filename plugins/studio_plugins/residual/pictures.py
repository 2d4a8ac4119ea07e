"""A folder of photographs of one sample under one light each, brackets of a light merged.

Floating-point and raw files are linear; whole numbers are taken for sRGB. Pictures of one light are told
apart by their exposure (Exif, or a time such as `t0.5` in the name) and merged: each pixel by the exposures
that do not clip there, weighted by their length, for the noise of reading is the same in all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np

from studio_core.errors import InputError
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import Photograph, in_rec709
from studio_core.imaging.photograph_read import PHOTOGRAPHS, read_photograph
from studio_core.imaging.transfer import srgb_to_linear
from studio_core.shading.job import Job
from studio_plugins.residual.lights import angles_of, lights_for
from studio_plugins.residual.samples import F32, F64, Flags, Lights

_TIME = re.compile(
    r"(?:^|[_\W])(?:t|time|exp)[_=]?(\d+(?:\.\d+)?)(?:[_-](\d+))?(?=s?(?:[_\W]|$))", re.IGNORECASE
)
_CLIPPED = 0.99
_MOST = 2_000_000_000  # bytes of all pictures together


@dataclass(frozen=True, eq=False)
class Pictures:
    """Linear light (n, H, W, 3), where all exposures clip (n, H, W), the lights, and what was noticed."""

    light: F32
    clipped: Flags
    lights: Lights
    notes: tuple[str, ...] = ()


def read_folder(
    folder: str | Path, listed: Mapping[str, F64] | None = None, job: Job | None = None
) -> Pictures:
    """All photographs of a folder, lights by `listed` (see `lights.read_lights`) or else by file names.

    With a list, pictures that it does not hold are left out, and said. InputError in one sentence.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} cannot be read: there is no such folder")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in PHOTOGRAPHS and path.is_file())
    notes = []
    if listed is not None:
        stems = {PurePath(name).stem.lower() for name in listed}
        known = [path for path in paths if path.stem.lower() in stems]
        if len(known) < len(paths):
            notes.append(
                f"{len(paths) - len(known)} pictures are left out: the list of lights does not hold them"
            )
        paths = known
    if not paths:
        raise InputError(f"{folder} cannot be used: it holds no photographs with a light")
    lights = lights_for([path.name for path in paths], listed)
    groups = _by_light(paths, lights, listed is None)
    light: list[F32] = []
    clipped: list[Flags] = []
    with ImageDecoder() as decoder:
        for done, group in enumerate(groups):
            if job is not None:
                job.checkpoint(done, len(groups))
            shots = [read_photograph(paths[i], decoder=decoder) for i in group]
            picture, full = merged(shots)
            if light and picture.shape != light[0].shape:
                size, before = (f"{p.shape[1]} × {p.shape[0]}" for p in (picture, light[0]))
                name = paths[group[0]].name
                raise InputError(f"{name} cannot be used: it is {size} pixels, those before it {before}")
            if picture.nbytes * len(groups) > _MOST:
                raise InputError(f"{folder} cannot be used: its pictures are too large to be held together")
            light.append(picture)
            clipped.append(full)
    return Pictures(np.stack(light), np.stack(clipped), lights.some([g[0] for g in groups]), tuple(notes))


def _by_light(paths: Sequence[Path], lights: Lights, by_name: bool) -> list[list[int]]:
    groups: dict[object, list[int]] = {}
    for i, path in enumerate(paths):
        key = angles_of(path.name) if by_name else tuple(np.round(lights.directions[i], 6))
        groups.setdefault(key, []).append(i)
    return list(groups.values())


def merged(shots: Sequence[Photograph]) -> tuple[F32, Flags]:
    """Linear light (H, W, 3) per second (or of the only shot as it is), and what every exposure clips (H, W).

    InputError naming the picture whose exposure is not told, or which differs in size.
    """
    times = [1.0] if len(shots) == 1 else [_exposure(shot) for shot in shots]
    first = shots[0].pixels.shape
    total, weights = np.zeros(first, np.float64), np.zeros(first[:2], np.float64)
    shortest = int(np.argmin(times))
    clipped = np.zeros(first[:2], np.bool_)
    for i, (shot, time) in enumerate(zip(shots, times, strict=True)):
        if shot.pixels.shape != first:
            raise InputError(
                f"{shot.facts.name} cannot be merged: it has another size than {shots[0].facts.name}"
            )
        light, full = _linear(shot)
        if i == shortest:
            clipped = full
        weight = np.where(full, 1e-9 if i == shortest else 0.0, time)
        total += weight[..., None] * (light.astype(np.float64) / time)
        weights += weight
    return np.asarray(total / weights[..., None], np.float32), clipped


def _linear(shot: Photograph) -> tuple[F32, Flags]:
    pixels = shot.pixels
    if pixels.dtype == np.float32:
        # a value that many pixels share exactly at the top is where the sensor ended
        full: Flags = np.asarray((pixels >= max(float(pixels.max(initial=0.0)), 1e-9)).any(axis=-1), np.bool_)
        return in_rec709(pixels, shot.colour), full & (np.count_nonzero(full) > 8)
    top = float(np.iinfo(pixels.dtype).max)
    full = np.asarray((pixels >= _CLIPPED * top).any(axis=-1), np.bool_)
    encoded = pixels if pixels.dtype == np.uint8 else pixels.astype(np.float32) / np.float32(top)
    return in_rec709(srgb_to_linear(encoded), shot.colour), full


def _exposure(shot: Photograph) -> float:
    """Light let in, any unit that all shots share."""
    found = _TIME.search(PurePath(shot.facts.name).stem)
    if found:
        time = float(found[1]) / float(found[2] or 1)
    elif shot.facts.ev is not None:
        time = 2.0**shot.facts.ev
    else:
        time = 0.0
    if not time > 0:
        raise InputError(
            f"{shot.facts.name} cannot be merged with others of its light: neither Exif nor a name such as"
            " az-30_t0.5 tells its exposure"
        )
    return time
