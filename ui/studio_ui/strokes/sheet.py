"""The picture that is painted on, and what has been painted on it: as light, and as the screen shows it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.edits import Add, Edit
from studio_core.kernels.tonemap import tonemap
from studio_core.scene.nodes import NodeId, Scene, new_id
from studio_core.shading.artifacts import Picture
from studio_core.strokes.brush import Rectangle
from studio_core.strokes.painting import marks_of, stroke_of
from studio_core.strokes.stroke import BLUR, CLONE, FIXATE, SHARPEN, SMEAR, Stroke
from studio_core.strokes.tools import REACH, Gesture, Seen, wanted
from studio_ui.canvas.overlay import Film
from studio_ui.strokes.brush_store import Setting
from studio_ui.strokes.words import TOOLS, painted_on

F32 = npt.NDArray[np.float32]
U8 = npt.NDArray[np.uint8]
Placed = tuple[float, float, float, float]
_KEPT = (242, 168, 59)
"""As displayed: what stays as it is."""
_CHECK = 6  # pixels of its pattern


class Sheet:
    """A path over a picture of `scene`; `solved` (H, W) is what of the mask the picture shows by now."""

    def __init__(self, picture: Picture, scene: Scene, setting: Setting) -> None:
        self.picture, self.scene, self.setting = picture, scene, setting
        self.node = new_id("stroke")
        self.path: list[tuple[float, float]] = []
        self._seen = Seen.of(picture)
        self.mask = np.zeros(picture.linear.shape[:2], np.float32)
        self.solved: F32 | None = None
        self._box: Rectangle | None = None
        self._own: npt.NDArray[np.bool_] | None = None  # where the object is that it began on
        self._base: tuple[F32, list[tuple[float, float]], Rectangle | None] | None = None

    def add(self, x: float, y: float) -> None:
        """The hand is there, of the picture's width and height, now."""
        self._base = None
        self._lay(x, y)

    def line(self, x: float, y: float) -> None:
        """A straight line from where the hand was before the first of these calls."""
        if self._base is None:
            self._base = self.mask.copy(), list(self.path), self._box
        mask, path, self._box = self._base
        self.mask, self.path = mask.copy(), list(path)
        base = self._base
        self._lay(x, y)
        self._base = base

    def _lay(self, x: float, y: float) -> None:
        last = self.path[-1:]
        self.path.append((x, y))
        if not last and not self.setting.across:
            self._own = self._object_at(x, y)
        box = self.setting.brush.add(self.mask, [*last, (x, y)])
        if self._own is not None:
            top, bottom, left, right = box
            self.mask[top:bottom, left:right] *= self._own[top:bottom, left:right]
        if self._box is not None:
            (top, bottom, left, right), other = box, self._box
            box = min(top, other[0]), max(bottom, other[1]), min(left, other[2]), max(right, other[3])
        self._box = box

    def _object_at(self, x: float, y: float) -> npt.NDArray[np.bool_] | None:
        """(H, W) where what is there is seen; None where nothing is."""
        height, width = self.picture.node.shape
        row, column = min(max(int(y * height), 0), height - 1), min(max(int(x * width), 0), width - 1)
        node = self.picture.node[row, column]
        return self.picture.node == node if node >= 0 else None

    @property
    def objects(self) -> tuple[NodeId, ...]:
        """What has been painted on, that which was painted on most first."""
        if self._box is None:
            return ()
        top, bottom, left, right = self._box
        part = (slice(top, bottom), slice(left, right))
        index, share = self.picture.node[part].ravel() + 1, self.mask[part].ravel()
        amount = np.bincount(index, share, minlength=len(self.picture.nodes) + 1)[1:]
        order = np.argsort(-amount, kind="stable")
        return tuple(self.picture.nodes[i] for i in order.tolist() if amount[i] > 0)

    @property
    def label(self) -> str:
        """`Paint colour on Chair`."""
        return f"{TOOLS[self.setting.tool][2]} {painted_on(self.scene, self.objects)}"

    def film(self, placed: Placed, exposure: float, kind: str) -> Film | None:
        """What is wanted, as a canvas shows it where the picture lies; without what it shows by itself."""
        if self._box is None:
            return None
        top, bottom, left, right = self._box
        if bottom <= top or right <= left:
            return None
        part = (slice(top, bottom), slice(left, right))
        share = self.mask[part]
        if self.solved is not None:
            share = np.clip(share - self.solved[part], 0, 1)
        pixels = np.empty((*share.shape, 4), np.uint8)
        if self.setting.tool == FIXATE:
            rows, columns = np.indices(share.shape)
            pixels[..., :3] = _KEPT
            share = share * np.where((rows // _CHECK + columns // _CHECK) % 2, 0.55, 0.2)
        else:
            light = self._wanted(part)
            told = np.asarray(np.isfinite(light).all(axis=2))
            pixels[..., :3] = tonemap(np.where(told[..., None], light, 0), exposure, kind)
            share = share * told
        pixels[..., 3] = np.rint(255 * share)
        height, width = self.picture.linear.shape[:2]
        x0, y0, x1, y1 = placed
        start = (x0 + (x1 - x0) * left / width, y0 + (y1 - y0) * top / height)
        end = (x0 + (x1 - x0) * right / width, y0 + (y1 - y0) * bottom / height)
        return Film(pixels, start, end)

    def _wanted(self, part: tuple[slice, slice]) -> F32:
        """(h, w, 3) of a part of the picture; what needs no more of it than is near is not given more."""
        tool, settings, path = self.setting.tool, self.setting.settings, np.array(self.path)
        gesture = Gesture.of(self.setting.brush, path)
        if tool in (CLONE, SMEAR):
            return wanted(tool, self._seen, gesture, settings, self.mask)[part]
        height = len(self.mask)
        margin = math.ceil(REACH * settings.radius * height) if tool in (BLUR, SHARPEN) else 0
        rows, columns = part
        top, left = max(rows.start - margin, 0), max(columns.start - margin, 0)
        near = (slice(top, rows.stop + margin), slice(left, columns.stop + margin))
        seen = Seen(self._seen.light[near], self._seen.surface[near])
        settings = dataclasses.replace(settings, radius=settings.radius * height / len(seen.light))
        made = wanted(tool, seen, gesture, settings, self.mask[near])
        return made[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]

    def painted(self) -> Painted:
        """All of it as it is now, for another thread."""
        return Painted(self.node, self.picture, self.scene, self.setting, self.mask.copy(), tuple(self.path))


@dataclass(frozen=True, eq=False)
class Painted:
    """A stroke that has not become a node yet."""

    node: NodeId
    picture: Picture
    scene: Scene
    setting: Setting
    mask: F32
    path: tuple[tuple[float, float], ...]

    def edit(self) -> Edit | None:
        """The stroke into the scene; None where no surface was met."""
        stroke = self.stroke()
        return None if stroke is None else Add((stroke,), label="Stroke")

    def stroke(self) -> Stroke | None:
        """The stroke with its marks; None where no surface was met."""
        setting = self.setting
        gesture = Gesture.of(setting.brush, np.array(self.path))
        light = wanted(setting.tool, Seen.of(self.picture), gesture, setting.settings, self.mask)
        marked = marks_of(self.picture, self.mask, light)
        if not len(marked.marks):
            return None
        name = f"{TOOLS[setting.tool][1]} on {painted_on(self.scene, marked.objects)}"
        made = stroke_of(
            marked, self.scene, setting.tool, name=name, indirect=setting.indirect, **setting.reach
        )
        return dataclasses.replace(made, id=self.node)


__all__ = ["Painted", "Placed", "Sheet"]
