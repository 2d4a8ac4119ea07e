"""The bytes of a JPEG or PNG file without what they tell besides the picture.

Position, owner, maker's notes, previews, comments, and whatever hangs behind the picture (gain maps, the
film of a "live" photograph) go; the compressed picture is copied byte for byte, with its colour profile and
how it is to be turned. Sources: ITU-T T.81, annex B; PNG (third edition), section 5.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from studio_core.imaging.exif import orientation_block, read_exif

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8"
_SCAN_END = re.compile(rb"\xff+[^\x00\xff\xd0-\xd7]", re.DOTALL)
_MARKER = re.compile(rb"\xff+[^\x00\xff]", re.DOTALL)
_ALONE = {0x01, *range(0xD0, 0xD9)}  # markers that nothing follows
_END, _SCAN, _COMMENT = 0xD9, 0xDA, 0xFE
_LAST = b"\xff\xd9"
_SEQUENTIAL = (0xC0, 0xC1)
_PNG_KEPT = {b"tRNS", b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"sBIT"}


@dataclass(frozen=True)
class Bare:
    """`data`: the bare file; `exif`: the Exif block of the file that it was made from, b"" without one."""

    data: bytes
    exif: bytes = b""


def strip(data: bytes) -> Bare | None:
    """The bare file of a JPEG or PNG file; None for other files and where no picture is in it.

    Its pixels are the same, bit for bit. A JPEG file of a single scan that lacks nothing but its end gets
    one; in one of several scans nobody could tell what else is missing.
    """
    if data.startswith(JPEG):
        return _jpeg(data)
    return _png(data) if data.startswith(PNG) else None


def exif_of(data: bytes) -> bytes:
    """The Exif block of a WebP or TIFF file (which is one), or of one that `strip` knows; b"" for none."""
    if data[:4] in (b"II*\0", b"MM\0*"):
        return data
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return next((body for name, body in _riff(data) if name == b"EXIF"), b"")
    made = strip(data)
    return made.exif if made else b""


def _jpeg(data: bytes) -> Bare | None:
    kept: list[bytes] = []
    exif, components, end = b"", b"", b""
    scans, single = 0, False
    for marker, segment in _segments(data):
        if marker == _END:
            end = segment
            break
        scans += marker == _SCAN
        if marker in _SEQUENTIAL:
            components = segment[9:10]
        single = single or (marker == _SCAN and scans == 1 and segment[4:5] == components != b"")
        if marker == 0xE1 and segment[4:10] == b"Exif\0\0":
            exif = exif or segment[10:]
        elif marker == 0xE0 and segment[4:9] == b"JFIF\0" and len(segment) >= 18:
            kept.append(b"\xff\xe0\0\x10" + segment[4:16] + b"\0\0")  # without its thumbnail
        elif (
            (marker == 0xE2 and segment[4:16] == b"ICC_PROFILE\0")
            or (marker == 0xEE and segment[4:9] == b"Adobe")
            or not (0xE0 <= marker <= 0xEF or marker == _COMMENT)
        ):
            kept.append(segment)
    if not scans:
        return None
    turn = read_exif(exif).orientation
    if turn != 1:
        block = b"Exif\0\0" + orientation_block(turn)
        kept.insert(0, b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block)
    return Bare(JPEG + b"".join(kept) + (_LAST if single else end), exif)


def _segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Marker and bytes of each segment to the first end; a scan's segment holds the scan too."""
    at = 2
    while found := _MARKER.search(data, at):
        marker, at = found[0][-1], found.end()
        if marker == _END:
            yield marker, _LAST
            return
        if marker in _ALONE:
            continue
        if at + 2 > len(data):
            return
        end = at + max(struct.unpack_from(">H", data, at)[0], 2)
        if end > len(data):  # cut off
            return
        body = data[at:end]
        if marker == _SCAN:
            behind = _SCAN_END.search(data, end)
            body += data[end : behind.start()] if behind else data[end:].rstrip(b"\xff")
            end = behind.start() if behind else len(data)
        yield marker, b"\xff" + bytes([marker]) + body
        at = end


def _png(data: bytes) -> Bare | None:
    kept: list[bytes] = []
    exif, pictures, at = b"", 0, len(PNG)
    while at + 12 <= len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        chunk = data[at : at + 12 + length]
        if len(chunk) < 12 + length:
            kept.append(chunk)  # cut off: for the decoder to find
            break
        if name == b"eXIf":
            exif = chunk[8:-4]
        elif name in _PNG_KEPT or not name[0] & 0x20:  # or critical
            kept.append(chunk)
        pictures += name == b"IDAT"
        at += len(chunk)
        if name == b"IEND":
            break
    if not pictures:
        return None
    turn = read_exif(exif).orientation
    if turn != 1:
        body = b"eXIf" + orientation_block(turn)
        kept.insert(1, struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body)))
    return Bare(PNG + b"".join(kept), exif)


def _riff(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 12
    while at + 8 <= len(data):
        name, length = struct.unpack_from("<4sI", data, at)
        yield name, data[at + 8 : at + 8 + length]
        at += 8 + length + length % 2
