"""Headers of Radiance pictures: what the decoder library leaves unread.

Source: the file format chapter of Ward Larson and Shakespeare, Rendering with Radiance (1998).
"""

from __future__ import annotations

from dataclasses import dataclass

HEADER = 1 << 16
"""Bytes in which a header must end."""


@dataclass(frozen=True)
class RadianceHeader:
    """`exposure` is the product of all EXPOSURE lines: radiance = pixel / exposure."""

    format: str = ""
    exposure: float = 1.0
    primaries: tuple[float, ...] | None = None


def parse_header(start: bytes) -> RadianceHeader:
    """The header at the start of a file; lines that make no sense are passed over."""
    form, exposure, primaries = "", 1.0, None
    for line in start[:HEADER].split(b"\n\n")[0].decode("latin-1").splitlines():
        key, equals, value = line.partition("=")
        if not equals:
            continue
        try:
            if key == "FORMAT":
                form = value.strip()
            elif key == "EXPOSURE":
                exposure *= float(value)
            elif key == "PRIMARIES" and len(value.split()) == 8:
                primaries = tuple(float(v) for v in value.split())
        except ValueError:
            continue
    return RadianceHeader(form, exposure if 0 < exposure < float("inf") else 1.0, primaries)


def with_format(data: bytes) -> bytes:
    """The file with the FORMAT line that some writers leave out (it is RGBE then)."""
    first, newline, rest = data.partition(b"\n")
    return first + newline + b"FORMAT=32-bit_rle_rgbe\n" + rest
