"""Pictures that came without vertex colours: shown as they are."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol

import numpy as np
from vispy import gloo

from studio_core.scene.nodes import NodeId
from studio_core.shading.artifacts import Picture
from studio_ui.canvas import gl_shaders as shaders
from studio_ui.canvas.gl_buffers import Tally


class Screen(Protocol):
    """What fills a target with a program."""

    def fill(self, program: Any) -> None:
        """Draw a program over all of the target."""
        ...

    def program(self, name: object, vertex: str, fragment: str) -> Any:
        """A program, compiled when it is first asked for."""
        ...


class Still:
    """Its light as a texture, and its marks as another."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._picture: Picture | None = None
        self._light: Any = None

    def draw(self, screen: Screen, picture: Picture, gain: float) -> None:
        """Fill the target with it."""
        if picture is not self._picture:
            self.clear()
            self._light = self._texture(picture.linear)
            self._picture = picture
        gloo.set_state(depth_test=False, blend=False, cull_face=False)
        self._show(screen, self._light, gain)

    def mark(self, screen: Screen, picture: Picture, chosen: Collection[NodeId]) -> None:
        """Red where chosen objects are."""
        own = np.array([node in chosen for node in picture.nodes] + [False])
        marks = np.zeros((*picture.node.shape, 3), np.float32)
        marks[..., 0] = own[picture.node]
        texture = self._texture(marks)
        gloo.set_state(depth_test=False, blend=False, cull_face=False)
        self._show(screen, texture, 1.0)
        texture.delete()

    def clear(self) -> None:
        """Give everything back."""
        if self._light is not None:
            self._light.delete()
        self._light = self._picture = None

    def _show(self, screen: Screen, texture: Any, gain: float) -> None:
        program = screen.program("still", shaders.SCREEN_VERTEX, shaders.STILL_FRAGMENT)
        program["u_still"], program["u_gain"] = texture, gain
        screen.fill(program)

    def _texture(self, pixels: Any) -> Any:
        self._tally.maps += pixels.nbytes
        self._tally.uploads += 1
        return gloo.Texture2D(
            np.ascontiguousarray(pixels, np.float32),
            format="rgb",
            internalformat="rgb16f",
            interpolation="nearest",
            wrapping="clamp_to_edge",
        )
