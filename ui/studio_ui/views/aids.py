"""What lies over the picture on both canvases: the view cube, and the frame of the camera looked through."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPoint, QRect

from studio_ui.canvas.camera_frame import CameraFrame
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.canvas.view_cube import SIZE, ViewCube
from studio_ui.canvas.viewport import Pointer
from studio_ui.context import Context, Subscriptions
from studio_ui.look.theme import Theme
from studio_ui.panels.light_fields import to_lens
from studio_ui.settings import Settings
from studio_ui.views.cameras import Cameras
from studio_ui.views.main_light import MainLight
from studio_ui.views.viewing import Viewing

_ACROSS = 420.0
"""Pixels that a drag on the cube goes for as much as one over the picture's height."""
_BESIDE = QPoint(8, 8)
"""From the top right corner."""


class ViewAids:
    """A feature. Settings: `view_cube`."""

    def __init__(
        self,
        context: Context,
        viewport: SwitchViewport,
        looking: Looking,
        viewing: Viewing,
        cameras: Cameras,
        settings: Settings,
    ) -> None:
        self._viewport, self._looking, self._cameras = viewport, looking, cameras
        self._settings = settings
        self.cube, self.frame = ViewCube(), CameraFrame()
        viewport.lay_over(self.frame, QRect)
        viewport.lay_over(self.cube, _top_right)
        self.light = MainLight(context)
        cube = self.cube
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.session.changed.connect(lambda _: cube.set_view(context.session.view)),
            cameras.changed.connect(self.refresh),
            context.document.changed.connect(lambda *_: self.refresh()),
            self.light.changed.connect(cube.set_sun),
            cube.looked.connect(viewing.look_from),
            cube.home.connect(viewing.home),
            cube.pressed.connect(self._pressed),
            cube.dragged.connect(self._dragged),
            cube.let_go.connect(looking.end),
        )
        cube.set_view(context.session.view)
        cube.set_sun(self.light.direction)
        self.show_cube(settings.get("view_cube", True))
        self.refresh()

    def start(self) -> None:
        """Fit cameras to the canvas from now on, after the feed was told of its size."""
        self._subscriptions.add(self._viewport.resized.connect(lambda *_: self._cameras.fit()))

    def close(self) -> None:
        """Stop following."""
        self._subscriptions.close()
        self.light.close()

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"view.cube": lambda: self.show_cube(self.cube.isHidden())}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"cube": lambda: not self.cube.isHidden()}

    def show_cube(self, shown: bool) -> None:
        """Whether there is a view cube."""
        self._settings.set("view_cube", shown)
        self.cube.setVisible(shown)

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        self.cube.set_theme(theme)
        self.frame.set_theme(theme)

    def refresh(self) -> None:
        """The frame of the camera that is looked through, if one is."""
        camera = self._cameras.camera()
        if camera is None:
            self.frame.hide()
            return
        words = [camera.name, f"{to_lens(camera.fov):.0f} mm", self._cameras.frame]
        if self._cameras.kept:
            words.append("goes along with the view")
        self.frame.show_frame(self._cameras.aspect, "  ·  ".join(words), kept=self._cameras.kept)

    def _pressed(self) -> None:
        self._looking.start("orbit", self._pointer(0, 0), self._looking.pivot())

    def _dragged(self, dx: float, dy: float) -> None:
        self._looking.move(self._pointer(dx, dy))

    def _pointer(self, dx: float, dy: float) -> Pointer:
        return Pointer("move", dx / _ACROSS, dy / _ACROSS, "left")


def _top_right(room: QRect) -> QRect:
    return QRect(QPoint(room.right() - SIZE.width() - _BESIDE.x(), room.top() + _BESIDE.y()), SIZE)
