"""Transfer curves and primaries: from what a picture file holds to scene-linear Rec.709."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities of red, green, blue and white as OpenEXR writes them: x, y each."""

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def srgb_to_linear(encoded: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Linear light of sRGB values (IEC 61966-2-1); uint8 of 0…255 or floats of 0…1, any shape."""
    if encoded.dtype == np.uint8:
        looked_up: npt.NDArray[np.float32] = _BYTES[encoded]
        return looked_up
    made: npt.NDArray[np.float32] = _decode(encoded.astype(np.float64)).astype(np.float32)
    return made


def linear_to_srgb(linear: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """8-bit sRGB of linear light, clipped to 0…1, any shape; NaN gives 0."""
    x = np.clip(np.nan_to_num(linear.astype(np.float64), nan=0.0), 0.0, 1.0)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055)
    made: npt.NDArray[np.uint8] = np.rint(encoded * 255).astype(np.uint8)
    return made


def _decode(encoded: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    powered = np.power(np.maximum(encoded + 0.055, 0.0) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, encoded / 12.92, powered)


_BYTES: npt.NDArray[np.float32] = _decode(np.arange(256) / 255.0).astype(np.float32)


def rgb_to_xyz(chromaticities: Sequence[float]) -> npt.NDArray[np.float64]:
    """3×3 matrix of a colour space, white at Y = 1 (SMPTE RP 177). ValueError when it is degenerate."""
    xy = np.asarray(chromaticities, dtype=np.float64).reshape(4, 2)
    if not np.isfinite(xy).all() or xy[3, 1] <= 0:
        raise ValueError("chromaticities without a white")
    columns = np.concatenate([xy, 1 - xy.sum(axis=1, keepdims=True)], axis=1).T
    primaries, white = columns[:, :3], columns[:, 3] / xy[3, 1]
    if abs(np.linalg.det(primaries)) < 1e-6:
        raise ValueError("chromaticities on one line")
    made: npt.NDArray[np.float64] = primaries * np.linalg.solve(primaries, white)
    return made


def to_rec709(
    chromaticities: Sequence[float], neutral: Sequence[float] | None = None
) -> npt.NDArray[np.float64]:
    """3×3 matrix from a picture's RGB to linear Rec.709.

    `neutral` (or else the space's white) is adapted to D65 with Bradford's matrix. A picture that holds
    CIE XYZ itself is colorimetric: nothing is adapted. ValueError when the chromaticities are degenerate.
    """
    source, target = rgb_to_xyz(chromaticities), rgb_to_xyz(REC709)
    if np.allclose(source, np.eye(3), atol=1e-4):
        return np.linalg.inv(target).astype(np.float64)
    x, y = neutral if neutral is not None else chromaticities[6:8]
    if not (np.isfinite([x, y]).all() and y > 0):
        raise ValueError("no adopted neutral")
    seen = _BRADFORD @ np.array([x / y, 1.0, (1 - x - y) / y])
    wanted = _BRADFORD @ (target @ np.ones(3))
    if (seen <= 1e-6).any():
        raise ValueError("an adopted neutral that cannot be seen")
    adapt = np.linalg.inv(_BRADFORD) @ np.diag(wanted / seen) @ _BRADFORD
    made: npt.NDArray[np.float64] = np.linalg.inv(target) @ adapt @ source
    return made


_SRGB_D50 = np.array([[0.4361, 0.3851, 0.1431], [0.2225, 0.7169, 0.0606], [0.0139, 0.0971, 0.7141]])
"""Colorants of sRGB's ICC profile: XYZ of red, green and blue in columns, adapted to D50."""


def icc_to_rec709(profile: bytes) -> list[float]:
    """Nine numbers, rows first, of the matrix from a profile's linear RGB to linear Rec.709.

    Empty where the profile's primaries are Rec.709's within 0.01, or it is no matrix profile of RGB. Source:
    ICC.1:2022, sections 7.2, 9.2.
    """
    if profile[16:20] != b"RGB " or len(profile) < 132:
        return []
    colorants = {}
    for index in range(min(struct.unpack_from(">I", profile, 128)[0], 100)):
        entry = profile[132 + 12 * index : 144 + 12 * index]
        if len(entry) == 12 and entry[:4] in (b"rXYZ", b"gXYZ", b"bXYZ"):
            at = struct.unpack_from(">I", entry, 4)[0]
            body = profile[at : at + 20]
            if len(body) == 20 and body[:4] == b"XYZ ":
                colorants[entry[:1]] = np.array(struct.unpack_from(">3i", body, 8)) / 65536
    if len(colorants) < 3:
        return []
    matrix = np.linalg.solve(_SRGB_D50, np.stack([colorants[c] for c in (b"r", b"g", b"b")], axis=1))
    if np.abs(matrix - np.eye(3)).max() < 0.01 or np.abs(matrix.sum(axis=1) - 1).max() > 0.05:
        return []
    return [float(v) for v in matrix.ravel()]
