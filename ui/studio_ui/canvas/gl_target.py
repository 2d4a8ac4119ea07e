"""Frame buffers of the GPU canvas: light in floating point, marks, layers of what is looked through."""

from __future__ import annotations

from typing import Any

from vispy import gloo

DEPTH24 = 0x81A6
"""GL_DEPTH_COMPONENT24: vispy's own name stands for 16 bits."""
Colour = tuple[float, float, float, float]


class Target:
    """A texture to draw into, with a depth buffer of its own, of another target, or none."""

    def __init__(self, size: tuple[int, int], format: str, depth: Any = None, linear: bool = False) -> None:
        width, height = self.size = size
        self.format = format
        filtering = "linear" if linear else "nearest"
        self.texture = gloo.Texture2D(
            shape=(height, width, 4),
            format="rgba",
            internalformat=None if format == "rgba8" else format,
            interpolation=filtering,
            wrapping="clamp_to_edge",
        )
        self.depth = depth
        self._parts = [self.texture]
        if depth == "own":
            self.depth = gloo.RenderBuffer((height, width), DEPTH24)
            self._parts.append(self.depth)
        self.frame = gloo.FrameBuffer(self.texture, self.depth)

    def begin(self, colour: Colour | None, clear_depth: bool = True) -> None:
        """Draw here from now on, cleared to `colour` (None: as it is)."""
        self.frame.activate()
        gloo.set_viewport(0, 0, *self.size)
        if colour is not None:
            gloo.set_depth_mask(True)
            queue = gloo.get_current_canvas().context.glir
            queue.command("FUNC", "glClearColor", *colour)  # vispy's own takes 0…1 alone
            gloo.clear(color=True, depth=clear_depth and self.depth is not None)

    def end(self) -> None:
        """Draw again where it was drawn before."""
        self.frame.deactivate()

    def delete(self) -> None:
        """Give it back."""
        self.frame.delete()
        for part in self._parts:
            part.delete()


class Targets:
    """The targets of one size, made when first asked for."""

    def __init__(self) -> None:
        self._made: dict[str, Target] = {}
        self._size = (0, 0)

    def resize(self, size: tuple[int, int], layered: bool) -> None:
        """`layered`: distances are compared, for which half floats are too coarse."""
        light = self._made.get("light")
        format = "rgba32f" if layered else "rgba16f"
        if size != self._size or (light is not None and light.format != format):
            self.delete()
        self._size = size
        if "light" not in self._made:
            self._made["light"] = Target(size, format, "own")

    @property
    def light(self) -> Target:
        """What cannot be looked through; alpha is the distance."""
        return self._made["light"]

    @property
    def marks(self) -> Target:
        """Red: chosen; hidden by what the light target has."""
        return self._get("marks", "rgba8", self.light.depth)

    @property
    def clear(self) -> Target:
        """Light of what is looked through; alpha is what it lets through."""
        return self._get("clear", "rgba16f", None)

    def layer(self, number: int) -> Target:
        """Distances of a layer; there are two that take turns."""
        return self._get(f"layer{number % 2}", "rgba32f", "own")

    def delete(self) -> None:
        """Give everything back."""
        for target in self._made.values():
            target.delete()
        self._made = {}

    def _get(self, name: str, format: str, depth: Any) -> Target:
        if name not in self._made:
            self._made[name] = Target(self._size, format, depth)
        return self._made[name]
