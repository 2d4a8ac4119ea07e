"""What the GPU canvas asks of a context, and a context without a window."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PySide6.QtGui import QSurfaceFormat
from vispy import gloo
from vispy.gloo.context import FakeCanvas, set_current_canvas

from studio_ui.canvas.gl_renderer import Renderer
from studio_ui.canvas.gl_target import Target

GL_RENDERER, GL_VERSION = 0x1F01, 0x1F02
GL_FLOAT_SIZES = ("rgba16f", "rgba32f")

logging.getLogger("vispy").setLevel(logging.ERROR)  # of what it warns, programs with unused variables are all


def surface_format() -> QSurfaceFormat:
    """Desktop OpenGL with GLSL 1.20; no depth of its own, since pictures are drawn beside the screen."""
    made = QSurfaceFormat()
    made.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    made.setVersion(2, 1)
    made.setDepthBufferSize(0)
    made.setStencilBufferSize(0)
    made.setOption(QSurfaceFormat.FormatOption.ResetNotification)
    return made


def begin(canvas: FakeCanvas, framebuffer: int) -> None:
    """Draw into a framebuffer of the context that is current now; `canvas` keeps what gloo knows of it."""
    set_current_canvas(canvas)
    canvas.context.glir.command("CURRENT", 0, framebuffer)


def largest_texture() -> int:
    """Texels along a side, at most."""
    return int(gloo.gl.glGetParameter(gloo.gl.GL_MAX_TEXTURE_SIZE))


def names() -> tuple[str, str]:
    """What draws, and which OpenGL it speaks."""
    return str(gloo.gl.glGetParameter(GL_RENDERER)), str(gloo.gl.glGetParameter(GL_VERSION))


def try_out() -> str:
    """Why the canvas cannot be drawn with the current context; empty when it can."""
    canvas = FakeCanvas()
    begin(canvas, 0)
    for format in GL_FLOAT_SIZES:
        target = Target((4, 4), format, "own")
        try:
            target.begin((0.25, 8.0, 0.0, 1.0))
            canvas.flush()
            found = gloo.read_pixels((0, 0, 4, 4), alpha=True, out_type="float")
            target.end()
            target.delete()
            canvas.flush()
        except RuntimeError as error:
            return f"the driver does not draw into floating-point pictures ({error})"
        if not np.allclose(found[..., :2], (0.25, 8.0)):
            return "the driver draws wrongly into floating-point pictures"
    try:
        Renderer(largest_texture()).compile()
    except RuntimeError as error:
        return f"the driver does not take the canvas' shaders ({str(error).splitlines()[0]})"
    return ""


class Offscreen:
    """A renderer and a target to draw into, in a context without a window (EGL)."""

    def __init__(self) -> None:
        os.environ.setdefault("EGL_PLATFORM", "surfaceless")
        from vispy import app

        self._canvas: Any = app.Canvas(app=app.Application("egl"), size=(8, 8), show=False)
        self._canvas.set_current()
        self.renderer = Renderer(largest_texture())
        self._target: Target | None = None

    @contextmanager
    def target(self, width: int, height: int) -> Iterator[Target]:
        """What is drawn inside goes into a target of 8-bit pixels."""
        self._canvas.set_current()
        if self._target is None or self._target.size != (width, height):
            if self._target is not None:
                self._target.delete()
            self._target = Target((width, height), "rgba8")
        self._target.begin((0.0, 0.0, 0.0, 1.0))
        try:
            yield self._target
        finally:
            self._target.end()
            self._canvas.context.flush_commands()

    def read(self) -> np.ndarray:
        """(H, W, 3) bytes of the target that is drawn into now, from the top."""
        assert self._target is not None
        self._canvas.context.flush_commands()
        return np.asarray(gloo.read_pixels((0, 0, *self._target.size), alpha=False))

    def finish(self) -> None:
        """Wait until all is drawn."""
        self._canvas.context.flush_commands()
        gloo.gl.glFinish()

    def close(self) -> None:
        """Give everything back."""
        self._canvas.set_current()
        self.renderer.close()
        if self._target is not None:
            self._target.delete()
        self._canvas.context.flush_commands()
        self._canvas.close()
