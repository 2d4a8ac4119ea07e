"""Photographs made for tests: files with Exif of any kind, sound and damaged."""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Entry = tuple[int, Any]
SHORT, LONG, ASCII, RATIONAL, SIGNED = 3, 4, 2, 5, 10
GPS_WORDS = (b"\x00\x00\x00\x30\x00\x00\x00\x01", b"WITNESS", b"secret-serial", b"Jane Doe")


def exif_block(
    picture: Mapping[int, Entry] | None = None,
    details: Mapping[int, Entry] | None = None,
    position: Mapping[int, Entry] | None = None,
    order: str = ">",
) -> bytes:
    """A TIFF block: tag → (type, value); rationals are pairs or lists of pairs."""
    pointers = [(0x8769, details), (0x8825, position)]
    first: dict[int, Entry] = dict(picture or {})
    first.update({tag: (LONG, 0) for tag, entries in pointers if entries is not None})
    header = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8)
    at = 8 + len(_directory(first, 8, order))
    rest = b""
    for tag, entries in pointers:
        if entries is not None:
            first[tag] = (LONG, at + len(rest))
            rest += _directory(entries, at + len(rest), order)
    return header + _directory(first, 8, order) + rest


def _directory(entries: Mapping[int, Entry], offset: int, order: str) -> bytes:
    head, tail = struct.pack(order + "H", len(entries)), b""
    behind = offset + 2 + 12 * len(entries) + 4
    for tag, (kind, value) in sorted(entries.items()):
        data, count = _packed(kind, value, order)
        if len(data) <= 4:
            cell = data.ljust(4, b"\0")
        else:
            cell = struct.pack(order + "I", behind + len(tail))
            tail += data + b"\0" * (len(data) % 2)
        head += struct.pack(order + "HHI", tag, kind, count) + cell
    return head + struct.pack(order + "I", 0) + tail


def _packed(kind: int, value: Any, order: str) -> tuple[bytes, int]:
    if kind in (ASCII, 7):
        data = value if isinstance(value, bytes) else str(value).encode() + b"\0"
        return data, len(data)
    if kind in (RATIONAL, SIGNED):
        pairs: Sequence[tuple[int, int]] = value if isinstance(value, list) else [value]
        code = "2I" if kind == RATIONAL else "2i"
        return b"".join(struct.pack(order + code, *pair) for pair in pairs), len(pairs)
    return struct.pack(order + ("H" if kind == SHORT else "I"), value), 1


def shot_exif(
    seconds: tuple[int, int] | None = (1, 50),
    iso: int | None = 200,
    aperture: tuple[int, int] | None = (18, 10),
    *,
    bias: tuple[int, int] | None = None,
    taken: str = "",
    part: str = "",
    orientation: int = 1,
    private: bool = False,
) -> bytes:
    """Exif as phones write it; `private` adds position, owner, serial number and maker's notes."""
    picture: dict[int, Entry] = {
        0x010F: (ASCII, "Acme"),
        0x0110: (ASCII, "Acme Phone 3"),
        0x0112: (SHORT, orientation),
    }
    details: dict[int, Entry] = {0xA434: (ASCII, "Acme Phone 3 back camera")}
    if seconds:
        details[0x829A] = (RATIONAL, seconds)
    if iso:
        details[0x8827] = (SHORT, iso)
    if aperture:
        details[0x829D] = (RATIONAL, aperture)
    if bias:
        details[0x9204] = (SIGNED, bias)
    if taken:
        details[0x9003] = (ASCII, taken)
    if part:
        details[0x9291] = (ASCII, part)
    position = None
    if private:
        picture[0x013B] = (ASCII, "Jane Doe")
        details[0x927C] = (7, b"WITNESS maker's notes " * 20)
        details[0xA431] = (ASCII, "secret-serial")
        position = {1: (ASCII, "N"), 2: (RATIONAL, [(48, 1), (51, 1), (30, 1)])}
    return exif_block(picture, details, position)


def picture(height: int = 40, width: int = 60, seed: int = 0) -> np.ndarray:
    """(height, width, 3) uint8 with soft structure and no symmetry."""
    import cv2

    coarse = np.random.default_rng(seed).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


def encoded(pixels: np.ndarray, form: str = "JPEG", **options: Any) -> bytes:
    """A file of these pixels by Pillow."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, form, **options)
    return file.getvalue()


def jpeg(pixels: np.ndarray, exif: bytes = b"", **options: Any) -> bytes:
    """A JPEG file with this Exif block."""
    made = encoded(pixels, quality=92, **options)
    return with_segment(made, 0xE1, b"Exif\0\0" + exif) if exif else made


def with_segment(data: bytes, marker: int, body: bytes) -> bytes:
    """A JPEG file with one more segment at its beginning."""
    return data[:2] + bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body + data[2:]


def private_jpeg(pixels: np.ndarray, orientation: int = 6, **options: Any) -> bytes:
    """A JPEG file as a phone writes it: position, maker's notes, previews, XMP, a film behind the picture."""
    exif = shot_exif(taken="2024:05:06 07:08:09", part="123", orientation=orientation, private=True)
    exif += b"WITNESS" + encoded(picture(8, 8))
    data = jpeg(pixels, exif, **options)
    data = with_segment(data, 0xE1, b"http://ns.adobe.com/xap/1.0/\0<x>WITNESS GPSLatitude</x>")
    data = with_segment(data, 0xE2, b"MPF\0WITNESS")
    data = with_segment(data, 0xED, b"Photoshop 3.0\0WITNESS")
    data = with_segment(data, 0xFE, b"WITNESS: a comment")
    return data + b"WITNESS, a film: " + encoded(picture(8, 8))
