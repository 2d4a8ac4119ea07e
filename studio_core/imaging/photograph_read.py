"""Reading photographs: encoded numbers and what Exif tells, whatever file they come in.

The file's bytes are read once; JPEG and PNG are decoded from their bare bytes (`bare`), so that what a
project keeps gives the same pixels.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.arrays import content_hash
from studio_core.errors import InputError
from studio_core.imaging.bare import exif_of, strip
from studio_core.imaging.decode import Facts
from studio_core.imaging.exif import Told, exposure, plausible, read_exif
from studio_core.imaging.io import EXTENSIONS, ImageDecoder, suffix_of
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.photograph_decode import HEIC, RAW
from studio_core.imaging.radiance import HEADER, parse_header, with_format
from studio_core.shading.job import Job

PHOTOGRAPHS = tuple(sorted({*EXTENSIONS, *HEIC, *RAW}))
"""File name extensions of photographs, lower case with the dot; some need extras."""
LEAST = 16
"""Pixels across the smallest picture that is a photograph."""
_LARGEST = 1 << 30
_HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1", b"heif")


def read_photograph(
    source: str | os.PathLike[str] | bytes, name: str = "", decoder: ImageDecoder | None = None
) -> Photograph:
    """A photograph from a file, or from a file's bytes that messages call `name`.

    Whole numbers of 8 or 16 bits stay as the camera encoded them; floating-point and raw files are linear.
    Grey becomes three channels, alpha goes, Exif's orientation is applied. Exif that makes no sense counts
    as not told; positions are never read. Without a `decoder` one is started for this photograph alone.
    Raises InputError, one sentence that names file and cause.
    """
    if decoder is None:
        with ImageDecoder() as made:
            return read_photograph(source, name, made)
    if isinstance(source, bytes):
        data, called = source, name or "the photograph"
    else:
        data, called = read_bytes(source), name or str(source)
    suffix = kind_of(data, called)
    bare = strip(data)
    if bare is None and suffix in (".jpg", ".png"):
        raise InputError(f"{called} cannot be read: it is damaged or incomplete (no picture is in it)")
    decoded = bare.data if bare else data
    if suffix == ".hdr" and not parse_header(data[:HEADER]).format:
        decoded = with_format(data)
    pixels, facts = decoder.photograph(decoded, suffix, called)
    height, width = pixels.shape[:2]
    if min(height, width) < LEAST:
        raise InputError(f"{called} cannot be used: {width} × {height} pixels are no photograph")
    if pixels.dtype == np.float32:
        if not (np.isfinite(pixels.min()) and np.isfinite(pixels.max())):
            brightest = pixels.max(initial=0.0, where=np.isfinite(pixels))
            pixels = np.nan_to_num(pixels, nan=0.0, posinf=brightest, neginf=0.0)
        pixels = np.maximum(pixels, np.float32(0))
        pixels.flags.writeable = False
    exif = base64.b64decode(facts.exif) or (bare.exif if bare else exif_of(data))
    shot = replace(_facts(facts, read_exif(exif)), name=Path(called).name)
    digest = content_hash(np.frombuffer(data, np.uint8))
    return Photograph(pixels, shot, digest, tuple(facts.notes), tuple(facts.colour))


def read_photographs(
    paths: Iterable[str | os.PathLike[str]], decoder: ImageDecoder | None = None, job: Job | None = None
) -> tuple[list[Photograph], list[str]]:
    """Those that can be read, in the given order, and for each other one its sentence."""
    if decoder is None:
        with ImageDecoder() as made:
            return read_photographs(paths, made, job)
    photographs, problems = [], []
    chosen = list(paths)
    for done, path in enumerate(chosen):
        if job is not None:
            job.checkpoint(done, len(chosen))
        try:
            photographs.append(read_photograph(path, decoder=decoder))
        except InputError as error:
            problems.append(str(error))
    return photographs, problems


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """A file's bytes; InputError naming it when it cannot be read or is no photograph by its size."""
    path = Path(path)
    try:
        if not path.is_file():
            raise InputError(f"{path} cannot be read: there is no such file")
        size = path.stat().st_size
        if size > _LARGEST:
            raise InputError(f"{path} cannot be read: {size / 1e9:.1f} GB are more than a photograph has")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{str(path)!r} cannot be read: {error}") from None


def kind_of(data: bytes, name: str) -> str:
    """The extension by which the bytes are decoded: content first, `name` where content is not enough."""
    if not data:
        raise InputError(f"{name} cannot be read: the file is empty")
    given = Path(name).suffix.lower()[:8] if "\0" not in name else ""
    found = suffix_of(data[:HEADER], given)
    if data[4:8] == b"ftyp" and data[8:12] in _HEIC_BRANDS:
        return HEIC[0]
    if given in RAW and found in (None, ".tif", ".tiff", ".tx"):
        return given
    if found is None:
        raise InputError(f"{name} cannot be read: it is no photograph of a known format")
    return ".jpg" if data.startswith(b"\xff\xd8") else found


def _facts(facts: Facts, told: Told) -> ShotFacts:
    """What Exif tells, and where it is silent what the decoder found."""
    if not facts.told:
        return told.facts
    also: dict[str, Any] = dict(exposure(*(facts.told.get(n) for n in ("seconds", "iso", "aperture"))))
    also["taken"] = plausible(facts.told.get("taken"), 1, 1e11)
    return replace(told.facts, **{n: v for n, v in also.items() if getattr(told.facts, n) is None})
