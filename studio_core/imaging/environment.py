"""Environments: pictures of the light from all around, made equirectangular and finite."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.cubemap import equirect_from_cube, from_opengl, split
from studio_core.imaging.decode import Facts
from studio_core.imaging.io import EXTENSIONS, ImageDecoder
from studio_core.imaging.latlong import direction_to_uv, equirect_direction, pixel_solid_angles
from studio_core.imaging.transfer import srgb_to_linear
from studio_core.scene.geometry import Image

Source = str | os.PathLike[str]

__all__ = [
    "BRIGHTEST",
    "direction_to_uv",
    "equirect_direction",
    "load_environment",
    "pixel_solid_angles",
]
BRIGHTEST = 1e12
"""Radiance above which sums in float32 are in danger; brighter samples are clamped."""
SMALLEST = 2
"""Fewest rows of an equirectangular picture."""
_TOLERANCE = 0.02
_FACE_NAMES = (
    ("px", "posx", "right", "rt", "xp", "+x"),
    ("nx", "negx", "left", "lf", "xn", "-x"),
    ("py", "posy", "top", "up", "yp", "+y"),
    ("ny", "negy", "bottom", "down", "dn", "yn", "-y"),
    ("pz", "posz", "front", "ft", "zp", "+z"),
    ("nz", "negz", "back", "bk", "zn", "-z"),
)


def load_environment(
    source: Source | Sequence[Source], decoder: ImageDecoder | None = None
) -> tuple[Image, tuple[str, ...]]:
    """An equirectangular picture (H, 2H, 3) of finite linear radiance ≥ 0, and what was done in sentences.

    `source` is a picture (equirectangular 2:1; a cube map as cross, strip or in OpenEXR's layout), a
    folder with six faces, or six files in any order whose names tell the face (px, posx, right, …).
    Ordinary 8-bit pictures are accepted, with a note. Raises InputError naming file and cause.
    """
    if decoder is None:
        with ImageDecoder() as made:
            return load_environment(source, made)
    notes: list[str] = []
    if isinstance(source, str | os.PathLike) and not Path(source).is_dir():
        name = str(source)
        pixels, facts = _linear(Path(source), decoder)
        notes += facts.notes
        pixels = _equirect(pixels, facts, name, notes)
    else:
        if isinstance(source, str | os.PathLike):
            name = str(source)
            files = _files_in(Path(source))
        else:
            name = ", ".join(Path(path).name for path in source)
            files = [Path(path) for path in source]
        faces, facts = _six(files, name, decoder)
        notes.append("Six faces were joined to one picture.")
        pixels = equirect_from_cube(_clean(from_opengl(faces), notes))
    if facts.encoding == "srgb":
        notes.append("The picture is not HDR: lamps and windows are clipped and light less than they should.")
    pixels = _clean(pixels, notes)
    if not pixels.any():
        notes.append("The picture is black: it gives no light.")
    return Image(pixels), tuple(dict.fromkeys(notes))


def _linear(path: Path, decoder: ImageDecoder) -> tuple[npt.NDArray[np.float32], Facts]:
    """(H, W, 3) linear, alpha left out."""
    pixels, facts = decoder.read_pixels(path)
    colour = pixels[:, :, [0, 0, 0]] if pixels.shape[2] == 1 else pixels[:, :, :3]
    return (srgb_to_linear(colour) if facts.encoding == "srgb" else colour), facts


def _equirect(
    pixels: npt.NDArray[np.float32], facts: Facts, name: str, notes: list[str]
) -> npt.NDArray[np.float32]:
    height, width = pixels.shape[:2]
    if facts.envmap == "cube":
        faces = split(pixels)
        if faces is None:
            size = f"{width} × {height}"
            raise InputError(f"{name} cannot light the scene: its cube map of {size} has no six faces")
        notes.append("The cube map was converted to an equirectangular picture.")
        return equirect_from_cube(_clean(faces, notes), facts.edge_aligned)
    if height >= SMALLEST and abs(width / height - 2) <= 2 * _TOLERANCE:
        if width != 2 * height:
            notes.append(f"The picture is {width} × {height}, not quite 2:1; it was taken as a full sphere.")
        return _centred(pixels) if facts.edge_aligned else pixels
    faces = split(pixels)
    if faces is not None:
        notes.append("The cube map was converted to an equirectangular picture.")
        return equirect_from_cube(_clean(from_opengl(faces), notes))
    raise InputError(
        f"{name} cannot light the scene: at {width} × {height} it is neither an equirectangular picture"
        " (twice as wide as high) nor a cube map (cross, strip or six files)"
    )


def _centred(pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """OpenEXR's lat-long in our convention: its first and last columns are one, and so are its pole rows.

    Files that only claim it, as their columns differ, stay as they are.
    """
    height, width = pixels.shape[:2]
    step = np.abs(pixels[:, 0] - pixels[:, 1]).mean()
    if not np.abs(pixels[:, 0] - pixels[:, -1]).mean() < 0.1 * step:
        return pixels
    made = pixels
    for axis, count in ((0, height), (1, width)):
        x = (np.arange(count) + 0.5) / count * (count - 1)
        low = np.minimum(x.astype(np.intp), count - 2)
        part = (x - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        near, far = made.take(low, axis=axis), made.take(low + 1, axis=axis)
        made = near * (1 - part) + far * part
    return made


def _files_in(folder: Path) -> list[Path]:
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() in EXTENSIONS)
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror or error}") from None
    return [path for path in files if _face(path) is not None]


def _face(path: Path) -> int | None:
    """Which face a file's name tells: its last word, or the whole of it."""
    stem = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", path.stem).lower()
    words = (stem, re.split(r"[^a-z+-]+", stem)[-1], re.split(r"[^a-z]+", stem)[-1])
    for word in words:
        for index, names in enumerate(_FACE_NAMES):
            if word in names:
                return index
    return None


def _six(files: Sequence[Path], name: str, decoder: ImageDecoder) -> tuple[npt.NDArray[np.float32], Facts]:
    by_face: dict[int, Path] = {}
    for path in files:
        face = _face(path)
        if face is None:
            raise InputError(f"{path} cannot light the scene: its name does not tell which face it is")
        if face in by_face:
            raise InputError(f"{path} cannot light the scene: {by_face[face].name} is the same face")
        by_face[face] = path
    missing = [_FACE_NAMES[face][0] for face in range(6) if face not in by_face]
    if missing:
        raise InputError(f"{name} cannot light the scene: there is no face {', '.join(missing)}")
    read = [_linear(by_face[face], decoder) for face in range(6)]
    first = read[0][0].shape
    for face in range(6):
        shape = read[face][0].shape
        if shape != first or shape[0] != shape[1]:
            cause = "the six faces must be squares of one size"
            raise InputError(f"{by_face[face]} cannot light the scene: {cause}")
    facts = next((facts for _, facts in read if facts.encoding == "srgb"), read[0][1])
    return np.stack([pixels for pixels, _ in read]), facts


def _clean(pixels: npt.NDArray[np.float32], notes: list[str]) -> npt.NDArray[np.float32]:
    """Finite radiance ≥ 0 (..., H, W, 3); what was wrong is counted in pixels."""
    nan = np.isnan(pixels)
    with np.errstate(invalid="ignore"):
        bright = pixels > BRIGHTEST
        negative = pixels < 0
    if not (nan.any() or bright.any() or negative.any()):
        return pixels
    made = pixels.copy()
    finite = made[np.isfinite(made) & ~bright]
    largest = max(float(finite.max()), 0.0) if finite.size else 0.0
    made[bright] = largest
    made[negative] = 0
    if nan.any():
        _fill(made, nan)
    reports = (
        (nan, "no number (NaN) and took their neighbours' light"),
        (bright, f"infinite or absurd radiance and were set to the brightest other, {largest:.4g}"),
        (negative, "negative radiance and were set to 0"),
    )
    for wrong, what in reports:
        count = int(wrong.any(axis=-1).sum())
        if count:
            notes.append(f"{count} pixel{'s' if count > 1 else ''} had {what}.")
    return made


def _fill(pixels: npt.NDArray[np.float32], nan: npt.NDArray[np.bool_]) -> None:
    """Put the median of the up to eight neighbours in each NaN's place, 0 where there are none."""
    faces, holes = pixels.reshape(-1, *pixels.shape[-3:]), nan.reshape(-1, *nan.shape[-3:])
    height, width = faces.shape[1:3]
    which, row, column, channel = np.nonzero(holes)
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    chunk = 1 << 20
    filled = np.zeros(len(row), np.float32)
    for start in range(0, len(row), chunk):
        part = slice(start, start + chunk)
        near = np.stack(
            [
                faces[
                    which[part],
                    np.clip(row[part] + i, 0, height - 1),
                    np.clip(column[part] + j, 0, width - 1),
                    channel[part],
                ]
                for i, j in steps
            ]
        )
        near.sort(axis=0)  # NaN last
        count = len(steps) - np.isnan(near).sum(axis=0)
        place = np.arange(near.shape[1])
        low, high = near[np.maximum(count - 1, 0) // 2, place], near[count // 2, place]
        filled[part] = np.where(count > 0, (low + high) / 2, 0)
    faces[which, row, column, channel] = filled
