"""From an order to files: a copy of the scene for the child, its progress, its previews, no leftovers."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from studio_core.scene.nodes import Camera, Scene, new_id
from studio_core.session import View
from studio_core.shading.job import Job
from studio_ui.pictures.child import Runner
from studio_ui.pictures.order import HERE, PictureOrder, SeriesOrder

Order = PictureOrder | SeriesOrder
Seen = Callable[[bytes], object]
"""Gets a small picture of what there is so far, as a PNG."""


def make(
    order: Order,
    scene: Scene,
    views: Mapping[str, tuple[str, View]],
    name: str,
    runner: Runner,
    job: Job,
    seen: Seen,
) -> Any:
    """Have it made; the result of the command. `views`: name and view of each camera that the order names."""
    cameras = {known: _camera(*views[known]) for known in order.cameras}
    started = time.time()
    try:
        with tempfile.TemporaryDirectory(prefix="lucarne-picture-") as folder:
            from studio_core.project.store import save

            project, preview = Path(folder) / f"{_plain(name)}.lucarne", Path(folder) / "preview.png"
            save(project, scene.with_nodes(*cameras.values()), label="Picture", fresh=True)
            job.checkpoint()
            look = _Look(preview, seen)
            asked = order.seen_by({known: camera.id for known, camera in cameras.items()})
            made = runner(asked.arguments(project, preview), job, lambda _: look())
            look()
            return made
    except BaseException:
        _clear(order.path, started)
        raise


class _Look:
    """Gives the preview on whenever it is another one."""

    def __init__(self, path: Path, seen: Seen) -> None:
        self._path, self._seen, self._stamp = path, seen, 0

    def __call__(self) -> None:
        with contextlib.suppress(OSError):
            stamp = self._path.stat().st_mtime_ns
            if stamp != self._stamp:
                self._stamp = stamp
                self._seen(self._path.read_bytes())


def _camera(name: str, view: View) -> Camera:
    return Camera(id=new_id("camera"), name=name, transform=view.transform, fov=view.fov, focus=view.focus)


def unused(path: Path) -> Path:
    """The path itself, or with the first number that makes it one where nothing is."""
    made, number = path, 1
    while made.exists():
        number += 1
        made = path.with_name(f"{path.stem} {number}{path.suffix}")
    return made


def _plain(name: str) -> str:
    made = "".join(c if c.isalnum() or c in "-_ " else "_" for c in name)[:60].strip()
    return made or "picture"


def _clear(path: Path, since: float) -> None:
    """Remove what a process that was ended had begun to write beside its files."""
    with contextlib.suppress(OSError):
        for left in path.parent.glob(f".{path.stem[:20]}*-????????????{path.suffix}"):
            if left.stat().st_mtime >= since - 1:
                left.unlink(missing_ok=True)


__all__ = ["HERE", "Order", "Seen", "make", "unused"]
