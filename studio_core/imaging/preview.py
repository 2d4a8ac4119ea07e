"""Small pictures of large ones while these are made, and many small ones on a sheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.imaging.encode import write_png
from studio_core.imaging.picture import Finish, displayed
from studio_core.imaging.resample import thumbnail_size

F32 = npt.NDArray[np.float32]
U8 = npt.NDArray[np.uint8]
BEHIND = np.float32(0.18)  # what is seen through a transparent picture
SHEET_GROUND, SHEET_GAP = 34, 6
MOST_CELLS = 48


class Preview:
    """A picture of `size` (width, height), shrunk to `longest` pixels a side, as bands arrive."""

    def __init__(self, size: tuple[int, int], finish: Finish, longest: int = 480) -> None:
        width, height = size
        self.height, self.width = thumbnail_size(height, width, longest)
        self._finish = Finish(finish.exposure, finish.tonemap)
        self._columns = np.arange(self.width) * width // self.width
        self._row_of = np.arange(height) * self.height // height
        self._sum = np.zeros((self.height, self.width, 3), np.float64)
        self._count = np.zeros((self.height, 1, 1))
        self._per_row = np.diff(np.append(self._columns, width))[None, :, None]

    def add(self, top: int, linear: F32, alpha: F32 | None = None) -> None:
        """Rows from `top` on: (h, W, 3), premultiplied where there is alpha (h, W)."""
        if alpha is not None:
            linear = linear + BEHIND * (1 - alpha[:, :, None])
        rows = self._row_of[top : top + len(linear)]
        np.add.at(self._sum, rows, np.add.reduceat(linear, self._columns, axis=1, dtype=np.float64))
        np.add.at(self._count, rows, 1)

    def shown(self) -> U8:
        """(h, w, 3) as displayed; dark where nothing has arrived."""
        mean = self._sum / (np.maximum(self._count, 1) * self._per_row)
        made = displayed(mean.astype(np.float32), self._finish)
        made[self._count[:, 0, 0] == 0] = SHEET_GROUND
        return np.asarray(made, np.uint8)

    def write(self, path: Path) -> None:
        """As a PNG, in the place of the last one."""
        write_png(path, self.shown())


class ContactSheet:
    """`count` pictures of one size, row by row; where they are many, only some of them."""

    def __init__(self, count: int, size: tuple[int, int], longest: int = 240) -> None:
        width, height = size
        self.cell = thumbnail_size(height, width, longest)
        cells = min(count, MOST_CELLS)
        self._place = {round(i * (count - 1) / max(cells - 1, 1)): i for i in range(cells)}
        h, w = (side + SHEET_GAP for side in self.cell)
        self._across = min(cells, max(1, round((1.6 * cells * h / w) ** 0.5)))
        down = -(-cells // self._across)
        ground = (down * h + SHEET_GAP, self._across * w + SHEET_GAP, 3)
        self.pixels: U8 = np.full(ground, SHEET_GROUND, np.uint8)

    def has(self, index: int) -> bool:
        """Whether a picture has a place."""
        return index in self._place

    def put(self, index: int, small: U8) -> None:
        """A picture of the cell's size, (h, w, 3); those without a place are left out."""
        if index not in self._place:
            return
        row, column = divmod(self._place[index], self._across)
        height, width = self.cell
        top, left = SHEET_GAP + row * (height + SHEET_GAP), SHEET_GAP + column * (width + SHEET_GAP)
        self.pixels[top : top + height, left : left + width] = small

    def write(self, path: Path) -> None:
        """As a PNG, in the place of the last one."""
        write_png(path, self.pixels)
