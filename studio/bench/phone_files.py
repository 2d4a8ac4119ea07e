"""The simulated phone's photographs as files with EXIF, as they would be dropped on the studio."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from studio.bench.phone import Shots
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle

START = datetime(2024, 5, 4, 12, 30, 0)
_EXIF, _GPS = 0x8769, 0x8825


def write_shots(
    shots: Shots, folder: Path, *, kind: str = "jpg", exif: bool = True, position: bool = False
) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Files of the front and of the back bracket. `position`: EXIF tells where it was, too."""
    made = []
    for bracket in (shots.front, shots.back):
        paths = []
        for shot in bracket:
            path = folder / Path(shot.facts.name).with_suffix(f".{kind}")
            write_photograph(shot, path, exif=exif, position=position, quality=shots.truth.phone.jpeg or 95)
            paths.append(path)
        made.append(tuple(paths))
    return made[0], made[1]


def write_photograph(
    shot: Photograph, path: Path, *, exif: bool = True, position: bool = False, quality: int = 95
) -> None:
    """JPEG, PNG or TIFF; 16 bit (which JPEG can't) without EXIF."""
    if shot.pixels.dtype == np.uint16:
        import cv2

        cv2.imwrite(str(path), np.ascontiguousarray(shot.pixels[:, :, ::-1]))
        return
    from PIL import Image

    facts = exif_of(shot.facts, position) if exif else Image.Exif()
    Image.fromarray(shot.pixels).save(path, quality=quality, subsampling=0, exif=facts.tobytes())


def as_dual(shots: Shots, turns: tuple[int, int] = (0, 0)) -> tuple[tuple[Photograph, ...], Circle, Circle]:
    """The same as of a camera with two lenses: both circles in one picture, front left, a shot an exposure.

    `turns`: each half is turned by so many right angles, counter-clockwise. Both circles as they then lie.
    """
    made, circles = [], []
    for front, back in zip(shots.front, shots.back, strict=True):
        halves = [np.rot90(one.pixels, k) for one, k in zip((front, back), turns, strict=True)]
        height = max(half.shape[0] for half in halves)
        full = [np.pad(half, ((0, height - half.shape[0]), (0, 0), (0, 0))) for half in halves]
        pixels = np.ascontiguousarray(np.concatenate(full, axis=1))
        digest = hashlib.sha256(pixels.tobytes()).hexdigest()
        facts = replace(front.facts, name=front.facts.name.replace("front", "dual"))
        made.append(Photograph(pixels, facts, digest))
    right = 0
    for side, half, k in zip((shots.truth.front, shots.truth.back), halves, turns, strict=True):
        circle = _turned(side.circle, side.light.shape[:2], k)
        circles.append(replace(circle, x=circle.x + right))
        right += half.shape[1]
    return tuple(made), circles[0], circles[1]


def _turned(circle: Circle, shape: tuple[int, ...], turns: int) -> Circle:
    height, width = shape[:2]
    for _ in range(turns % 4):
        circle = replace(circle, x=circle.y, y=width - circle.x)
        height, width = width, height
    return circle


def exif_of(facts: ShotFacts, position: bool = False):  # type: ignore[no-untyped-def]  # PIL's Exif
    """What a camera writes: make, model, time, exposure, ISO, aperture, bias."""
    from PIL import Image
    from PIL.TiffImagePlugin import IFDRational

    made = Image.Exif()
    made[271], made[272] = "Lucarne", facts.camera
    taken = START + timedelta(seconds=facts.taken or 0.0)
    part = made.get_ifd(_EXIF)
    part[36867] = taken.strftime("%Y:%m:%d %H:%M:%S")
    part[37521] = f"{taken.microsecond // 10_000:02d}"
    if facts.seconds is not None:
        part[33434] = IFDRational(round(facts.seconds * 1_000_000), 1_000_000)
    if facts.aperture is not None:
        part[33437] = IFDRational(round(facts.aperture * 100), 100)
    if facts.iso is not None:
        part[34855] = round(facts.iso)
    if facts.bias is not None:
        part[37380] = IFDRational(round(facts.bias * 100), 100)
    if position:
        gps = made.get_ifd(_GPS)
        gps[1], gps[2] = "N", (35.0, 40.0, 34.0)
        gps[3], gps[4] = "E", (139.0, 39.0, 1.0)
    return made
