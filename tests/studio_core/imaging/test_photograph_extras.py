"""HEIC and raw photographs by the extras; and what is said where those are not installed."""

from __future__ import annotations

import io
import struct
import sys

import numpy as np
import pytest
from photo_support import picture, shot_exif

from studio_core.errors import InputError
from studio_core.imaging.decode import Limits, Unreadable
from studio_core.imaging.photograph_decode import decode_photograph
from studio_core.imaging.photograph_read import read_photograph

TALL = (64, 48)


def mosaic(light: np.ndarray, black: int = 512, white: int = 4095) -> bytes:
    """The smallest DNG file: an RGGB mosaic of linear (H, W, 3) light, sRGB's primaries."""
    height, width = light.shape[:2]
    cells = np.empty((height, width), np.float64)
    for (row, column), channel in {(0, 0): 0, (0, 1): 1, (1, 0): 1, (1, 1): 2}.items():
        cells[row::2, column::2] = light[row::2, column::2, channel]
    strip = np.rint(black + np.clip(cells, 0, 1) * (white - black)).astype("<u2").tobytes()
    xyz_to_rgb = [3.2405, -1.5371, -0.4985, -0.9693, 1.8760, 0.0416, 0.0556, -0.2040, 1.0572]
    matrix = b"".join(struct.pack("<2i", round(v * 10000), 10000) for v in xyz_to_rgb)
    ones = struct.pack("<6I", *(1, 1) * 3)
    entries = [
        (254, 4, 1, struct.pack("<I", 0)),
        (256, 4, 1, struct.pack("<I", width)),
        (257, 4, 1, struct.pack("<I", height)),
        (258, 3, 1, struct.pack("<H", 16)),
        (259, 3, 1, struct.pack("<H", 1)),
        (262, 3, 1, struct.pack("<H", 32803)),
        (271, 2, 5, b"Acme\0"),
        (272, 2, 7, b"Phone3\0"),
        (273, 4, 1, b"DATA"),
        (274, 3, 1, struct.pack("<H", 1)),
        (277, 3, 1, struct.pack("<H", 1)),
        (278, 4, 1, struct.pack("<I", height)),
        (279, 4, 1, struct.pack("<I", len(strip))),
        (33421, 3, 2, struct.pack("<2H", 2, 2)),
        (33422, 1, 4, bytes([0, 1, 1, 2])),
        (34665, 4, 1, b"EXIF"),
        (50706, 1, 4, bytes([1, 4, 0, 0])),
        (50708, 2, 7, b"Phone3\0"),
        (50714, 3, 1, struct.pack("<H", black)),
        (50717, 3, 1, struct.pack("<H", white)),
        (50721, 10, 9, matrix),
        (50728, 5, 3, ones),
        (50778, 3, 1, struct.pack("<H", 21)),
    ]
    behind = 8 + 2 + 12 * len(entries) + 4
    told = struct.pack("<2I", 1, 25)
    details = struct.pack("<HHHIIHHIHHI", 2, 0x829A, 5, 1, behind, 0x8827, 3, 1, 320, 0, 0)
    tail = told + details
    place = {b"EXIF": behind + len(told)}
    values = []
    for tag, kind, count, data in entries:
        if len(data) > 4:
            values.append((tag, kind, count, struct.pack("<I", behind + len(tail))))
            tail += data + b"\0" * (len(data) % 2)
        else:
            values.append((tag, kind, count, data))
    place[b"DATA"] = behind + len(tail)
    head = b"II*\0" + struct.pack("<IH", 8, len(entries))
    for tag, kind, count, data in values:
        cell = struct.pack("<I", place[data]) if data in place else data.ljust(4, b"\0")
        head += struct.pack("<HHI", tag, kind, count) + cell
    return head + struct.pack("<I", 0) + tail + strip


def heic(pixels: np.ndarray, exif: bytes = b"") -> bytes:
    import pillow_heif

    file, out = pillow_heif.from_bytes("RGB", pixels.shape[1::-1], pixels.tobytes()), io.BytesIO()
    file.save(out, quality=-1, chroma=444, exif=exif or None)
    return out.getvalue()


def test_a_heic_photograph_is_read_with_its_exposure() -> None:
    pixels = picture(*TALL)
    read = read_photograph(heic(pixels, b"Exif\0\0" + shot_exif(private=True)), "IMG_1.HEIC")
    assert read.kind == "8 bit"
    assert read.pixels.shape == pixels.shape
    assert np.abs(read.pixels.astype(int) - pixels).mean() < 2
    assert (read.facts.seconds, read.facts.iso, read.facts.camera) == (1 / 50, 200, "Acme Phone 3")


def test_a_damaged_heic_photograph_is_refused() -> None:
    data = heic(picture(*TALL))
    for harm in (data[:-200], data[:60]):
        with pytest.raises(InputError, match=r"^it\.heic cannot be read: "):
            read_photograph(harm, "it.heic")


def test_a_raw_photograph_is_linear_light_without_its_black() -> None:
    light = np.ones((*TALL, 3)) * np.linspace(0, 0.9, TALL[1])[None, :, None]
    read = read_photograph(mosaic(light), "IMG_1.dng")
    assert read.kind == "linear"
    height, width = read.size[1], read.size[0]
    assert (height, width) == TALL
    np.testing.assert_allclose(read.pixels[8:-8, 8:-8], light[8:-8, 8:-8], atol=0.01)
    assert (read.facts.seconds, read.facts.iso, read.facts.camera) == (1 / 25, 320, "Acme Phone3")


def test_shots_of_a_raw_bracket_share_one_scale() -> None:
    """Each is brightest elsewhere, which must not stretch it."""
    light = np.full((*TALL, 3), 0.2)
    dim, bright = (read_photograph(mosaic(light * k), "a.dng").pixels for k in (1, 2))
    np.testing.assert_allclose(bright[8:-8, 8:-8], 2 * dim[8:-8, 8:-8], rtol=0.01)


def test_a_damaged_raw_photograph_is_refused() -> None:
    with pytest.raises(InputError, match="damaged, or of a camera that is not known"):
        read_photograph(b"II*\0" + b"\0" * 60, "a.dng")


@pytest.mark.parametrize(
    ("library", "name", "extra"), [("rawpy", "a.dng", "raw"), ("pillow_heif", "a.heic", "heic")]
)
def test_a_missing_extra_is_named(
    library: str, name: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)  # as if it were not installed
    with pytest.raises(Unreadable, match=rf'need the extra "{extra}": pip install "lucarne\[{extra}\]"$'):
        decode_photograph(name, Limits())
