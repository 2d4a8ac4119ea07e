"""What a preview is given: pixels, marks over them, what to compare with, and words for a point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_ui.capture.preview.tone import Rgb


@dataclass(frozen=True, eq=False)
class Mark:
    """A mask (H, W) that can be laid over the picture; `shown` at first."""

    name: str
    mask: npt.NDArray[np.bool_]
    colour: Rgb
    tip: str = ""
    shown: bool = True


@dataclass(frozen=True, eq=False)
class Shown:
    """One picture of the preview, as the very array that the stages made.

    `key`: pictures of one key and size keep their zoom. `before`: same size, for the wipe. `say(x, y)`: what
    else there is to tell of a point of the picture.
    """

    key: str
    title: str
    pixels: npt.NDArray[Any]
    marks: tuple[Mark, ...] = ()
    before: npt.NDArray[Any] | None = None
    say: Callable[[float, float], str] = lambda x, y: ""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def encoded(self) -> bool:
        """Whether these are a camera's numbers rather than light."""
        return bool(self.pixels.dtype != np.float32)
