"""Small pictures of what cameras see: of the last picture that was made through each, kept in a folder."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

import numpy as np
from PySide6.QtGui import QImage

from studio_core.scene.nodes import Camera, NodeId, Scene
from studio_core.session import ALL
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.canvas.framing import frame_in
from studio_ui.context import Context, Subscriptions
from studio_ui.feed import Shown
from studio_ui.files.thumbnails import read_small, small_picture
from studio_ui.views.cameras import Cameras, same

_MOST = 400  # files in the folder


class CameraPictures:
    """`changed(camera)` when there is another picture of it. Safe to delete, bounded in number."""

    def __init__(self, context: Context, cameras: Cameras, folder: Path) -> None:
        self.changed: Signal[[NodeId]] = Signal()
        self._context, self._cameras, self._folder = context, cameras, folder
        self._known: dict[NodeId, tuple[Path, QImage | None]] = {}
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.feed.shown.connect(lambda _: self.take()), cameras.changed.connect(self.take)
        )

    def close(self) -> None:
        """Stop following."""
        self._subscriptions.close()

    def find(self, camera: Camera) -> QImage | None:
        """What it saw, from where it is now or, before that is known, from where it was last seen."""
        path = self._path(camera)
        known = self._known.get(camera.id)
        if known is None or (known[0] != path and path.is_file()):
            known = self._known[camera.id] = (path, read_small(path))
        return known[1]

    def take(self) -> None:
        """Keep the picture that is shown, if it is at rest and of the camera that is looked through."""
        camera, last = self._cameras.camera(), self._context.feed.last
        if camera is None or last is None or last.moving or self._context.session.light != ALL:
            return
        if not last.final and self.find(camera) is not None:
            return  # one of the first is enough until the last
        if not same(self._cameras.seen(camera), last.view):
            return
        self._keep(camera, last)

    def _keep(self, camera: Camera, shown: Shown) -> None:
        path, aspect = self._path(camera), self._cameras.aspect
        session = self._context.session
        exposure, kind = session.exposure, session.tonemap

        def work(job: Job) -> QImage:
            height, width = shown.picture.linear.shape[:2]
            left, top, wide, high = (round(edge) for edge in frame_in(aspect, width, height))
            inside = shown.picture.linear[top : top + max(high, 1), left : left + max(wide, 1)]
            made = as_image(small_picture(inside, exposure, kind))
            with contextlib.suppress(OSError):
                self._folder.mkdir(parents=True, exist_ok=True)
                made.save(str(path))
                sweep(self._folder)
            return made

        def done(made: QImage) -> None:
            self._known[camera.id] = (path, made)
            self.changed.emit(camera.id)

        self._context.tasks.run("Keeping a small picture", work, done, quiet=True)

    def _path(self, camera: Camera) -> Path:
        return self._folder / f"{_name(self._context.document.scene, camera)}.png"


def as_image(pixels: np.ndarray) -> QImage:
    """An image of its own from 8-bit (H, W, 3)."""
    height, width = pixels.shape[:2]
    flat = np.ascontiguousarray(pixels)
    return QImage(flat.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()


def sweep(folder: Path) -> None:
    """The oldest go when there are too many."""
    found = sorted(folder.glob("*.png"), key=lambda path: path.stat().st_mtime, reverse=True)
    for path in found[_MOST:]:
        path.unlink(missing_ok=True)


def _name(scene: Scene, camera: Camera) -> str:
    """Another one for every camera, place and lens."""
    world = scene.world(camera.id)
    told = repr((camera.id, world.translation, world.rotation, camera.fov))
    return hashlib.sha256(told.encode()).hexdigest()[:32]
