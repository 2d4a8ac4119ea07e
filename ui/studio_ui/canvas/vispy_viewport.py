"""The canvas on the GPU: the surfaces of the last picture, drawn as the present view sees them.

A new view is drawn at once, with the radiance that there is; the next picture brings what is new in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QWidget

from studio_core.scene.nodes import Scene
from studio_core.scene.transform import vec3
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_ui.canvas.base_viewport import BaseViewport
from studio_ui.canvas.gl_buffers import Tally
from studio_ui.canvas.gl_renderer import Look
from studio_ui.canvas.gl_report import SOFTWARE
from studio_ui.canvas.gl_scene import Places
from studio_ui.canvas.gl_surface import GlSurface
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.overlay import NOTHING, Overlay
from studio_ui.canvas.projection import eye_of, ray
from studio_ui.canvas.viewport import GRID, Probe
from studio_ui.feed import Freshness

SMOOTH_SAMPLES = 18_000_000
"""Up to here a pixel gets four samples: of 4K nearly all of a window, in 300 MB."""
_STILL = (Freshness.CURRENT, Freshness.REFINING)


class _Marks(QWidget):
    """What lies over the picture; above the surface, and not in the way of the mouse."""

    def __init__(self, paint: Callable[[QPainter], None], parent: QWidget) -> None:
        super().__init__(parent)
        self._paint = paint
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Everything."""
        painter = QPainter(self)
        self._paint(painter)
        painter.end()


class VispyViewport(BaseViewport):
    """Satisfies `canvas.viewport.Viewport`. `failed` is told, once, why nothing can be drawn any more."""

    def __init__(self, failed: Callable[[str], None], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._places: Places = {}
        self.surface = GlSurface(self._content, failed, self)
        self.surface.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._marks = _Marks(self._paint_marks, self)
        self._marks.raise_()

    @property
    def tally(self) -> Tally:
        """What went to the GPU."""
        return self.surface.tally

    @property
    def view(self) -> View:
        """What is drawn: the view of the guides, which is the newest."""
        return self._guide_view or self._view

    def target(self) -> QRectF:
        """All of the canvas."""
        return QRectF(self.rect())

    def probe(self, x: float, y: float) -> Probe | None:
        """What lies under a point: from the picture, or from the GPU while it shows another view."""
        picture = self._picture
        if picture is None or self._as_pictured():
            return super().probe(x, y)
        if picture.colours is None:
            return None
        view = self.view.sized(*self.device_size())
        found = self.surface.pick(picture, view, x, y)
        if found is None:
            return Probe(None, float("inf"), (0.0, 0.0, 0.0))
        point = vec3(eye_of(view) + ray(view, x, y) * found.distance)
        return Probe(picture.nodes[found.object], found.distance, found.radiance, point)

    def release(self) -> None:
        """Give everything back to the GPU: contexts share what they hold, so that it outlives them."""
        super().release()
        self.surface.release()

    def grab_image(self) -> QImage:
        """The canvas as it is seen."""
        image = self.surface.grabFramebuffer()
        painter = QPainter(image)
        self._paint_marks(painter)
        painter.end()
        return image

    def set_scene(self, scene: Scene) -> None:
        """What the scene has come to: things are drawn where they are at once."""
        super().set_scene(scene)
        self._follow_scene()

    def set_freshness(self, state: Freshness) -> None:
        """Mark the picture; at rest it is drawn with more samples."""
        still = self.freshness in _STILL
        super().set_freshness(state)
        if still != (state in _STILL) and self._slow():
            self.surface.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Surface and marks fill the canvas."""
        self.surface.setGeometry(self.rect())
        self._marks.setGeometry(self.rect())
        super().resizeEvent(event)

    def _as_pictured(self) -> bool:
        """Whether eye and objects are where the picture has them."""
        now, then = self.view, self._view
        return not self._places and (now.transform, now.fov) == (then.transform, then.fov)

    def _follow_scene(self) -> None:
        """Where objects of the picture are by now, as far as they are somewhere else."""
        picture, scene, places = self._picture, self._scene, {}
        for placed in (
            picture.radiance.surfaces.mesh.objects if picture is not None and picture.colours else ()
        ):
            there = placed.node in scene.nodes and scene.shown(placed.node)
            place = scene.world(placed.node) if there else None
            if place != placed.transform:
                places[placed.node] = place
        if places != self._places:
            self._places = places
            self.surface.update()

    def _slow(self) -> bool:
        """Whether no graphics card draws."""
        return any(name in self.surface.drawn_by.lower() for name in SOFTWARE)

    def _content(self, width: int, height: int) -> tuple[Picture | None, Look] | None:
        """What the surface is to draw."""
        theme = self._theme
        smooth = 4 * width * height <= SMOOTH_SAMPLES
        if self._slow() and self.freshness not in _STILL:
            smooth = False
        shown_with = (self._exposure, self._tonemap)
        if self._picture is not None:
            shown_with = self._picture.shown_with(*shown_with)
        accent, ground = QColor(theme.mark), QColor(theme.canvas)
        look = Look(
            self.view.sized(width, height),
            2 if smooth else 1,
            *shown_with,
            self._selection,
            self._rim(width),
            (accent.redF(), accent.greenF(), accent.blueF()),
            GRID if self._grid else None,
            (ground.redF(), ground.greenF(), ground.blueF()),
            self._places,
        )
        return self._picture, look

    def _picture_changed(self) -> None:
        self._follow_scene()
        self.surface.update()
        self._marks.update()

    def _display_changed(self) -> None:
        self.surface.update()

    def _selection_changed(self) -> None:
        self.surface.update()

    def _marks_changed(self) -> None:
        self._marks.update()

    def set_guides(
        self,
        view: View,
        glyphs: Iterable[Glyph],
        boxes: npt.NDArray[np.float64] | None = None,
        overlay: Overlay = NOTHING,
    ) -> None:
        """Marks over the picture; another view is drawn at once."""
        before = self.view
        super().set_guides(view, glyphs, boxes, overlay)
        if self.view != before:
            self.surface.update()
