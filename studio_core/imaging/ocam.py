"""Lens calibrations of the OCamCalib toolbox: reading `calib_results.txt`.

Scaramuzza, Martinelli and Siegwart, "A Toolbox for Easily Calibrating Omnidirectional Cameras", IROS 2006: a
point at the distance ρ from the centre looks along (x, y, f(ρ)), f a polynomial, x down the rows. The file
holds f, a polynomial for the way back, the centre (row, column; the first pixel's centre is 0), the affine
parameters c, d, e, and height and width.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from studio_core.errors import InputError
from studio_core.imaging.projection import OCAM, Circle, Lens

_LONGEST = 1 << 16
_MOST_TERMS = 64
_STEPS = 2048


def read_ocam(path: str | os.PathLike[str]) -> tuple[Lens, Circle, tuple[int, int]]:
    """The lens, the circle that its numbers are in, and width and height of the calibrated pictures.

    The file does not tell where the lens' image ends: the circle is the largest round the centre that
    touches an edge of the picture, or smaller where the polynomial turns back before, and the field of view
    is what that circle shows. Pictures of another size with the same proportions take `circle.scaled`.
    The polynomial for the way back is not used. Raises InputError naming the file and the cause.
    """
    name = str(path)
    rows = _rows(Path(path), name)
    polynomial, _inverse = (_counted(row, name) for row in rows[:2])
    (row, column), (c, across, e), (height, width) = (
        _exactly(rows[2], 2, "centre", name),
        _exactly(rows[3], 3, "affine parameters", name),
        _exactly(rows[4], 2, "size of the picture", name),
    )
    if not (height == int(height) and width == int(width) and min(height, width) >= 16):
        raise _wrong(name, f"a picture of {width:g} × {height:g} pixels is none")
    if max(height, width) > 1e5:
        raise _wrong(name, f"a picture of {width:g} × {height:g} pixels is none")
    x, y = column + 0.5, row + 0.5
    if not (0 < x < width and 0 < y < height):
        raise _wrong(name, "its centre lies outside the picture")
    if not (abs(c - across * e) > 0.1 and max(abs(c), abs(across), abs(e)) < 10):
        raise _wrong(name, "its affine parameters make no picture")
    radius = _usable(polynomial, min(x, y, width - x, height - y), name)
    scaled = tuple(a * radius ** (power - 1) for power, a in enumerate(polynomial))
    height_of_edge = sum(scaled)
    fov = math.degrees(2 * math.atan2(1, -height_of_edge))
    try:
        lens = Lens(OCAM, fov, scaled, (c, across, e))
    except ValueError as error:
        raise _wrong(name, str(error)) from None
    return lens, Circle(x, y, radius), (int(width), int(height))


def _rows(path: Path, name: str) -> list[list[float]]:
    """The five lines of numbers."""
    try:
        with path.open("rb") as file:
            data = file.read(_LONGEST + 1)
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror or error}") from None
    if len(data) > _LONGEST or b"\0" in data:
        raise _wrong(name, "it is no text of this kind")
    rows = []
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            raise _wrong(name, f"{' '.join(words)[:40]!r} are no numbers") from None
        if not all(math.isfinite(number) for number in numbers):
            raise _wrong(name, "not all of its numbers are finite")
        rows.append(numbers)
    if len(rows) < 5:
        raise _wrong(name, f"it has {len(rows)} of the five lines of numbers")
    return rows


def _counted(row: list[float], name: str) -> list[float]:
    """A polynomial: how many coefficients, then they."""
    if row[0] != len(row) - 1 or not 1 <= row[0] <= _MOST_TERMS:
        raise _wrong(name, f"a polynomial says {row[0]:g} coefficients and has {len(row) - 1}")
    return row[1:]


def _exactly(row: list[float], count: int, what: str, name: str) -> list[float]:
    if len(row) != count:
        raise _wrong(name, f"its {what} are {len(row)} numbers, not {count}")
    return row


def _usable(polynomial: list[float], reach: float, name: str) -> float:
    """How far from the centre angles grow, at most `reach`."""
    radius = np.linspace(0, reach, _STEPS)
    angle = np.arctan2(radius, -np.polynomial.polynomial.polyval(radius, polynomial))
    if not polynomial[0] < 0:
        raise _wrong(name, "its polynomial does not look forward at the centre")
    back = np.flatnonzero(np.diff(angle) <= 0)
    end = float(radius[back[0]]) if len(back) else reach
    if end < reach / 4:
        raise _wrong(name, "its polynomial turns back near the centre")
    return end


def _wrong(name: str, cause: str) -> InputError:
    return InputError(f"{name} is no lens calibration of OCamCalib: {cause}")
