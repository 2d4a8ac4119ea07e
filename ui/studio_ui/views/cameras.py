"""Cameras of the scene as places to look from: looking through one, its frame, keeping it with the view."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np
from PySide6.QtCore import QTimer

from studio_core.edits import Add, Compound, Edit, Move, SetFields
from studio_core.scene.arranging import is_locked, placed
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Camera, NodeId, Scene, new_id
from studio_core.session import View
from studio_core.signal import Signal
from studio_ui.canvas.framing import ASPECTS, CAMERA_KEYS, USUAL, fitted, unfitted
from studio_ui.canvas.looking import Looking
from studio_ui.context import Context, Subscriptions
from studio_ui.settings import Settings

_PAUSE_MS = 350
"""A camera that is kept with the view has moved once nothing moved for so long."""


class Cameras:
    """A feature. `changed` when another camera is looked through, or how.

    While `through` is a camera, the view is the camera's, fitted to the canvas. Moving the view leaves it,
    unless it is `kept`: then the camera goes along, one step of the history a movement. Settings:
    `camera_frame` (a name of `ASPECTS`).
    """

    def __init__(self, context: Context, looking: Looking, settings: Settings) -> None:
        self.through: NodeId | None = None
        self.kept = False
        self.frame: str = settings.get("camera_frame", USUAL)
        if self.frame not in ASPECTS:
            self.frame = USUAL
        self.changed: Signal[[]] = Signal()
        self._context, self._looking, self._settings = context, looking, settings
        self._carrying = False
        self._pause = QTimer()
        self._pause.setSingleShot(True)
        self._pause.setInterval(_PAUSE_MS)
        self._pause.timeout.connect(self._arrived)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.session.changed.connect(self._looked),
            context.document.changed.connect(self._edited),
            looking.cancelled.connect(lambda: context.editing.cancel(self)),
        )

    def close(self) -> None:
        """Stop following."""
        self._pause.stop()
        self._subscriptions.close()

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            "view.new_camera": self.new,
            "view.aim_camera": self.aim_chosen,
            "view.keep_camera": lambda: self.keep(not self.kept),
            "view.leave_camera": self.leave,
        }
        made |= {f"view.camera_{n}": partial(self._look_nth, n) for n in range(1, CAMERA_KEYS + 1)}
        made |= {f"view.frame_{_plain(name)}": partial(self.use_frame, name) for name in ASPECTS}
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        made: dict[str, Callable[[], bool]] = {
            "aimable": lambda: self._to_aim() is not None,
            "through": lambda: self.through is not None,
            "kept": lambda: self.kept,
        }
        made |= {f"camera_{n}": partial(self._has, n) for n in range(1, CAMERA_KEYS + 1)}
        made |= {f"through_{n}": partial(self._looks_nth, n) for n in range(1, CAMERA_KEYS + 1)}
        made |= {f"frame_{_plain(name)}": partial(self._framed, name) for name in ASPECTS}
        return made

    # what is seen

    @property
    def aspect(self) -> float:
        """Width / height of the frame."""
        return ASPECTS[self.frame][1]

    def all(self) -> list[Camera]:
        """The cameras in their order."""
        return list(self._context.document.scene.of(Camera))

    def camera(self) -> Camera | None:
        """The one that is looked through."""
        found = None if self.through is None else self._context.document.scene.nodes.get(self.through)
        return found if isinstance(found, Camera) else None

    def seen(self, camera: Camera, size: tuple[int, int] | None = None) -> View:
        """What a camera sees on the canvas, or on one of so many pixels: all of its frame."""
        now = self._context.session.view
        width, height = size or (now.width, now.height)
        view = View.of(camera, self._context.document.scene, width, height)
        view = dataclasses.replace(view, antialias=now.antialias, fine_edges=now.fine_edges)
        return dataclasses.replace(view, fov=fitted(camera.fov, self.aspect, width, height))

    def shot(self, width: int, height: int) -> View:
        """The view for a picture of so many pixels: the frame of the camera, or all that the canvas shows."""
        camera, view = self.camera(), self._context.session.view
        if camera is not None:
            return self.seen(camera, (width, height))
        fov = fitted(view.fov, view.width / view.height, width, height)
        return dataclasses.replace(view.sized(width, height), fov=fov)

    # going there

    def look(self, camera: NodeId) -> None:
        """Look through a camera of the scene."""
        node = self._context.document.scene.nodes.get(camera)
        if not isinstance(node, Camera):
            return
        self._context.editing.commit(self)
        if camera != self.through:
            self.through, self.kept = camera, False
        self._looking.flight.to(self.seen(node))
        self.changed.emit()

    def leave(self) -> None:
        """Stay where the view is, without the camera."""
        self._context.editing.commit(self)
        if self.through is not None:
            self.through, self.kept = None, False
            self.changed.emit()

    def adopt(self) -> None:
        """After a project was opened: look through the camera that stands where the view is, if one does."""
        self.through, self.kept = None, False
        view, scene = self._context.session.view, self._context.document.scene
        for camera in self.all():
            if together(View.of(camera, scene, view.width, view.height), view):
                self.through = camera.id
                self._context.session.look(self.seen(camera))
                break
        self.changed.emit()

    def fit(self) -> None:
        """The canvas or the frame has another shape."""
        camera = self.camera()
        if camera is not None:
            self._looking.flight.stop()
            self._context.session.look(self.seen(camera))

    def keep(self, kept: bool) -> None:
        """Whether the camera that is looked through goes along with the view."""
        self._context.editing.commit(self)
        self.kept = kept and self.through is not None
        self.changed.emit()

    def use_frame(self, name: str) -> None:
        """Another frame, of `ASPECTS`."""
        self.frame = name
        self._settings.set("camera_frame", name)
        self.fit()
        self.changed.emit()

    # edits

    def new(self) -> NodeId | None:
        """A camera that sees what is seen now, looked through from now on; None when it was refused."""
        scene, view = self._context.document.scene, self._context.session.view
        taken = {camera.name for camera in scene.of(Camera)}
        name = next(n for n in ("Camera", *(f"Camera {i}" for i in range(2, 10**6))) if n not in taken)
        fov = unfitted(view.fov, self.aspect, view.width, view.height)
        place = dataclasses.replace(view.transform, scale=1.0)
        made = Camera(id=new_id("camera"), name=name, transform=place, fov=fov, focus=view.focus)
        if not self._context.editing.apply(Add((made,), label=f"New {name}")):
            return None
        self._looking.flight.stop()
        self.through, self.kept = made.id, False
        self._context.session.select([made.id])
        self.changed.emit()
        return made.id

    def aim(self, camera: NodeId) -> None:
        """Put a camera where the view is, and look through it."""
        scene = self._context.document.scene
        node = scene.nodes.get(camera)
        if not isinstance(node, Camera):
            return
        self._looking.flight.stop()
        if self._context.editing.apply(self._moved(node, f"Aim {node.name}")):
            self.through = camera
            self.kept = False
            self.changed.emit()

    def aim_chosen(self) -> None:
        """Put the chosen camera where the view is."""
        camera = self._to_aim()
        if camera is not None:
            self.aim(camera)

    def _to_aim(self) -> NodeId | None:
        scene = self._context.document.scene
        chosen = self._context.session.selection
        return next((n for n in chosen if isinstance(scene.nodes.get(n), Camera)), None)

    def _moved(self, camera: Camera, label: str) -> Edit:
        """The camera where the view is."""
        scene, view = self._context.document.scene, self._context.session.view
        world = dataclasses.replace(view.transform, scale=scene.world(camera.id).scale)
        fov = unfitted(view.fov, self.aspect, view.width, view.height)
        fields = {"fov": camera.fov if abs(fov - camera.fov) < 1e-6 else fov, "focus": view.focus}
        move = Move(placed(scene, {camera.id: world}))
        return Compound(label, (move, SetFields(camera.id, fields)))

    # following

    def _looked(self, aspect: Aspect) -> None:
        camera = self.camera()
        if camera is None or not aspect & Aspect.VIEW:
            return
        view, seen, goal = self._context.session.view, self.seen(camera), self._looking.flight.goal
        if same(view, seen) or (goal is not None and same(goal, seen)):
            return
        if self.kept and not is_locked(self._context.document.scene, camera.id):
            self._carry(camera)
        else:
            self.leave()

    def _carry(self, camera: Camera) -> None:
        editing, label = self._context.editing, f"Move {camera.name}"
        editing.begin(self, label)
        self._carrying = True
        carried = editing.preview(self, self._moved(camera, label))
        self._carrying = False
        if carried:
            self._pause.start()
        else:  # another gesture is under way
            self.leave()

    def _arrived(self) -> None:
        if self._looking.mode is not None or self._looking.flight.goal is not None:
            self._pause.start()
        else:
            self._context.editing.commit(self)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self.through is None or self._carrying:
            return
        camera = self.camera()
        if camera is None:
            self.through, self.kept = None, False
            self.changed.emit()
        elif not same(self._context.session.view, self.seen(camera)) and self._looking.flight.goal is None:
            self._context.feed.step()
            self._context.session.look(self.seen(camera))

    # keys

    def _nth(self, number: int) -> Camera | None:
        found = self.all()
        return found[number - 1] if number <= len(found) else None

    def _look_nth(self, number: int) -> None:
        camera = self._nth(number)
        if camera is not None:
            self.look(camera.id)

    def _has(self, number: int) -> bool:
        return self._nth(number) is not None

    def _looks_nth(self, number: int) -> bool:
        camera = self._nth(number)
        return camera is not None and camera.id == self.through

    def _framed(self, name: str) -> bool:
        return self.frame == name


def _plain(name: str) -> str:
    return name.replace(":", "_").replace(".", "_")


def together(a: View, b: View) -> bool:
    """Whether two views are from one place in one direction."""
    return bool(np.allclose(a.transform.matrix(), b.transform.matrix(), rtol=0, atol=1e-7))


def same(a: View, b: View) -> bool:
    """Whether two views see the same."""
    return together(a, b) and abs(a.fov - b.fov) < 1e-6
