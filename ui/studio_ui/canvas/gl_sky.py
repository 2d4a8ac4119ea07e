"""The photograph around a scene on the GPU: behind objects, and on those that catch shadows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.transform import rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import Backdrop, Picture
from studio_core.shading.backdrop import way_into
from studio_ui.canvas.gl_buffers import Tally
from studio_ui.canvas.gl_maps import picture as texture_of
from studio_ui.canvas.projection import extent

F32 = npt.NDArray[np.float32]


class Sky:
    """Follows pictures; `backdrop` is None where nothing is seen behind objects."""

    def __init__(self, tally: Tally, largest: int) -> None:
        self.backdrop: Backdrop | None = None
        self._tally, self._largest = tally, largest
        self._texture: Any = None
        self._pixels: F32 | None = None  # that the texture shows
        self._size = (1, 1)

    def follow(self, picture: Picture) -> None:
        """Another picture; the same photograph is not uploaded again."""
        self.backdrop = picture.colours.backdrop if picture.colours is not None else None
        pixels = self.backdrop.pixels if self.backdrop is not None else None
        if pixels is self._pixels:
            return
        self._forget()
        self._pixels = pixels
        if pixels is not None:
            step = -(-max(pixels.shape[:2]) // self._largest)
            shown = pixels[::step, ::step]  # no driver has larger ones
            self._texture, self._size = texture_of(shown, "rgb32f"), (shown.shape[1], shown.shape[0])
            self._tally.maps += shown.nbytes
            self._tally.uploads += 1

    def clear(self) -> None:
        """Give everything back."""
        self._forget()
        self.backdrop = None

    def behind(self, program: Any, view: View, gain: float) -> None:
        """What the backdrop's program asks for."""
        assert self.backdrop is not None
        turn, dome = way_into(self.backdrop, view)
        self._dress(program)
        program["u_turn"] = turn.T
        program["u_axes"] = rotation_matrix(view.transform.rotation).T.astype(np.float32)
        program["u_domed"] = float(len(dome) > 0)
        program["u_from"] = dome[:3] if len(dome) else np.zeros(3)
        program["u_dome"] = dome[3:5] if len(dome) else np.ones(2)
        program["u_extent"] = extent(view)
        program["u_light"] = (gain * self.backdrop.gain).astype(np.float32)

    def under(self, program: Any, view: View) -> None:
        """What the program of surfaces that catch shadows asks for."""
        assert self.backdrop is not None
        turn, dome = way_into(self.backdrop, view)
        start = np.zeros(3)
        if len(dome):
            start, turn = turn @ dome[:3], turn @ rotation_matrix(view.transform.rotation)
        self._dress(program)
        program["u_turn"], program["u_from"] = turn.T.astype(np.float32), start.astype(np.float32)

    def _dress(self, program: Any) -> None:
        program["u_sky"], program["u_sky_size"] = self._texture, self._size

    def _forget(self) -> None:
        if self._texture is not None:
            self._texture.delete()
        self._texture = self._pixels = None
