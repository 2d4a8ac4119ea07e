"""Cameras: places to look from with small pictures; a click goes there."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QPoint, QSignalBlocker, QTimer
from PySide6.QtGui import QAction, QImage, QResizeEvent
from PySide6.QtWidgets import QMenu

from studio_core.edits import Edit, Order, Remove, SetFields
from studio_core.params import Value
from studio_core.scene.nodes import Camera, NodeId
from studio_ui.canvas.framing import ASPECTS
from studio_ui.context import Context
from studio_ui.forms.fields import Combo
from studio_ui.forms.sinks import EditSink
from studio_ui.look.theme import Theme
from studio_ui.panels.camera_list import CameraList
from studio_ui.panels.lens_row import LensRow
from studio_ui.panels.light_fields import to_lens
from studio_ui.panels.panel import Panel, note, row
from studio_ui.views.camera_pictures import CameraPictures
from studio_ui.views.cameras import Cameras

_EMPTY = "No cameras yet. Look around until you like what you see, then press Ctrl+Alt+0 to keep the view."


_ROOMY = 230
"""Pixels of height from which there is room for the lens; Properties have it, too."""


class CamerasPanel(Panel):
    """The scene's cameras in their order; all that is done to them can be undone."""

    id = "cameras"
    title = "Cameras"

    def __init__(self, context: Context, cameras: Cameras, pictures: CameraPictures) -> None:
        super().__init__(context)
        self._cameras, self._pictures = cameras, pictures
        self._sink = EditSink(context.editing, self._set, lambda _: "Lens")
        self.list = CameraList()
        self.list.went = cameras.look
        self.list.renamed = self._rename
        self.list.moved = self._order
        self.list.removed = self.remove
        self.list.currentRowChanged.connect(lambda _: self._show_lens())
        self.list.customContextMenuRequested.connect(self._menu)
        self.add = self.tool("add", "New camera from the view (Ctrl+Alt+0)")
        self.aim = self.tool("frame", "Set the camera to the view: it will see what you see now")
        self.keep = self.tool("lock", "Lock camera to view: the camera goes along when you look around")
        self.delete = self.tool("delete", "Delete the camera")
        self.keep.setCheckable(True)
        self.add.clicked.connect(self._cameras.new)
        self.aim.clicked.connect(self._aim)
        self.keep.toggled.connect(cameras.keep)
        self.delete.clicked.connect(self.remove)
        self.frame = Combo()
        self.frame.setAccessibleName("Camera frame")
        self.frame.setToolTip("Shape of the pictures that cameras make, width : height")
        for name, (label, _) in ASPECTS.items():
            self.frame.addItem(label, name)
        self.frame.activated.connect(lambda _: cameras.use_frame(self.frame.currentData()))
        self.lens = LensRow(self._sink)
        self._empty = note(_EMPTY)
        self.column.addWidget(self._empty)
        self.column.addWidget(self.list, 1)
        self.column.addWidget(self.lens)
        self.column.addLayout(row(self.add, self.aim, self.keep, self.delete, self.frame, stretch=4))
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(lambda *_: self._soon.start(0)),
            cameras.changed.connect(self._followed),
            pictures.changed.connect(lambda _: self._soon.start(0)),
        )
        self.refresh()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """In little room the rows come first."""
        super().resizeEvent(event)
        self._show_lens()

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        super().set_theme(theme)
        self.list.set_theme(theme)

    def use_actions(self, actions: Mapping[str, QAction]) -> None:
        """The keys of the panel's buttons."""
        action = actions["view.new_camera"]
        keys = action.shortcut().toString(action.shortcut().SequenceFormat.NativeText)
        self.add.setToolTip(f"New camera from the view{f' ({keys})' if keys else ''}")

    @property
    def camera(self) -> Camera | None:
        """The one in the current row."""
        node = self.list.camera
        found = None if node is None else self.context.document.scene.nodes.get(node)
        return found if isinstance(found, Camera) else None

    def refresh(self) -> None:
        """Show the scene's cameras as they are now."""
        self._soon.stop()
        found = self._cameras.all()
        self.list.show_cameras([self._row(camera) for camera in found])
        self._empty.setVisible(not found)
        self.list.setVisible(bool(found))
        with QSignalBlocker(self.keep):
            self.keep.setChecked(self._cameras.kept)
        self.keep.setEnabled(self._cameras.through is not None)
        self.frame.setCurrentIndex(self.frame.findData(self._cameras.frame))
        self._show_lens()

    def remove(self) -> None:
        """Delete the camera in the current row."""
        camera = self.camera
        if camera is not None:
            self.context.editing.apply(Remove((camera.id,), f"Delete {camera.name}"))

    def _row(self, camera: Camera) -> tuple[NodeId, str, str, QImage | None, bool]:
        lens = f"{to_lens(camera.fov):.0f} mm · {camera.fov:.0f}°"
        return camera.id, camera.name, lens, self._pictures.find(camera), camera.id == self._cameras.through

    def _show_lens(self) -> None:
        camera = self.camera
        self.lens.setVisible(camera is not None and self.height() > _ROOMY)
        for button in (self.aim, self.delete):
            button.setEnabled(camera is not None)
        if camera is not None:
            self.lens.show_fov(camera.fov)

    def _followed(self) -> None:
        self.refresh()
        if self._cameras.through is not None:
            self.list.choose(self._cameras.through)

    def _aim(self) -> None:
        camera = self.camera
        if camera is not None:
            self._cameras.aim(camera.id)

    def _set(self, name: str, value: Value) -> Edit:
        camera = self.list.camera
        assert camera is not None
        return SetFields(camera, {name: value}, f"Lens of {self.context.document.scene[camera].name}")

    def _rename(self, camera: NodeId, name: str) -> None:
        name = name.strip()
        old = self.context.document.scene[camera].name
        if name and name != old:
            self.context.editing.apply(SetFields(camera, {"name": name}, f"Rename {old}"))
        self.refresh()

    def _order(self, camera: NodeId, before: NodeId | None) -> None:
        scene = self.context.document.scene
        if camera == before:
            return
        if before is None:  # after the last camera, wherever other things are
            others = [other.id for other in self._cameras.all() if other.id != camera]
            nodes = list(scene.nodes)
            after = nodes.index(others[-1]) + 1 if others else len(nodes)
            rest = [node for node in nodes[after:] if node != camera]
            before = rest[0] if rest else None
        self.context.editing.apply(Order((camera,), before, f"Reorder {scene[camera].name}"))
        self.refresh()

    def _menu(self, at: QPoint) -> None:
        menu = self.menu_at(at)
        if menu is not None:
            menu.popup(self.list.viewport().mapToGlobal(at))

    def menu_at(self, at: QPoint) -> QMenu | None:
        """What can be done with the camera there."""
        item = self.list.itemAt(at)
        if item is None:
            return None
        self.list.setCurrentItem(item)
        menu = QMenu(self)
        menu.aboutToHide.connect(menu.deleteLater)
        camera = self.list.camera
        assert camera is not None
        menu.addAction("Look through", lambda: self._cameras.look(camera))
        menu.addAction("Set to view", lambda: self._cameras.aim(camera))
        menu.addAction("Rename", lambda: self.list.editItem(item))
        menu.addAction("Select in the scene", lambda: self.context.session.select([camera]))
        menu.addSeparator()
        menu.addAction("Delete", self.remove)
        return menu
