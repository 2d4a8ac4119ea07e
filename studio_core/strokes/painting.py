"""From a painted picture to a stroke: which places of which objects want which light.

The mask is cut into cells of about equal size, at most as many as marks are allowed, in rows that are shifted
by half a cell (so no line of a pattern meets all of them); where a cell shows several objects, slots, or
parts that turn away from each other or lie behind each other, each is a mark of its own. Its light is the
mean over its pixels: noise averages out, and no pixel is lost.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.camera import sample_directions
from studio_core.scene.nodes import NodeId, Scene, new_id
from studio_core.scene.transform import rotation_matrix
from studio_core.shading.artifacts import Hits, Picture, Surfaces
from studio_core.shading.primary import eye_in, pinhole
from studio_core.shading.surface_points import some_hits, surface_points
from studio_core.strokes.cells import Pixels, cells_of
from studio_core.strokes.marks import Marks
from studio_core.strokes.stroke import Stroke

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

LIMIT = 600
BESIDE = 4
"""One in so many marks of a flat stroke lies beside it."""
BESIDE_WEIGHT = 0.1
FEW, SELDOM = 8, 0.01
"""Fewer pixels than that, or than that share, are as bright as the brightest by chance."""
LOOKED_THROUGH = 0.5
"""Of opacity: what lets more light through has no marks."""
SAME = 1e-4
"""Relative: light that differs less is the same."""
NOTHING_KNOWN = "The picture does not tell which surfaces it shows, so nothing could be painted on."
NOTHING_SEEN = "The stroke meets no surface that has a material: only the background was painted."


@dataclass(frozen=True, eq=False)
class Marked:
    """Marks on `objects`; whether one light was painted over everything; in sentences what was left out."""

    objects: tuple[NodeId, ...]
    marks: Marks
    flat: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Pixels:
    """P pixels that show one surface alone: their middle samples, numbers of object and slot, how much they
    count, and the light (P, 3) shown and wanted.
    """

    pixel: I64
    sample: I64
    group: I64
    share: F64
    shown: F32
    wish: F32

    def __len__(self) -> int:
        return len(self.pixel)

    def some(self, which: npt.NDArray[np.generic]) -> _Pixels:
        """These of them."""
        return _Pixels(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))


def marks_of(picture: Picture, mask: F32, wanted: F32, limit: int = LIMIT) -> Marked:
    """At most `limit` marks of a mask (H, W) over a picture, and of the light wanted there (H, W, 3).

    Pixels count that show one surface with a material alone, and whose light is finite and was not clipped. A
    stroke on the background has none, and says so. What is painted in one colour also has marks beside it, on
    the same surfaces, that want what is shown. ValueError where the mask does not fit the picture.
    """
    if mask.shape != picture.linear.shape[:2] or wanted.shape != picture.linear.shape:
        raise ValueError("mask, wanted light and picture have different sizes")
    hits, surfaces = picture.radiance.hits, picture.radiance.surfaces
    if hits is None:
        return Marked((), _no_marks(), notes=(NOTHING_KNOWN,))
    painted = _read(np.flatnonzero(mask.reshape(-1) > 0), picture, hits, mask, wanted)
    if not len(painted):
        return Marked((), _no_marks(), notes=(NOTHING_SEEN,))
    clipped = _clipped(painted)
    notes = (f"{clipped.mean():.0%} of the stroke is clipped, and says nothing.",) if clipped.any() else ()
    painted = painted.some(np.flatnonzero(~clipped))
    flat = not _same(painted.shown) and _same(painted.wish)
    parts = [_means(painted, hits, surfaces, limit - limit // BESIDE if flat else limit)]
    if flat and limit >= BESIDE:
        beside = _read(_around(mask), picture, hits, np.ones_like(mask), picture.linear)
        beside = beside.some(np.flatnonzero(np.isin(beside.group, painted.group)))
        if len(beside):
            sample, shown, wish, weight = _means(beside, hits, surfaces, limit // BESIDE)
            parts.append((sample, shown, wish, np.float32(BESIDE_WEIGHT) * weight))
    sample, shown, wish, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    objects, placed = _placed(hits, surfaces, sample)
    marks = Marks(**placed, shown=shown, wanted=wish, weight=weight, offset=_unknown(len(sample)))
    return Marked(objects, marks, flat, notes)


def stroke_of(marked: Marked, scene: Scene, tool: str, **fields: Any) -> Stroke:
    """The stroke that says so, with a new id, and without `name` in the fields a name of its own."""
    given = {"name": stroke_name(scene, tool, marked.objects), "flat": marked.flat, **fields}
    table = marked.marks.table() if len(marked.marks) else None
    return Stroke(id=new_id("stroke"), tool=tool, objects=marked.objects, table=table, **given)


def stroke_name(scene: Scene, tool: str, objects: tuple[NodeId, ...]) -> str:
    """`Replace on Seat`, or `Replace on Seat and 2 others`."""
    names = [scene.nodes[node].name for node in objects if node in scene.nodes]
    if not names:
        return tool.capitalize()
    others = f" and {len(names) - 1} other{'s' if len(names) > 2 else ''}" if len(names) > 1 else ""
    return f"{tool.capitalize()} on {names[0]}{others}"


def _read(pixel: I64, picture: Picture, hits: Hits, mask: F32, wanted: F32) -> _Pixels:
    """Of pixels those that show one surface alone, in finite light."""
    surfaces = picture.radiance.surfaces
    mesh, count = surfaces.mesh, hits.samples**2
    middle = hits.samples // 2 * (hits.samples + 1)
    faces = hits.face.reshape(-1, count)[pixel]
    hit = (faces >= 0).all(axis=1)
    pixel, faces = pixel[hit], faces[hit]
    slots = [placed.mesh.slots.astype(np.int64) for placed in mesh.objects]
    slot = np.concatenate(slots) if slots else np.zeros(0, np.int64)
    several = int(slot.max(initial=0)) + 1
    owner = np.repeat(np.arange(len(slots)), np.diff(mesh.face_offsets))
    group = (owner * several + slot)[faces]
    material = mesh.face_material[faces[:, middle]]
    solid = (surfaces.opacity >= LOOKED_THROUGH) & ~surfaces.catches
    solid = np.append(solid, False)[material]  # −1: no material
    shown, wish = picture.linear.reshape(-1, 3)[pixel], wanted.reshape(-1, 3)[pixel]
    own = (group == group[:, :1]).all(axis=1) & solid
    own &= np.isfinite(shown).all(axis=1) & np.isfinite(wish).all(axis=1)
    share = mask.reshape(-1)[pixel].astype(np.float64)
    made = _Pixels(pixel, pixel * count + middle, group[:, middle], share, shown, wish)
    return made.some(np.flatnonzero(own))


def _clipped(pixels: _Pixels) -> npt.NDArray[np.bool_]:
    """(P,) where a channel is as bright as in many others, and in none more, though what is shown differs."""
    most = pixels.wish.max(axis=0)
    top = (pixels.wish >= most * (1 - SAME)) & (most > 0)
    several = top.sum(axis=0) >= max(FEW, SELDOM * len(pixels))
    made: npt.NDArray[np.bool_] = (top & several).any(axis=1)
    if made.all() or not made.any() or _same(pixels.shown[made]):
        return np.zeros(len(pixels), np.bool_)
    return made


def _around(mask: F32) -> I64:
    """Pixels that are not painted, in the box around those that are, half as large again on each side."""
    rows, columns = (np.flatnonzero((mask > 0).any(axis=axis)) for axis in (1, 0))
    box = np.zeros(mask.shape, np.bool_)
    part = []
    for one in (rows, columns):
        margin = (int(one[-1]) - int(one[0])) // 2 + 1
        part.append(slice(max(int(one[0]) - margin, 0), int(one[-1]) + 1 + margin))
    box[tuple(part)] = True
    return np.flatnonzero(box & (mask == 0))


def _means(pixels: _Pixels, hits: Hits, surfaces: Surfaces, limit: int) -> tuple[I64, F32, F32, F32]:
    """Of at most `limit` cells: the sample each stands at, mean light shown and wanted, and weight."""
    label, chosen = cells_of(_cut_from(pixels, hits, surfaces), limit)
    kept = np.flatnonzero(label >= 0)
    own, label = pixels.some(kept), label[kept]
    total = np.bincount(label, own.share)

    def mean(light: F32) -> F32:
        sums = [np.bincount(label, own.share * light[:, channel]) for channel in range(3)]
        return np.asarray(np.stack(sums, axis=1) / total[:, None], np.float32)

    weight = np.minimum(total / np.bincount(label).max(), 1).astype(np.float32)
    return pixels.sample[chosen], mean(own.shown), mean(own.wish), weight


def _cut_from(pixels: _Pixels, hits: Hits, surfaces: Surfaces) -> Pixels:
    """What cells are cut from."""
    view, sample = hits.view, pixels.sample
    way = np.empty((len(sample), 3), np.float32)
    sample_directions(pinhole(view), sample, way)
    distance = hits.distance[sample]
    angle = np.float32(2 * math.tan(math.radians(view.fov) / 2) / view.rows)
    number = np.unique(pixels.group, return_inverse=True)[1].astype(np.int64)
    x, y = pixels.pixel % view.width, pixels.pixel // view.width
    normal = _face_normals(surfaces, hits, sample)
    return Pixels(x, y, number, pixels.share, way * distance[:, None], normal, angle * distance)


def _face_normals(surfaces: Surfaces, hits: Hits, sample: I64) -> F32:
    """(P, 3) unit normals of faces that samples meet, towards the eye."""
    mesh = surfaces.mesh
    faces, which = np.unique(hits.face[sample], return_inverse=True)
    corners = mesh.positions[mesh.faces[faces]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    behind = ((eye_in(surfaces, hits.view) - corners[:, 0]) * normals).sum(axis=1) < 0
    normals[behind] *= -1
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray((normals / np.maximum(length, 1e-30))[which], np.float32)


def _placed(hits: Hits, surfaces: Surfaces, sample: I64) -> tuple[tuple[NodeId, ...], dict[str, Any]]:
    """Objects, and of marks at samples (M,) their object, place, normal and slot, and the eye."""
    mesh = surfaces.mesh
    eye = np.asarray(hits.view.transform.translation, np.float64)
    points = surface_points(surfaces, some_hits(hits, sample), eye)
    face = hits.face[sample].astype(np.int64)
    owner = np.searchsorted(mesh.face_offsets, face, side="right") - 1
    known, number, count = np.unique(owner, return_inverse=True, return_counts=True)
    order = np.argsort(-count, kind="stable")  # what a stroke is mostly on comes first
    known, number = known[order], np.argsort(order)[number]
    place = points.positions.astype(np.float64) + points.origin
    normal = points.normals.astype(np.float64)
    slot = np.zeros(len(face), np.int64)
    for one in known.tolist():
        own, placed = owner == one, mesh.objects[one]
        turn, to = rotation_matrix(placed.transform.rotation), placed.transform
        place[own] = (place[own] - to.translation) @ turn / to.scale
        normal[own] = normal[own] @ turn
        slot[own] = placed.mesh.slots[face[own] - mesh.face_offsets[one]]
    told = {
        "object": number.astype(np.int64),
        "place": place.astype(np.float32),
        "normal": normal.astype(np.float32),
        "slot": slot,
        "eye": np.tile(eye.astype(np.float32), (len(face), 1)),
    }
    return tuple(mesh.objects[one].node for one in known.tolist()), told


def _same(light: F32) -> bool:
    """Whether light (P, 3) is the same everywhere."""
    low, high = light.min(axis=0), light.max(axis=0)
    return bool((high - low <= SAME * max(float(np.abs(light).max()), 1e-30)).all())


def _unknown(count: int) -> F32:
    return np.full((count, 3), np.nan, np.float32)


def _no_marks() -> Marks:
    none, three = np.zeros(0, np.int64), np.zeros((0, 3), np.float32)
    return Marks(none, three, three, none, three, three, three, np.zeros(0, np.float32), three)


__all__ = ["LIMIT", "Marked", "marks_of", "stroke_name", "stroke_of"]
