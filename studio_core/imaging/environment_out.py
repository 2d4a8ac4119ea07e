"""Environments and cube maps as files, in the layouts that `load_environment` and other programs read.

Nothing about where or by whom a picture was taken is written. Files appear whole or not at all.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.cubemap import Faces, edge_samples, joined, to_opengl
from studio_core.imaging.encode import write_exr, write_hdr

SUFFIXES = (".exr", ".hdr")
SIX, STRIP, CROSS, VERTICAL_CROSS, OPENEXR = "six", "strip", "cross", "vertical cross", "openexr"
LAYOUTS = (SIX, STRIP, CROSS, VERTICAL_CROSS, OPENEXR)
FACE_NAMES = ("px", "nx", "py", "ny", "pz", "nz")
"""Of the six files, OpenGL's faces: right, left, top, bottom, front, back."""
UNRESOLVED = "unresolved"
"""The layer that tells which pixels no exposure resolved: 1 too bright, 2 too dark, 3 never seen."""

_Facts = Mapping[str, str | float | int]


def write_environment(
    path: str | os.PathLike[str],
    pixels: npt.NDArray[np.float32],
    *,
    unresolved: npt.NDArray[np.uint8] | None = None,
    luminance_scale: float | None = None,
    facts: _Facts | None = None,
) -> None:
    """Write equirectangular radiance (H, 2H, 3) as OpenEXR or Radiance picture, by the name's ending.

    An EXR is bit for bit what is given; `unresolved` (H, 2H) becomes the layer UNRESOLVED in it, and
    `luminance_scale` (cd/m² for one unit of luminance) OpenEXR's standard attribute whiteLuminance. A
    Radiance file has three colours of 8 bits and one exponent, within 1 %, and neither of these. InputError
    where the ending is another or the disk refuses.
    """
    path = Path(path)
    if _suffix(path) == ".hdr":
        write_hdr(path, pixels)
        return
    layers: dict[str, npt.NDArray[Any]] = {"": pixels}
    if unresolved is not None:
        layers[UNRESOLVED] = unresolved[:, :, None]
    write_exr(path, layers, _told(luminance_scale, facts))


def write_cube(
    path: str | os.PathLike[str],
    faces: Faces,
    layout: str = SIX,
    *,
    luminance_scale: float | None = None,
    suffix: str = ".exr",
    facts: _Facts | None = None,
) -> tuple[Path, ...]:
    """Write (6, n, n, 3) faces in our order; what was written.

    SIX: `path` is a folder (made when absent) for px, nx, py, ny, pz, nz with the ending `suffix`, in
    OpenGL's convention (the front looks along +z). STRIP, CROSS and VERTICAL_CROSS are one picture of the
    same faces. OPENEXR: that format's own cube, six faces below each other with samples on their edges,
    made of the means of neighbouring samples. InputError as in `write_environment`, or where the layout
    needs OpenEXR; ValueError for a layout that is none.
    """
    path = Path(path)
    told = _told(luminance_scale, facts)
    if layout == SIX:
        return _write_six(path, to_opengl(faces), suffix, told)
    if layout not in LAYOUTS:
        raise ValueError(f"there is no layout {layout!r}; there are {', '.join(LAYOUTS)}")
    kind = _suffix(path)
    if layout == OPENEXR:
        if kind != ".exr":
            raise InputError(f"{path} cannot be written: OpenEXR's cube layout needs a name ending in .exr")
        n = faces.shape[1]
        stacked = edge_samples(faces).reshape(6 * n, n, -1)
        write_exr(path, stacked, {**told, "textureformat": "CubeFace Environment"})
    elif kind == ".hdr":
        write_hdr(path, joined(to_opengl(faces), layout))
    else:
        write_exr(path, joined(to_opengl(faces), layout), told)
    return (path,)


def _write_six(folder: Path, faces: Faces, suffix: str, told: _Facts) -> tuple[Path, ...]:
    """All six are written beside the folder's files before the first takes its place."""
    if suffix not in SUFFIXES:
        raise InputError(f"{folder} cannot be written: faces end in {' or '.join(SUFFIXES)}, not {suffix}")
    beside = folder / f".{secrets.token_hex(6)}"
    try:
        folder.mkdir(exist_ok=True)
        beside.mkdir()
        for name, face in zip(FACE_NAMES, faces, strict=True):
            if suffix == ".hdr":
                write_hdr(beside / f"{name}{suffix}", face)
            else:
                write_exr(beside / f"{name}{suffix}", face, told)
        for name in FACE_NAMES:
            (beside / f"{name}{suffix}").replace(folder / f"{name}{suffix}")
    except OSError as error:
        raise InputError(f"{folder} cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return tuple(folder / f"{name}{suffix}" for name in FACE_NAMES)


def _told(luminance_scale: float | None, facts: _Facts | None) -> dict[str, str | float | int]:
    told: dict[str, str | float | int] = {"Software": "Lucarne Studio", **(facts or {})}
    if luminance_scale is not None:
        told["whiteLuminance"] = float(luminance_scale)
    return told


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path} cannot be written: light is kept in .exr or .hdr files")
    return suffix
