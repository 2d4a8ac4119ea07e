"""Pictures without OpenGL: interpolated radiance at primary hits, textures and background per pixel.

A picture is made of four things that change for different reasons, and each is kept until one of its own
reasons changes: sides and texel density of faces (mesh, eye), what pixels see of objects (hits), the
background (hits, environment), and the colours of vertices, which are all that another light or another
BRDF costs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.contract import Services
from studio_core.kernels.background import background_hits
from studio_core.kernels.compose import (
    GENERAL,
    RECORD,
    add_light,
    add_samples,
    average,
    face_texels,
    hit_coefficients,
    outline_pixels,
    shade_hits,
)
from studio_core.kernels.facing import shown_sides
from studio_core.kernels.tonemap import prepare
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Environment, Light, Scene
from studio_core.scene.transform import rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import (
    TERMS,
    Backdrop,
    EdgeHits,
    Hits,
    Picture,
    Radiance,
    Surfaces,
    VertexColours,
)
from studio_core.shading.coefficients import Coefficients, CoefficientTable, Maps
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lamps import shown_environment
from studio_core.shading.materials import linear_rgb
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import eye_in, pinhole, visible_vertices

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]

PIXELS = 1 << 12
FACES = 1 << 13
VERTICES = 1 << 13
NONE = np.zeros(0, np.float32)
EVERY = np.zeros(0, np.int64)
NO_COLOUR = np.zeros((0, 3), np.float32)
T = TypeVar("T")


class PictureStage:
    """Linear pixels of what the camera sees, from radiance at vertices."""

    needs: tuple[type, ...] = (Surfaces, Hits, Radiance)
    gives = Picture
    dirtied_by = Aspect.MATERIAL | Aspect.GAIN | Aspect.LIGHT | Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._coefficients = CoefficientTable(services.registry)
        self._compositor = Compositor(services.workers)
        prepare()  # or the window would wait for it

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Picture:
        """The picture; no light is summed here. Radiance may come with hits of its own, on a finer mesh."""
        radiance = inputs[Radiance]
        hits = inputs[Hits] if radiance.hits is None else radiance.hits
        table = self._coefficients(frame.scene, radiance.surfaces)
        return self._compositor.picture(frame.scene, radiance, hits, table, job)


class Kept(Generic[T]):
    """The last value, for as long as the very same objects are asked for."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] | None = None
        self._value: T | None = None

    def __call__(self, make: Callable[[], T], *key: object) -> T:
        """The value made from `key`; `make` is called where one of it is another object than last time."""
        same = self._key is not None and all(a is b for a, b in zip(self._key, key, strict=True))
        if not same or self._value is None:
            self._key = self._value = None  # if making fails, nothing is kept
            self._value = make()
            self._key = key
        return self._value


@dataclass(frozen=True, eq=False)
class _Layer:
    """Hits, which samples of the picture they are (empty: all), and how much each counts (empty: fully)."""

    hits: Hits
    samples: I64
    weight: F32


@dataclass(frozen=True, eq=False)
class _Part:
    """Pixels of a picture (empty: all) and the layers of hits that they are made of."""

    pixels: I64
    layers: tuple[_Layer, ...]

    def of_picture(self, own: I64) -> I64:
        """Which samples of the picture (in which all pixels have as many) some of this part are."""
        if not len(self.pixels):
            return own
        hits = self.layers[0].hits
        return EdgeHits(self.pixels, hits).of_picture(own if len(own) else np.arange(len(hits.face)))


@dataclass(frozen=True, eq=False)
class _Outline:
    coverage: F32
    node: I32
    distance: F32


class _Faces(NamedTuple):
    """What kernels ask of faces: corners on the side that is seen, height, texel density, material."""

    shown: U32
    height: F32
    density: F32
    material: I32


class _Tables(NamedTuple):
    """Colours of vertices and maps of materials; see `kernels.compose.shade_hits`."""

    kind: I64
    record: F32
    sums: F32
    texels: F32
    tables: F32
    first: I64
    size: I64
    levels: I64
    uv_scale: F32
    pixel_angle: float


class Compositor:
    """Pictures and single hits from radiance at vertices. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._sides: Kept[tuple[U32, F32]] = Kept()
        self._density: Kept[F32] = Kept()
        self._parts: Kept[tuple[_Part, ...]] = Kept()
        self._outline: Kept[_Outline] = Kept()
        self._background: Kept[list[F32]] = Kept()
        self._sky: Kept[F32] = Kept()
        self._corners: Kept[npt.NDArray[np.bool_]] = Kept()

    def picture(
        self, scene: Scene, radiance: Radiance, hits: Hits, table: Coefficients, job: Job | None = None
    ) -> Picture:
        """Linear (H, W, 3) with the environment behind where it is to be seen."""
        surfaces, mesh, view = radiance.surfaces, radiance.surfaces.mesh, hits.view
        parts = self._parts(lambda: _parts(hits, surfaces), hits, surfaces.opacity, mesh.face_material)
        outline = self._outline(lambda: self._look(hits, surfaces, job), hits, mesh.faces, mesh.object)
        environment = shown_environment(scene)
        backdrop, backgrounds = None, [NO_COLOUR] * len(parts)
        if environment is not None and environment.background:
            sky = backdrop = self._backdrop(environment)
            backgrounds = self._background(
                lambda: [self._behind(sky, part, job) for part in parts], parts, environment
            )
        faces = self._faces(surfaces, view, table.maps)
        tables = self._tables(scene, radiance, table, view, job)
        out = self._pixels(parts[0], backgrounds[0], faces, tables, job)
        for part, background in zip(parts[1:], backgrounds[1:], strict=True):
            finer = tables._replace(pixel_angle=_pixel_angle(part.layers[0].hits.view))
            out[part.pixels] = self._pixels(part, background, faces, finer, job)
        linear = out.reshape(view.height, view.width, 3)
        corners = self._corners(lambda: visible_vertices(surfaces, hits), hits, mesh)
        colours = VertexColours(tables.record, tables.sums, corners, table.maps, backdrop)
        return Picture(radiance, linear, outline.coverage, outline.node, outline.distance, colours)

    def radiance(
        self, scene: Scene, radiance: Radiance, hits: Hits, table: Coefficients, job: Job | None = None
    ) -> F32:
        """(N, 3) of single hits, as they are shown; 0 where nothing is hit. Nothing is looked through."""
        faces = self._faces(radiance.surfaces, hits.view, table.maps)
        return self._hits(hits, faces, self._tables(scene, radiance, table, hits.view, job), job)

    def coefficients(self, surfaces: Surfaces, hits: Hits, table: Coefficients) -> F32:
        """(N, TERMS, 3) BRDF coefficients of hits on surfaces."""
        maps, out = table.maps, np.zeros((len(hits.face), TERMS * 3), np.float32)
        faces = (*self._faces(surfaces, hits.view, maps), surfaces.mesh.uvs)
        looks = (maps.kind, table.plain, table.slope, maps.texels, maps.tables)
        layout = (maps.first, maps.size, maps.levels, maps.uv_scale, _pixel_angle(hits.view))
        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *looks, *layout)
        hit_coefficients(*given, out)
        return out.reshape(-1, TERMS, 3)

    def _pixels(self, part: _Part, background: F32, faces: _Faces, tables: _Tables, job: Job | None) -> F32:
        """(P, 3) the pixels of a part; background (P, 3) is added, or nothing."""
        layers, hits = part.layers, part.layers[0].hits
        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *tables)
        alone = hits.samples == 1 and not hits.behind  # then the background fills what is not hit

        def look(start: int, stop: int, values: F32) -> None:
            shade_hits(start, stop, *given, background if alone else NO_COLOUR, values)

        out = self._averaged(layers[0], look, NO_COLOUR if alone else background, job)
        for layer in layers[1:]:
            values = self._hits(layer.hits, faces, tables, job)
            add_samples(layer.samples, hits.samples**2, layer.weight, values, out)
        return out

    def _hits(self, hits: Hits, faces: _Faces, tables: _Tables, job: Job | None) -> F32:
        out = np.empty((len(hits.face), 3), np.float32)

        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *tables)

        def shade(start: int, stop: int) -> None:
            shade_hits(start, stop, *given, NO_COLOUR, out[start:stop])

        self._workers.run(len(out), PIXELS, shade, job)
        return out

    def _faces(self, surfaces: Surfaces, view: View, maps: Maps) -> _Faces:
        mesh = surfaces.mesh
        count = len(mesh.faces)

        def sides() -> tuple[U32, F32]:
            eye = eye_in(surfaces, view)
            shown, height = np.empty((count, 3), np.uint32), np.empty(count, np.float32)

            def look(start: int, stop: int) -> None:
                shown_sides(start, stop, mesh.positions, mesh.faces, mesh.back_faces, eye, shown, height)

            self._workers.run(count, FACES, look)
            return shown, height

        def density() -> F32:
            out = np.empty(count, np.float32)
            layout = (maps.kind, maps.size, maps.uv_scale)

            def look(start: int, stop: int) -> None:
                corners = (mesh.positions, mesh.uvs, mesh.faces, mesh.face_material)
                face_texels(start, stop, *corners, *layout, out)

            self._workers.run(count, FACES, look)
            return out

        shown, height = self._sides(sides, mesh, view)
        return _Faces(shown, height, self._density(density, mesh, maps), mesh.face_material)

    def _tables(
        self, scene: Scene, radiance: Radiance, table: Coefficients, view: View, job: Job | None
    ) -> _Tables:
        mesh, maps = radiance.surfaces.mesh, table.maps
        count = len(radiance.valid)
        record = np.zeros((count, RECORD), np.float32)
        record[:, 6:] = mesh.uvs
        sums = np.zeros((count if (maps.kind == GENERAL).any() else 0, TERMS * 3), np.float32)
        for node, layer in radiance.layers.items():
            light = scene.nodes.get(node)
            if not isinstance(light, Light) or not scene.shown(node):
                continue
            terms = np.ascontiguousarray(layer.terms, np.float32).reshape(count, TERMS * 3)
            of_light = (terms, np.asarray(light.gain(), np.float32), radiance.valid)
            given = (*of_light, mesh.material, maps.kind, table.plain, table.slope, record, sums)
            self._workers.run(count, VERTICES, partial(_add_light, given), job)
        layout = (maps.first, maps.size, maps.levels, maps.uv_scale)
        return _Tables(maps.kind, record, sums, maps.texels, maps.tables, *layout, _pixel_angle(view))

    def _look(self, hits: Hits, surfaces: Surfaces, job: Job | None) -> _Outline:
        mesh, view = surfaces.mesh, hits.view

        def outline(seen: Hits) -> tuple[F32, I32, F32]:
            count = len(seen.face) // seen.samples**2
            made = (np.empty(count, np.float32), np.empty(count, np.int32), np.empty(count, np.float32))

            def look(start: int, stop: int) -> None:
                rays = (seen.samples**2, seen.face, seen.distance, mesh.faces, mesh.object)
                outline_pixels(start, stop, *rays, *made)

            self._workers.run(count, PIXELS, look, job)
            return made

        coverage, node, distance = outline(hits)
        if hits.edges is not None:
            coverage[hits.edges.pixels] = outline(hits.edges.hits)[0]
        shape = (view.height, view.width)
        return _Outline(coverage.reshape(shape), node.reshape(shape), distance.reshape(shape))

    def _backdrop(self, environment: Environment) -> Backdrop:
        pixels = self._sky(lambda: readonly(linear_rgb(environment.image), np.float32), environment.image)
        to_picture = environment.rotation().matrix()[:3, :3].T
        return Backdrop(pixels, to_picture.astype(np.float32), np.array(environment.gain(), np.float32))

    def _behind(self, backdrop: Backdrop, part: _Part, job: Job | None) -> F32:
        """(P, 3) what of the environment the pixels of a part see beside objects and through them."""
        layers, view = part.layers, part.layers[0].hits.view
        samples = part.of_picture(EVERY)
        lens = pinhole(view)
        turn = np.ascontiguousarray(backdrop.turn @ rotation_matrix(view.transform.rotation), np.float32)
        sky = (turn, backdrop.pixels, backdrop.gain)

        def look(start: int, stop: int, values: F32) -> None:
            background_hits(start, stop, lens, samples, layers[0].hits.face, *sky, values)

        out = self._averaged(layers[0], look, NO_COLOUR, job)
        for layer in layers[1:]:
            values = np.empty((len(layer.samples), 3), np.float32)
            place = part.of_picture(layer.samples)
            background_hits(0, len(values), lens, place, layer.hits.face, *sky, values)
            add_samples(layer.samples, layer.hits.samples**2, layer.weight, values, out)
        return out

    def _averaged(
        self,
        layer: _Layer,
        look: Callable[[int, int, F32], None],
        background: F32,
        job: Job | None,
    ) -> F32:
        """(P, 3) pixels whose samples `look` writes; background (P, 3), or nothing, is added."""
        count = layer.hits.samples**2
        out = np.empty((len(layer.hits.face) // count, 3), np.float32)

        def fill(start: int, stop: int) -> None:
            if count == 1 and not len(layer.weight) and not len(background):
                look(start, stop, out[start:stop])
                return
            first, last = start * count, stop * count
            values = np.empty((last - first, 3), np.float32)
            look(first, last, values)
            average(count, values, layer.weight[first:last], background[start:stop], out[start:stop])

        self._workers.run(len(out), PIXELS, fill, job)
        return out


def _add_light(given: tuple[Any, ...], start: int, stop: int) -> None:
    add_light(start, stop, *given)


def _pixel_angle(view: View) -> float:
    """Radians between samples, about."""
    return float(2 * np.tan(np.radians(view.fov) / 2) / (view.rows * view.antialias))


def _parts(hits: Hits, surfaces: Surfaces) -> tuple[_Part, ...]:
    """All pixels, then those whose hits stand in the place of theirs."""
    every = _Part(EVERY, _layers(hits, surfaces))
    if hits.edges is None or not len(hits.edges.pixels):
        return (every,)
    return (every, _Part(hits.edges.pixels, _layers(hits.edges.hits, surfaces)))


def _layers(hits: Hits, surfaces: Surfaces) -> tuple[_Layer, ...]:
    """The hits and what is seen through them, each with what the surfaces before it let through."""
    made: list[_Layer] = []

    def add(layer: Hits, samples: I64, arrives: F32) -> None:
        weight = arrives.copy()
        if layer.behind and not len(weight):
            weight = np.ones(len(layer.face), np.float32)
        made.append(_Layer(layer, samples, weight))
        for index, rest in layer.behind:
            alpha = surfaces.opacity[surfaces.mesh.face_material[layer.face[index]]]
            passed = weight[index] * (1 - alpha)
            weight[index] *= alpha
            add(rest, samples[index] if len(samples) else index, passed)

    add(hits, EVERY, NONE)
    return tuple(made)


__all__ = ["CoefficientTable", "Coefficients", "Compositor", "PictureStage"]
