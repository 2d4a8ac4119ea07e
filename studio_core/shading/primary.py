"""What the camera sees at every sample of the picture, and which vertices that shows."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.camera import (
    first_hits,
    pixels_of,
    sample_directions,
    tiles_across,
    tiles_down,
    tiles_in,
)
from studio_core.kernels.edges import mark_edges
from studio_core.kernels.facing import mark_faces, mark_vertices
from studio_core.kernels.raycast import RayCaster
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect
from studio_core.scene.transform import Transform, rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import Casters, EdgeHits, Hits, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

CHUNK = 1 << 11  # tiles
EDGE_SAMPLES = 4  # by itself, in pixels in which something ends: then a pixel is two tiles
LAYERS = 6  # most transparent surfaces looked through
WORTH_KEEPING = 0.7  # above this share of stale tiles all are traced
EVERY = np.zeros(0, np.int64)


@dataclass(frozen=True)
class _Made:
    """The last hits, and all they came from but the view."""

    hits: Hits
    caster: RayCaster
    face_offsets: I64
    transforms: tuple[Transform, ...]
    face_material: npt.NDArray[np.int32]
    clear: npt.NDArray[np.bool_]  # faces that are looked through; empty: none


class PrimaryStage:
    """What the camera sees at every sample of the picture.

    Where only objects moved, samples outside the screen boxes of their old and new places keep their hits.
    """

    needs: tuple[type, ...] = (Surfaces, Casters)
    gives = Hits
    dirtied_by = Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._made: _Made | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Hits:
        """Primary rays, followed on through transparent surfaces; the previous where nothing differs."""
        surfaces, casters, view = inputs[Surfaces], inputs[Casters], frame.view
        lens = pinhole(view)
        clear = _clear_faces(surfaces)
        old = _comparable(self._made, inputs.previous, view, surfaces, casters)
        tiles = EVERY
        if old is not None:
            moved = _moved(old, casters)
            if not moved and _same_materials(old, clear, surfaces):
                return old.hits
            tiles = tiles_in(lens, _screen_boxes(moved, old, surfaces, casters, view))
            if len(tiles) > WORTH_KEEPING * tiles_across(lens) * tiles_down(lens):
                old = None
        caster = casters.primary
        hits = self._first(view, lens, surfaces, caster, old.hits if old else None, tiles, job)
        if len(clear):
            every = np.arange(len(hits.face))
            hits = self._beyond(hits, clear, surfaces, caster, every, lens, 0, job)
        if view.fine_edges and view.antialias < EDGE_SAMPLES:
            kept = old.hits.edges if old is not None else None
            edges = self._edges(hits, kept, tiles, clear, surfaces, caster, job)
            hits = dataclasses.replace(hits, edges=edges, traced=hits.traced + edges.hits.traced)
        mesh = surfaces.mesh
        self._made = _Made(hits, caster, mesh.face_offsets, casters.transforms, mesh.face_material, clear)
        return hits

    def _first(
        self,
        view: View,
        lens: F64,
        surfaces: Surfaces,
        caster: RayCaster,
        old: Hits | None,
        tiles: I64,
        job: Job,
    ) -> Hits:
        """First hits: all of them, or the old ones with some tiles traced again."""
        size = view.width * view.height * view.antialias**2
        if old is None:
            count, tiles = tiles_across(lens) * tiles_down(lens), EVERY
            face = np.empty(size, np.int32)
            u, v, distance = (np.empty(size, np.float32) for _ in range(3))
        elif not len(tiles):
            return dataclasses.replace(old, behind=(), traced=0, edges=None)
        else:
            count = len(tiles)
            face, u, v, distance = old.face.copy(), old.u.copy(), old.v.copy(), old.distance.copy()
        self._trace(view, lens, surfaces, caster, count, tiles, (face, u, v, distance), False, job)
        traced = min(8 * count, size)
        caster.count(traced)
        return Hits(view, view.antialias, face, u, v, distance, traced=traced)

    def _trace(
        self,
        view: View,
        lens: F64,
        surfaces: Surfaces,
        caster: RayCaster,
        count: int,
        tiles: I64,
        into: tuple[npt.NDArray[np.int32], F32, F32, F32],
        compact: bool,
        job: Job,
    ) -> None:
        eye = caster.local(view.transform.translation)
        handles = caster.handles()
        faces = (handles.face_start, handles.face_ids, surfaces.mesh.face_offsets)

        def look(start: int, stop: int) -> None:
            given = (handles.intersect8, handles.scene, eye, lens, *faces, tiles)
            first_hits(*given, *into, compact, start, stop)

        self._workers.run(count, CHUNK, look, job)

    def _edges(
        self,
        hits: Hits,
        kept: EdgeHits | None,
        tiles: I64,
        clear: npt.NDArray[np.bool_],
        surfaces: Surfaces,
        caster: RayCaster,
        job: Job,
    ) -> EdgeHits:
        """Hits of pixels in which something ends; those of `kept` that lie in none of the tiles are taken."""
        view = dataclasses.replace(hits.view, antialias=EDGE_SAMPLES, fine_edges=False)
        lens, pixels, count = pinhole(view), edge_pixels(hits, surfaces, self._workers, job), EDGE_SAMPLES**2
        known, place = np.zeros(len(pixels), np.bool_), np.zeros(len(pixels), np.int64)
        if kept is not None and len(kept.pixels):
            place = np.searchsorted(kept.pixels, pixels).clip(max=len(kept.pixels) - 1)
            known = kept.pixels[place] == pixels
            known &= ~np.isin(pixels, pixels_of(pinhole(hits.view), tiles))
        asked = pixels[~known]
        # a pixel is two tiles: the hits of one after the other are its samples row by row
        upper = asked // view.width * (2 * view.width) + asked % view.width
        halves = np.stack([upper, upper + view.width], axis=1).reshape(-1)
        size = 8 * len(halves)
        face = np.empty(size, np.int32)
        u, v, distance = (np.empty(size, np.float32) for _ in range(3))
        if size:
            given = (len(halves), halves, (face, u, v, distance), True, job)
            self._trace(view, lens, surfaces, caster, *given)
            caster.count(size)
        if kept is not None and known.any():
            source = np.where(known, place, np.cumsum(~known) - 1 + len(kept.pixels))
            rows = (source[:, None] * count + np.arange(count)).reshape(-1)
            old = kept.hits
            face, distance = np.append(old.face, face)[rows], np.append(old.distance, distance)[rows]
            u, v = np.append(old.u, u)[rows], np.append(old.v, v)[rows]
        fine = Hits(view, EDGE_SAMPLES, face, u, v, distance, traced=size)
        if len(clear):
            every = EdgeHits(pixels, fine).of_picture(np.arange(len(fine.face)))
            fine = self._beyond(fine, clear, surfaces, caster, every, lens, 0, job)
        return EdgeHits(pixels, fine)

    def _beyond(
        self,
        hits: Hits,
        clear: npt.NDArray[np.bool_],
        surfaces: Surfaces,
        caster: RayCaster,
        samples: I64,
        lens: F64,
        depth: int,
        job: Job,
    ) -> Hits:
        """The hits with what is seen through those on transparent surfaces."""
        if depth == LAYERS or not len(samples):
            return hits
        met = np.flatnonzero(hits.face >= 0)
        through = met[clear[hits.face[met]]]
        if not len(through):
            return hits
        directions = np.empty((len(through), 3), np.float32)
        sample_directions(lens, samples[through], directions)
        gone = hits.distance[through].astype(np.float64) * (1 + 1e-5) + caster.epsilon
        origins = np.asarray(hits.view.transform.translation) + gone[:, None] * directions
        found = caster.closest(origins, directions, 0.0, np.inf, self._workers, job)
        hit = found.object >= 0
        face = np.where(hit, surfaces.mesh.face_offsets[found.object] + found.face, -1).astype(np.int32)
        distance = (found.t + gone).astype(np.float32)
        u, v = np.ascontiguousarray(found.u), np.ascontiguousarray(found.v)
        rest = Hits(hits.view, hits.samples, face, u, v, distance)
        rest = self._beyond(rest, clear, surfaces, caster, samples[through], lens, depth + 1, job)
        traced = hits.traced + len(through) + rest.traced
        return dataclasses.replace(hits, behind=((through, rest),), traced=traced)


def _clear_faces(surfaces: Surfaces) -> npt.NDArray[np.bool_]:
    """(F,) faces that are looked through; empty where there are none."""
    if not (surfaces.opacity < 1).any():
        return np.zeros(0, np.bool_)
    made: npt.NDArray[np.bool_] = surfaces.opacity[surfaces.mesh.face_material] < 1
    return made


def edge_pixels(hits: Hits, surfaces: Surfaces, workers: Workers, job: Job | None = None) -> I64:
    """(E,) pixels, rising, in which something that is seen ends, through what is transparent too.

    That is an object, a material, what stands before something further away, or a smooth surface (a crease).
    """
    mesh, view = surfaces.mesh, hits.view
    marked = np.zeros(view.width * view.height, np.bool_)
    face, u, v, distance = hits.face, hits.u, hits.v, hits.distance
    rests, samples = hits.behind, EVERY

    def mark(start: int, stop: int) -> None:
        seen = (hits.samples, face, u, v, distance)
        mark_edges(
            start, stop, view.width, *seen, mesh.faces, mesh.normals, mesh.object, mesh.face_material, marked
        )

    workers.run(len(marked), CHUNK, mark, job)
    while rests:
        ((index, rest),) = rests
        samples = samples[index] if len(samples) else index
        face, u, v, distance = face.copy(), u.copy(), v.copy(), distance.copy()
        face[samples], distance[samples] = rest.face, rest.distance
        u[samples], v[samples] = rest.u, rest.v
        workers.run(len(marked), CHUNK, mark, job)
        rests = rest.behind
    return np.flatnonzero(marked)


def _same_materials(old: _Made, clear: npt.NDArray[np.bool_], surfaces: Surfaces) -> bool:
    if not np.array_equal(clear, old.clear):
        return False
    return old.hits.edges is None or np.array_equal(old.face_material, surfaces.mesh.face_material)


def _comparable(
    old: _Made | None, previous: Hits | None, view: View, surfaces: Surfaces, casters: Casters
) -> _Made | None:
    """The old hits if they are the previous ones, of the same view and meshes but for objects that moved."""
    if old is None or old.hits is not previous or old.hits.view != view or old.caster is not casters.primary:
        return None
    return old if np.array_equal(old.face_offsets, surfaces.mesh.face_offsets) else None


def _moved(old: _Made, casters: Casters) -> list[int]:
    pairs = zip(old.transforms, casters.transforms, strict=True)
    return [index for index, (before, now) in enumerate(pairs) if before != now]


def _screen_boxes(moved: list[int], old: _Made, surfaces: Surfaces, casters: Casters, view: View) -> I64:
    """(N, 4) samples (left, top, right, bottom) that may see a moved object where it was or is."""
    boxes = []
    for index in moved:
        points = surfaces.mesh.objects[index].mesh.positions
        if not len(points):
            continue
        low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
        for transform in (old.transforms[index], casters.transforms[index]):
            boxes.append(screen_box(low, high, transform, view, casters.primary.epsilon))
    return np.array(boxes, np.int64).reshape(-1, 4)


def screen_box(
    low: F64, high: F64, transform: Transform, view: View, margin: float
) -> tuple[int, int, int, int]:
    """Samples (left, top, right, bottom) that may see any of a placed box; `margin` metres are added to it.

    Right and bottom are the first beyond. The box may reach past the picture; all of the picture when it
    reaches behind the eye.
    """
    matrix = transform.matrix()
    steps = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    corners = (low + steps * (high - low)) @ matrix[:3, :3].T + matrix[:3, 3]
    seen = (corners - view.transform.translation) @ rotation_matrix(view.transform.rotation)
    seen = np.concatenate([seen - margin, seen + margin])
    columns, rows = view.width * view.antialias, view.height * view.antialias
    if (seen[:, 2] > 0).all():
        return (0, 0, 0, 0)
    if (seen[:, 2] > -margin).any():
        return (0, 0, columns, rows)
    lens = pinhole(view)
    # per axis on its own: the box of margins around a corner has corners of other signs too
    reach = margin / -seen[:, 2] * (1 + np.abs(seen[:, :2] / seen[:, 2:]).max(axis=1))
    across = seen[:, 0] / -seen[:, 2] / lens[2]
    up = seen[:, 1] / -seen[:, 2] / lens[3]
    wide, high_ = reach / lens[2], reach / lens[3]
    limit = 4.0  # times the picture: keeps whole numbers small
    left, right = np.clip([(across - wide).min(), (across + wide).max()], -limit, limit)
    bottom, top = np.clip([(up - high_).min(), (up + high_).max()], -limit, limit)
    down, above = view.rows * view.antialias, view.top * view.antialias
    return (
        int(np.floor((left + 1) / 2 * columns)) - 1,
        int(np.floor((1 - top) / 2 * down)) - 1 - above,
        int(np.ceil((right + 1) / 2 * columns)) + 1,
        int(np.ceil((1 - bottom) / 2 * down)) + 1 - above,
    )


def pinhole(view: View) -> F64:
    """A view as `kernels.camera` wants it."""
    up = np.tan(np.radians(view.fov) / 2)
    rotation = rotation_matrix(view.transform.rotation)
    size = (view.width, view.antialias, up * view.width / view.rows, up, view.height)
    return np.array([*size, *rotation.ravel(), view.top, view.rows], np.float64)


def eye_in(surfaces: Surfaces, view: View) -> F64:
    """(3,) where the view looks from, relative to the mesh's origin."""
    return np.asarray(view.transform.translation, np.float64) - surfaces.mesh.origin


def visible_vertices(surfaces: Surfaces, hits: Hits) -> npt.NDArray[np.bool_]:
    """(V,) the corners of every face that a sample sees, on the side it sees."""
    mesh = surfaces.mesh
    seen, touched = np.zeros(len(mesh.positions), np.bool_), np.zeros(len(mesh.faces), np.bool_)
    layers = [hits] if hits.edges is None else [hits, hits.edges.hits]
    for layer in layers:
        mark_faces(layer.face, touched)
        layers.extend(rest for _, rest in layer.behind)
    mark_vertices(touched, mesh.positions, mesh.faces, mesh.back_faces, eye_in(surfaces, hits.view), seen)
    return seen
