"""Exif: what a photograph says about its exposure, and nothing else.

Only the tags named here are looked at. The position (tag 0x8825 and what it leads to), owner, serial numbers
and maker's notes are never read. Source: CIPA DC-008 (Exif 2.32), TIFF 6.0.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from studio_core.imaging.photograph import ShotFacts

_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 9: 4, 10: 8}
_CODES = {1: "B", 3: "H", 4: "I", 5: "I", 9: "i", 10: "i"}
_LONGEST = 256  # bytes of one value
_DETAILS = 0x8769
_PICTURE = {0x010F: "make", 0x0110: "model", 0x0112: "orientation", 0x0132: "changed", _DETAILS: "details"}
_EXPOSURE = {
    0x829A: "time",
    0x829D: "f",
    0x8827: "iso",
    0x8831: "standard_sensitivity",
    0x8832: "recommended_index",
    0x8833: "iso_speed",
    0x9003: "original",
    0x9004: "digitized",
    0x9201: "shutter_apex",
    0x9202: "aperture_apex",
    0x9204: "bias",
    0x9290: "changed_part",
    0x9291: "original_part",
    0x9292: "digitized_part",
    0xA434: "lens",
}
_ISO_UNTOLD = 65535  # what the 16 bits of the tag hold when the number is larger


@dataclass(frozen=True)
class Told:
    """What an Exif block tells: the facts without the file's name."""

    facts: ShotFacts = ShotFacts("")

    @property
    def orientation(self) -> int:
        """Exif's, 1 … 8."""
        return self.facts.orientation


def read_exif(block: bytes) -> Told:
    """What a block tells that begins with TIFF's header, or with "Exif" before it.

    Whatever is damaged, impossible (0/0, negative, a day 32) or beyond what cameras do counts as not told.
    """
    if block[:6] in (b"Exif\0\0", b"Exif\0\xff"):
        block = block[6:]
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(block[:4])
    if order is None or len(block) < 8:
        return Told()
    first = _entries(block, order, struct.unpack(order + "I", block[4:8])[0], _PICTURE)
    details = first.pop("details", None)
    told = first | (_entries(block, order, details, _EXPOSURE) if isinstance(details, int) else {})
    return Told(_facts(told))


def orientation_block(orientation: int) -> bytes:
    """The smallest block that tells an orientation, without "Exif" before it."""
    return b"MM\0*\0\0\0\x08\0\x01" + struct.pack(">HHIHHI", 0x0112, 3, 1, orientation, 0, 0)


def plausible(value: Any, least: float, most: float) -> float | None:
    """The number, or None when it is none or not between the bounds."""
    if not isinstance(value, int | float) or not least <= value <= most:
        return None
    return float(value)


def exposure(seconds: Any, iso: Any, aperture: Any) -> dict[str, float | None]:
    """The three numbers of an exposure where they are possible."""
    return {
        "seconds": plausible(seconds, 1e-7, 1e5),
        "iso": plausible(iso, 1, 1e7),
        "aperture": plausible(aperture, 0.3, 200),
    }


def camera_name(make: str, model: str) -> str:
    """Make and model, the make once."""
    first = make.split(" ")[0].lower()
    return model if first and model.lower().startswith(first) else f"{make} {model}".strip()


def _entries(block: bytes, order: str, offset: int, wanted: Mapping[int, str]) -> dict[str, Any]:
    """The wanted tags of a directory, by name; entries that lead outside the block are passed over."""
    found: dict[str, Any] = {}
    if offset + 2 > len(block):
        return found
    count = struct.unpack_from(order + "H", block, offset)[0]
    for at in range(offset + 2, min(offset + 2 + 12 * count, len(block) - 11), 12):
        tag, kind, number = struct.unpack_from(order + "HHI", block, at)
        name, size = wanted.get(tag), _SIZES.get(kind, 0) * number
        if name is None or name in found or not 0 < size <= _LONGEST:
            continue
        start = at + 8 if size <= 4 else struct.unpack_from(order + "I", block, at + 8)[0]
        data = block[start : start + size]
        if len(data) == size:
            value = _value(data, order, kind)
            if value is not None:
                found[name] = value
    return found


def _value(data: bytes, order: str, kind: int) -> int | float | str | None:
    """The first number of an entry, or its text; None for what is no number."""
    if kind in (2, 7):
        text = data.split(b"\0")[0].decode("utf-8", "replace")
        return "".join(c for c in text if c.isprintable()).strip()
    numbers = struct.unpack_from(order + _CODES[kind] * (2 if kind in (5, 10) else 1), data)
    if len(numbers) == 1:
        return int(numbers[0])
    return numbers[0] / numbers[1] if numbers[1] else None


def _facts(told: Mapping[str, Any]) -> ShotFacts:
    seconds, aperture = told.get("time"), told.get("f")
    if plausible(seconds, 1e-7, 1e5) is None:
        apex = plausible(told.get("shutter_apex"), -17, 24)
        seconds = None if apex is None else 2.0**-apex
    if plausible(aperture, 0.3, 200) is None:
        apex = plausible(told.get("aperture_apex"), -3, 16)
        aperture = None if apex in (None, 0) else 2.0 ** (apex / 2)  # 0: a lens that says nothing
    names = ("iso", "recommended_index", "standard_sensitivity", "iso_speed")
    speeds = [told[name] for name in names if name in told and told[name] != _ISO_UNTOLD]
    speed = next((s for s in speeds if plausible(s, 1, 1e7)), None)
    turn = told.get("orientation")
    return ShotFacts(
        name="",
        orientation=turn if isinstance(turn, int) and 1 <= turn <= 8 else 1,
        **exposure(seconds, speed, aperture),
        bias=plausible(told.get("bias"), -20, 20),
        taken=_taken(told),
        camera=camera_name(_text(told, "make"), _text(told, "model")),
        lens=_text(told, "lens"),
    )


def _text(told: Mapping[str, Any], name: str) -> str:
    value = told.get(name, "")
    return value[:64] if isinstance(value, str) else ""


def _taken(told: Mapping[str, Any]) -> float | None:
    """Seconds of the camera's clock; the offset from UTC is left aside: it is the same for a bracket."""
    for name in ("original", "digitized", "changed"):
        try:
            whole = datetime.strptime(_text(told, name)[:19], "%Y:%m:%d %H:%M:%S")
        except ValueError:
            continue
        part = _text(told, name + "_part")
        fraction = float("0." + part) if part.isascii() and part.isdigit() else 0.0
        return (whole - datetime(1970, 1, 1)).total_seconds() + fraction
    return None
