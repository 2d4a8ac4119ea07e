"""Bidirectional texture functions: pictures of a flat sample under pairs of directions, light and view.

A `Btf` is never held in memory: pictures come in blocks, in the order asked for. Values are as everywhere in
this package (radiance under a light of strength 1, the cosine in them), x to the right of the picture, y up,
z off the sample; a direction's φ counts from x towards y.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_plugins.residual.samples import F32, F64, Flags

Indices = npt.NDArray[np.intp]
BLOCK = 24_000_000
"""Bytes of a block of pictures, about."""


@dataclass(frozen=True, eq=False)
class Block:
    """Pictures (b, h, w, 3) of the given `indices` (b,); where they are clipped (b, h, w; None: nowhere)."""

    indices: Indices
    values: F32
    clipped: Flags | None = None


class Btf(Protocol):
    """Pictures under pairs of directions."""

    lights: F64
    """(m, 3) unit vectors towards the light of each picture."""
    views: F64
    """(m, 3) and towards the camera."""
    size: tuple[int, int]
    """Height and width."""
    source: str
    """What it was read from, in a word."""
    notes: tuple[str, ...]
    """Sentences about what was noticed."""

    def blocks(self, which: Indices) -> Iterator[Block]:
        """The pictures of these indices, in this order, a block at a time."""
        ...


def directions(theta: npt.ArrayLike, phi: npt.ArrayLike) -> F64:
    """(..., 3) unit vectors of polar angles from z and azimuths from x towards y, radians."""
    t, p = np.broadcast_arrays(np.asarray(theta, np.float64), np.asarray(phi, np.float64))
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def hemisphere_81() -> F64:
    """(81, 3) directions of Bonn's measurements of 2003: rings of 1, 6, 12, 18, 20, 24 at 0 … 75° by 15°."""
    rings = [(0, 1), (15, 6), (30, 12), (45, 18), (60, 20), (75, 24)]
    made = [directions(np.radians(t), 2 * np.pi * np.arange(n) / n) for t, n in rings]
    return np.concatenate(made)


def block_size(size: tuple[int, int]) -> int:
    """How many pictures of this height and width make a block."""
    return int(np.clip(BLOCK // (size[0] * size[1] * 12), 1, 256))


def is_btf(path: str | Path) -> bool:
    """Whether it is a BTF: a `.btf` file, a `.zip`, or a folder whose pictures name two directions each."""
    from studio_plugins.residual.btf_pictures import looks_like

    path = Path(path)
    if path.is_file():
        return path.suffix.lower() in (".btf", ".zip")
    return path.is_dir() and looks_like(path)


def open_btf(path: str | Path, response: str = "automatic") -> Btf:
    """The BTF in a folder or a `.zip` of pictures, or in a `.btf` file. InputError in one sentence."""
    from studio_plugins.residual.btf_factored import FactoredBtf
    from studio_plugins.residual.btf_pictures import FolderBtf, ZipBtf

    path = Path(path)
    if path.is_dir():
        return FolderBtf(path, response)
    if not path.is_file():
        raise InputError(f"{path} cannot be read: there is no such file")
    if path.suffix.lower() == ".zip":
        return ZipBtf(path, response)
    return FactoredBtf(path)


def unique_directions(every: F64) -> tuple[F64, Indices]:
    """(n, 3) directions that differ, in the order in which they appear, and which of them each is (m,)."""
    keys = np.round(every, 5) + 0.0
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), np.intp)
    place[order] = np.arange(len(order))
    return every[first[order]], place[np.ravel(inverse)]


def parts(which: Indices, count: int) -> Sequence[Indices]:
    """Runs of `count`."""
    return [which[i : i + count] for i in range(0, len(which), count)]
