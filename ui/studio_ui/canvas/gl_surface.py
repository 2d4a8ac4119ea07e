"""The widget that OpenGL draws into: context, upload and drawing, and what happens when they fail."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QTimer
from PySide6.QtGui import QPaintEvent
from PySide6.QtOpenGLWidgets import QOpenGLWidget
from PySide6.QtWidgets import QWidget
from vispy.gloo.context import FakeCanvas, forget_canvas

from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_ui.canvas.gl_buffers import Tally
from studio_ui.canvas.gl_context import begin, largest_texture, names, surface_format
from studio_ui.canvas.gl_renderer import Look, Picked, Renderer

GL_RGBA8 = 0x8058


class GlSurface(QOpenGLWidget):
    """Shows what `content` gives: a picture, and how to draw it in so many device pixels.

    When the context goes (another screen, a reset) everything is made again in the next one. What cannot be
    drawn is told to `failed`, once, later, outside of Qt's painting.
    """

    def __init__(
        self,
        content: Callable[[int, int], tuple[Picture | None, Look] | None],
        failed: Callable[[str], None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setFormat(surface_format())
        self.setTextureFormat(GL_RGBA8)
        self._content, self._tell = content, failed
        self._canvas: FakeCanvas | None = None
        self._renderer: Renderer | None = None
        self._failed = False
        self.frames = 0
        self.drawn_by = ""

    @property
    def tally(self) -> Tally:
        """What went to the GPU in this context."""
        return self._renderer.tally if self._renderer is not None else Tally()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Qt makes the context when it first paints; without one it says nothing."""
        super().paintEvent(event)
        if not self.isValid():
            self._fail(RuntimeError("Qt cannot make an OpenGL context"))

    def initializeGL(self) -> None:
        """A context is there: the first, or another one."""
        try:
            context = self.context()
            context.aboutToBeDestroyed.connect(self.release)
            self._canvas = FakeCanvas()
            begin(self._canvas, self.defaultFramebufferObject())
            self.drawn_by = names()[0]
            self._renderer = Renderer(largest_texture())
        except Exception as error:  # Qt must not see it
            self._fail(error)

    def paintGL(self) -> None:
        """Upload what changed, draw."""
        if self._renderer is None or self._canvas is None or self._failed:
            return
        try:
            if not self.context().isValid():
                raise RuntimeError("the graphics card was reset")
            ratio = self.devicePixelRatioF()
            found = self._content(int(self.width() * ratio + 0.5), int(self.height() * ratio + 0.5))
            if found is None:
                return
            begin(self._canvas, self.defaultFramebufferObject())
            picture, look = found
            self._renderer.show(picture)
            self._renderer.draw(look)
            self._canvas.flush()
            self.frames += 1
        except Exception as error:
            self._fail(error)

    def pick(self, picture: Picture, view: View, x: float, y: float) -> Picked | None:
        """What lies under a point, as `Renderer.pick` says; None also when it cannot be asked."""
        if self._renderer is None or self._canvas is None or self._failed:
            return None
        self.makeCurrent()
        try:
            begin(self._canvas, self.defaultFramebufferObject())
            self._renderer.show(picture)
            return self._renderer.pick(view, x, y)
        except Exception as error:
            self._fail(error)
            return None
        finally:
            self.doneCurrent()

    def release(self) -> None:
        """Give everything back to the context, which goes away."""
        renderer, self._renderer = self._renderer, None
        canvas, self._canvas = self._canvas, None
        if renderer is None or canvas is None:
            return
        self.makeCurrent()
        try:
            begin(canvas, 0)
            renderer.close()
        except Exception as error:  # nothing is lost: the context goes
            self.drawn_by = str(error)
        finally:
            forget_canvas(canvas)
            self.doneCurrent()

    def _fail(self, error: Exception) -> None:
        if not self._failed:
            self._failed = True
            words = str(error).strip().splitlines()
            reason = words[0] if words else type(error).__name__
            QTimer.singleShot(0, self, lambda: self._tell(reason))
