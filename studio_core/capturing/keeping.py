"""Photographs in the project: kept without what they tell about people and places, and recalled bit for bit.

JPEG and PNG files are kept whole in the project, bare (`studio_core.imaging.bare`); other files (TIFF, HEIC,
raw, EXR) stay where they are, and the project remembers where that is and what they were.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash
from studio_core.errors import InputError
from studio_core.imaging.bare import strip
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import Photograph, in_rec709
from studio_core.imaging.photograph_read import read_bytes, read_photograph
from studio_core.imaging.resample import thumbnail_size
from studio_core.imaging.transfer import linear_to_srgb, srgb_to_linear
from studio_core.scene.capture import KeptPhotograph
from studio_core.scene.geometry import Image
from studio_core.shading.job import Job

THUMBNAIL = 160
"""Pixels along the long side."""


def take(
    path: str | os.PathLike[str], decoder: ImageDecoder | None = None, *, tell_path: bool = True
) -> tuple[Photograph, KeptPhotograph]:
    """Read a photograph's file once: to work with, and for the project.

    `tell_path`: the project may say where the file is; a file that it cannot hold is lost to it otherwise.
    Raises InputError, one sentence that names the file.
    """
    data = read_bytes(path)
    photograph = read_photograph(data, str(path), decoder)
    return photograph, keep(data, photograph, str(Path(path).resolve()) if tell_path else "")


def take_all(
    paths: Iterable[str | os.PathLike[str]], decoder: ImageDecoder | None = None, job: Job | None = None
) -> tuple[list[tuple[Photograph, KeptPhotograph]], list[str]]:
    """Those that can be read, in the given order, and for each other one its sentence."""
    if decoder is None:
        with ImageDecoder() as made:
            return take_all(paths, made, job)
    taken, problems = [], []
    chosen = list(paths)
    for done, path in enumerate(chosen):
        if job is not None:
            job.checkpoint(done, len(chosen))
        try:
            taken.append(take(path, decoder))
        except InputError as error:
            problems.append(str(error))
    return taken, problems


def keep(data: bytes, photograph: Photograph, path: str = "") -> KeptPhotograph:
    """What the project holds of a photograph whose file has these bytes."""
    bare = strip(data)
    held = None
    if bare is not None:
        held = Image(np.frombuffer(bare.data, np.uint8).reshape(1, -1, 1), "data")
    return KeptPhotograph(
        photograph.digest, photograph.facts, photograph.size, thumbnail(photograph), path, held
    )


def recall(
    kept: KeptPhotograph,
    folder: str | os.PathLike[str] | None = None,
    decoder: ImageDecoder | None = None,
) -> Photograph:
    """The photograph with the pixels, facts and digest that it had when it was kept.

    Files that the project does not hold are looked for where they were, relative to the project's `folder`,
    and beside it. Raises InputError when there is none, or it is another file now.
    """
    name = kept.facts.name or "A photograph"
    if kept.data is not None:
        data = kept.data.pixels.tobytes()
    else:
        data = _found(kept, name, folder)
    read = read_photograph(data, kept.path or name, decoder)
    return replace(read, facts=kept.facts, digest=kept.digest)


def thumbnail(photograph: Photograph) -> Image:
    """A small picture of it, sRGB; linear photographs as they are, without exposure."""
    import cv2

    width, height = photograph.size
    height, width = thumbnail_size(height, width, THUMBNAIL)
    small: npt.NDArray[Any] = cv2.resize(photograph.pixels, (width, height), interpolation=cv2.INTER_AREA)
    if photograph.kind == "linear":
        return Image(linear_to_srgb(in_rec709(small, photograph.colour)), "srgb")
    shown: npt.NDArray[np.uint8] = small if small.dtype == np.uint8 else (small >> 8).astype(np.uint8)
    if photograph.colour:
        shown = linear_to_srgb(in_rec709(srgb_to_linear(shown), photograph.colour))
    return Image(shown, "srgb")


def _found(kept: KeptPhotograph, name: str, folder: str | os.PathLike[str] | None) -> bytes:
    """The bytes of the file that a photograph was; a changed one is refused."""
    if not kept.path:
        raise InputError(f"{name} is not in the project, and where it was is not known: add it again")
    where = Path(kept.path)
    places = [where if folder is None else Path(folder) / where]
    if folder is not None:
        places.append(Path(folder) / where.name)
    changed = None
    for place in places:
        try:
            data = read_bytes(place)
        except InputError:
            continue
        if content_hash(np.frombuffer(data, np.uint8)) == kept.digest:
            return data
        changed = changed or place
    if changed is not None:
        raise InputError(f"{changed} is not the photograph any more that the capture was made from")
    raise InputError(f"{places[0]} cannot be found: put the photograph back or add it again")
