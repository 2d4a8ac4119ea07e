"""Decoding a photograph as the camera wrote it; runs in the decoder child (`decode_child`).

HEIC and the cameras' own raw formats need libraries that are extras of the program (docs/dependencies.md).
"""

from __future__ import annotations

import base64
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.decode import Facts, Limits, Unreadable, check_size, decode_file
from studio_core.imaging.transfer import icc_to_rec709, to_rec709

HEIC = (".heic", ".heif", ".hif")
RAW = (".dng", ".nef", ".nrw", ".cr2", ".cr3", ".arw", ".raf", ".rw2", ".orf", ".pef", ".srw")
_DISPLAY_P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
_P3_CODES = (11, 12)  # of ITU-T H.273's colour primaries
_MOST_EXIF = 1 << 16


def decode_photograph(path: str, limits: Limits) -> tuple[npt.NDArray[Any], Facts]:
    """Upright pixels (H, W, 3), and the facts. Raises Unreadable.

    uint8 or uint16 as the file encodes them; float32 linear light from raw and floating-point files. Grey
    becomes three equal channels, alpha is left out.
    """
    suffix = Path(path).suffix.lower()
    if suffix in HEIC:
        pixels, facts = _heic(path, limits)
    elif suffix in RAW:
        pixels, facts = _raw(path, limits)
    else:
        pixels, facts = decode_file(path, limits, encoded=True)
        if facts.exposure != 1.0:
            pixels = pixels / np.float32(facts.exposure)
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
        facts.notes.append("It is in shades of grey.")
    return np.ascontiguousarray(pixels[:, :, :3]), facts


def _heic(path: str, limits: Limits) -> tuple[npt.NDArray[Any], Facts]:
    """HEIF's own turn is applied by the library, so Exif's, which repeats it, is not."""
    try:
        import pillow_heif
    except ImportError:
        raise Unreadable('HEIC files need the extra "heic": pip install "lucarne[heic]"') from None
    file = pillow_heif.open_heif(path, convert_hdr_to_8bit=False)
    width, height = file.size
    check_size(width, height, 4, limits)
    pixels = np.asarray(file)
    if pixels.ndim == 2:
        pixels = pixels[:, :, None]
    if pixels.dtype not in (np.uint8, np.uint16):
        raise Unreadable(f"its numbers of the kind {pixels.dtype} are no photograph's")
    exif = file.info.get("exif") or b""
    start = exif.find(b"Exif\0\0", 0, 16)
    colour = icc_to_rec709(file.info.get("icc_profile") or b"")
    if (file.info.get("nclx_profile") or {}).get("color_primaries") in _P3_CODES:
        colour = [float(v) for v in to_rec709(_DISPLAY_P3).ravel()]
    block = base64.b64encode(exif[max(start, 0) :][:_MOST_EXIF]).decode()
    return pixels, Facts("heif", "srgb", colour=colour, exif=block)


def _raw(path: str, limits: Limits) -> tuple[npt.NDArray[Any], Facts]:
    """Linear light: black taken off, the camera's white, 1 where the sensor is full.

    The white point is the camera's constant one: the library's habit of fitting it to each picture's
    brightest pixel would scale every shot of a bracket differently.
    """
    try:
        import rawpy
    except ImportError:
        raise Unreadable('raw files of cameras need the extra "raw": pip install "lucarne[raw]"') from None
    try:
        with rawpy.imread(path) as raw:
            check_size(raw.sizes.iwidth, raw.sizes.iheight, 4, limits)
            pixels = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,
                use_camera_wb=True,
                output_color=rawpy.ColorSpace.sRGB,
                output_bps=16,
            )
            other = getattr(raw, "other", None)
    except rawpy.LibRawError as error:
        text = error.args[0] if error.args else error
        why = text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
        raise Unreadable(f"it is damaged, or of a camera that is not known ({why})") from None
    told = {
        "seconds": float(getattr(other, "shutter", 0) or 0),
        "iso": float(getattr(other, "iso_speed", 0) or 0),
        "aperture": float(getattr(other, "aperture", 0) or 0),
    }
    clock = getattr(other, "timestamp", None)
    if isinstance(clock, datetime):
        told["taken"] = (clock.replace(tzinfo=None) - datetime(1970, 1, 1)).total_seconds()
    linear = pixels.astype(np.float32) / np.float32(65535)
    return linear, replace(Facts("raw", "linear"), told=told)
