"""The MERL database's `.binary` files (Matusik et al., "A Data-Driven Reflectance Model", 2003).

Three little-endian int32, 90 90 180, then float64: all of red, all of green, all of blue, each with φ_d
running fastest, then θ_d, then θ_h (see `half_difference`). Values are to be multiplied with 1/1500,
1.15/1500 and 1.66/1500; negative ones mark directions that could not be measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.half_difference import filled, grid
from studio_core.errors import InputError
from studio_core.scene.geometry import Table

SHAPE = (90, 90, 180)
SCALES = np.array([1.0, 1.15, 1.66]) / 1500
_COUNT = int(np.prod(SHAPE))
BYTES = 12 + 3 * 8 * _COUNT
BRIGHTEST = 1e7  # 1/sr; a mirror as sharp as the first cell gives about 3e6


@dataclass(frozen=True)
class Measurement:
    """A half-difference table without gaps, and which share of the cells above the surface was `invalid`."""

    table: Table
    invalid: float


def read(path: Path) -> Measurement:
    """InputError in one sentence when it is no sound MERL file; its size is checked before it is read."""
    try:
        if not path.is_file():
            raise InputError(f"{path} cannot be imported: there is no such file")
        size = path.stat().st_size
        with path.open("rb") as file:
            head = np.frombuffer(file.read(12).ljust(12, b"\0"), "<i4")
            if size != BYTES or tuple(head) != SHAPE:
                told = " × ".join(str(int(n)) for n in head)
                raise InputError(
                    f"{path} cannot be imported: a MERL file has {BYTES} bytes and begins with "
                    f"90 × 90 × 180, this has {size} and begins with {told}"
                )
            numbers = np.frombuffer(file.read(BYTES - 12), "<f8")
    except OSError as error:
        raise InputError(f"{path} cannot be imported: {error.strerror or error}") from None
    if len(numbers) != 3 * _COUNT:
        raise InputError(f"{path} cannot be imported: it ends too early")
    if not np.isfinite(numbers).all():
        raise InputError(f"{path} cannot be imported: it holds numbers that are not finite")
    values = numbers.reshape(3, *SHAPE)
    known: npt.NDArray[np.bool_] = np.all(values >= 0, axis=0)
    if not known.any():
        raise InputError(f"{path} cannot be imported: none of its values is valid")
    scaled = np.moveaxis(values * SCALES[:, None, None, None], 0, -1)
    brightest = float(scaled[known].max())
    if brightest > BRIGHTEST:
        told = f"a value of {brightest:.3g} per steradian is no reflectance"
        raise InputError(f"{path} cannot be imported: {told}")
    wi, wo = grid(SHAPE)
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    return Measurement(Table(filled(scaled, known), path.stem), float(1 - known[above].mean()))


def write(path: Path, values: npt.NDArray[np.floating], known: npt.NDArray[np.bool_] | None = None) -> None:
    """Write values (90, 90, 180, 3) in 1/sr; cells that are not `known` (90, 90, 180) are marked −1."""
    if values.shape != (*SHAPE, 3):
        raise ValueError(f"expected {(*SHAPE, 3)}, got {values.shape}")
    raw = np.moveaxis(np.asarray(values, np.float64), -1, 0) / SCALES[:, None, None, None]
    if known is not None:
        raw = np.where(known, raw, -1.0)
    path.write_bytes(np.array(SHAPE, "<i4").tobytes() + np.ascontiguousarray(raw, "<f8").tobytes())
