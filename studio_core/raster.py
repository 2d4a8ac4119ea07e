"""Pictures without OpenGL: interpolated radiance at primary hits, textures and background per pixel.

A picture is made of four things that change for different reasons, and each is kept until one of its own
reasons changes: sides and texel density of faces (mesh, eye), what pixels see of objects (hits), the
background (hits, environment), and the colours of vertices, which are all that another light or another
BRDF costs.

Surfaces that catch shadows show the backdrop: the photograph that the scene stands in, times the light that
arrives there over what arrived when it was taken.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.contract import Services
from studio_core.false_colour import linear_colours
from studio_core.kernels.compose import (
    GENERAL,
    RECORD,
    add_caught,
    add_light,
    add_samples,
    hit_coefficients,
    outline_pixels,
    shade_hits,
)
from studio_core.kernels.facing import shown_sides
from studio_core.kernels.tonemap import prepare
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Light, Scene
from studio_core.session import SHARE, View
from studio_core.shading.artifacts import (
    Hits,
    Picture,
    Radiance,
    Surfaces,
    VertexColours,
)
from studio_core.shading.backdrop import NOTHING, BackdropPainter, Behind
from studio_core.shading.coefficients import Coefficients, CoefficientTable, Maps
from studio_core.shading.embossing import FACES, VERTICES, Embosser, Relief, embossed, lit, texels_of_faces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept
from studio_core.shading.lamps import shown_environment
from studio_core.shading.layers import EVERY, NO_COLOUR, PIXELS, Layer, Part, averaged, caught_hits, parts_of
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import eye_in, visible_vertices
from studio_core.shading.soundness import Soundness

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]


NO_SHARE = 0.035
"""Grey, linear, of pixels that show no surface."""
_LUMINANCE = np.array(LUMINANCE, np.float32)


class PictureStage:
    """Linear pixels of what the camera sees, from radiance at vertices."""

    needs: tuple[type, ...] = (Surfaces, Hits, Radiance)
    gives = Picture
    dirtied_by = Aspect.MATERIAL | Aspect.GAIN | Aspect.LIGHT | Aspect.VIEW | Aspect.INDIRECT

    def __init__(self, services: Services) -> None:
        self._coefficients = CoefficientTable(services.registry)
        self._compositor = Compositor(services.workers)
        self._soundness = Soundness()
        prepare()  # or the window would wait for it

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Picture:
        """The picture; no light is summed here. Radiance may come with hits of its own, on a finer mesh."""
        radiance = inputs[Radiance]
        hits = inputs[Hits] if radiance.hits is None else radiance.hits
        self._soundness.check(radiance, hits)  # before kernels index with it
        table = self._coefficients(frame.scene, radiance.surfaces)
        make = self._compositor.share if frame.light == SHARE else self._compositor.picture
        return make(frame.scene, radiance, hits, table, job)


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
    uv_map: F32
    pixel_angle: float


class Compositor:
    """Pictures and single hits from radiance at vertices. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._sides: Kept[tuple[U32, F32]] = Kept()
        self._density: Kept[F32] = Kept()
        self._embosser = Embosser(workers)
        self._parts: Kept[tuple[Part, ...]] = Kept()
        self._outline: Kept[_Outline] = Kept()
        self._behind: Kept[list[Behind]] = Kept()
        self._backdrop = BackdropPainter(workers)
        self._corners: Kept[npt.NDArray[np.bool_]] = Kept()

    def picture(
        self, scene: Scene, radiance: Radiance, hits: Hits, table: Coefficients, job: Job | None = None
    ) -> Picture:
        """Linear (H, W, 3) with the environment behind where it is to be seen."""
        surfaces, mesh, view = radiance.surfaces, radiance.surfaces.mesh, hits.view
        looks = (surfaces.opacity, surfaces.catches, mesh.face_material)
        parts = self._parts(lambda: parts_of(hits, surfaces), hits, *looks)
        outline = self._outline(lambda: self._look(hits, surfaces, job), hits, mesh.faces, mesh.object)
        backdrop, behind = self._backdrop.backdrop(scene), [NOTHING] * len(parts)
        if backdrop is not None:
            sky = backdrop
            behind = self._behind(
                lambda: [self._backdrop.behind(sky, part, job) for part in parts],
                parts,
                shown_environment(scene),
            )
        faces = self._faces(surfaces, view, table.maps)
        tables = self._tables(scene, radiance, table, view, job)
        relief = self._embosser(scene, radiance, table, job)

        def added(hits: Hits) -> F32:
            return self._added(scene, radiance, hits, table, job)

        out = self._pixels(parts[0], behind[0], faces, tables, added, relief, job)
        for part, beyond in zip(parts[1:], behind[1:], strict=True):
            finer = tables._replace(pixel_angle=_pixel_angle(part.layers[0].hits.view))
            out[part.pixels] = self._pixels(part, beyond, faces, finer, added, relief, job)
        linear = out.reshape(view.height, view.width, 3)
        corners = self._corners(lambda: visible_vertices(surfaces, hits), hits, mesh)
        colours = None  # what pixels have of their own nobody else can interpolate
        if radiance.pixel is None:
            maps = (table.maps, backdrop, *((None, None) if relief is None else (relief.bend, table.reliefs)))
            colours = VertexColours(tables.record, tables.sums, corners, *maps)
        return Picture(radiance, linear, outline.coverage, outline.node, outline.distance, colours)

    def share(
        self, scene: Scene, radiance: Radiance, hits: Hits, table: Coefficients, job: Job | None = None
    ) -> Picture:
        """The share of light that came by way of other surfaces, of the luminance of each pixel, as colours.

        Nothing is seen behind objects, nor on what shows the photograph behind it.
        """
        sky = shown_environment(scene)
        if sky is not None:
            scene = scene.with_nodes(dataclasses.replace(sky, background=False))
        whole = self.picture(scene, radiance, hits, table, job)
        between = dataclasses.replace(radiance, layers={}, pixel=None)
        part = self.picture(scene, between, hits, table, job).linear @ _LUMINANCE
        light = whole.linear @ _LUMINANCE
        share = np.divide(part, light, out=np.zeros_like(light), where=light > 0)
        share = np.where(whole.coverage > 0, np.clip(share, 0, 1), np.float32(np.nan))
        colours = linear_colours(share)
        colours[np.isnan(share)] = NO_SHARE
        return dataclasses.replace(whole, linear=colours, colours=None, share=share)

    def radiance(
        self,
        scene: Scene,
        radiance: Radiance,
        hits: Hits,
        table: Coefficients,
        job: Job | None = None,
        samples: I64 = EVERY,
    ) -> F32:
        """(N, 3) of single hits, as they are shown; 0 where nothing is hit. Nothing is looked through.

        What catches shadows shows nothing unless it is known which `samples` (N,) of the picture they are.
        """
        faces = self._faces(radiance.surfaces, hits.view, table.maps)
        tables = self._tables(scene, radiance, table, hits.view, job)
        added = self._added(scene, radiance, hits, table, job)
        out = self._hits(hits, faces, tables, added, self._embosser(scene, radiance, table, job), job)
        rows, photograph = self.photograph(scene, radiance.surfaces, hits, samples)
        given = (rows, rows, 1, np.ones(len(rows), np.float32), hits.face, hits.u, hits.v, faces.shown)
        add_caught(0, len(rows), *given, tables.record, photograph, out)
        return out

    def photograph(self, scene: Scene, surfaces: Surfaces, hits: Hits, samples: I64) -> tuple[I64, F32]:
        """Which of some hits are caught, and the photograph (K, 3) that they show, without gain."""
        rows, backdrop = caught_hits(hits, surfaces), self._backdrop.backdrop(scene)
        if backdrop is None or not len(samples):
            return EVERY, NO_COLOUR
        return rows, self._backdrop.under(backdrop, hits, rows, samples[rows])

    def photographed_light(self, scene: Scene, normals: F32) -> npt.NDArray[np.float64]:
        """(N, 3) the irradiance that the photograph was taken in, at normals (N, 3)."""
        environment = shown_environment(scene)
        if environment is None:
            return np.zeros(normals.shape)
        return self._backdrop.before(environment, normals)

    def coefficients(self, surfaces: Surfaces, hits: Hits, table: Coefficients) -> F32:
        """(N, T, 3) BRDF coefficients of hits on surfaces."""
        maps, out = table.maps, np.zeros((len(hits.face), table.plain.shape[1]), np.float32)
        faces = (*self._faces(surfaces, hits.view, maps), surfaces.mesh.uvs)
        looks = (maps.kind, table.plain, table.slope, maps.texels, maps.tables)
        layout = (maps.first, maps.size, maps.levels, maps.uv_map, _pixel_angle(hits.view))
        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *looks, *layout)
        hit_coefficients(*given, out)
        if len(table.painted):
            corners = table.painted[faces[0][hits.face]]
            share = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)
            out += np.einsum("nkc,nk->nc", corners, share)
        return out.reshape(-1, table.width, 3)

    def _added(
        self, scene: Scene, radiance: Radiance, hits: Hits, table: Coefficients, job: Job | None
    ) -> F32:
        """(N, 3) light of single hits that is summed there, with gains; empty where there is none."""
        own, out = radiance.pixel, NO_COLOUR

        def looks(some: Hits) -> F32:
            return self.coefficients(radiance.surfaces, some, table)

        for node in radiance.layers if own is not None else ():
            light = scene.nodes.get(node)
            if own is None or node not in own.nodes or not isinstance(light, Light) or not scene.shown(node):
                continue
            lit = own.colours(node, hits, looks, table, job) * np.asarray(light.gain(), np.float32)
            out = out + lit if len(out) else lit
        return out

    def _pixels(
        self,
        part: Part,
        behind: Behind,
        faces: _Faces,
        tables: _Tables,
        added: Callable[[Hits], F32],
        relief: Relief | None,
        job: Job | None,
    ) -> F32:
        """(P, 3) the pixels of a part before what is behind them."""
        layers, hits, background = part.layers, part.layers[0].hits, behind.pixels
        own = added(hits)
        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *tables)
        alone = hits.samples == 1 and not hits.behind  # then the background fills what is not hit

        def look(start: int, stop: int, values: F32) -> None:
            shade_hits(start, stop, *given, background if alone else NO_COLOUR, own, values)

        seen = embossed(look, relief, _embossing(hits, faces, tables))
        out = averaged(layers[0], seen, NO_COLOUR if alone else background, self._workers, job)
        for layer in layers[1:]:
            values = self._hits(layer.hits, faces, tables, added(layer.hits), relief, job)
            add_samples(layer.samples, hits.samples**2, layer.weight, values, out)
        for layer, photograph in zip(layers, behind.caught, strict=False):
            if len(layer.caught):
                self._catch(layer, photograph, faces, tables, job, out)
        return out

    def _catch(
        self, layer: Layer, photograph: F32, faces: _Faces, tables: _Tables, job: Job | None, out: F32
    ) -> None:
        """Adds what surfaces show that catch shadows: the photograph (N, 3) behind them, as it is lit."""
        hits, rows = layer.hits, layer.caught
        places = (rows, layer.caught_samples, hits.samples**2, layer.caught_weight)
        given = (*places, hits.face, hits.u, hits.v, faces.shown, tables.record, photograph, out)

        def catch(start: int, stop: int) -> None:
            add_caught(start, stop, *given)

        self._workers.run(len(rows), PIXELS, catch, job)

    def _hits(
        self,
        hits: Hits,
        faces: _Faces,
        tables: _Tables,
        added: F32,
        relief: Relief | None,
        job: Job | None,
    ) -> F32:
        out = np.empty((len(hits.face), 3), np.float32)

        given = (hits.face, hits.u, hits.v, hits.distance, *faces, *tables)

        def shade(start: int, stop: int, values: F32) -> None:
            shade_hits(start, stop, *given, NO_COLOUR, added, values)

        seen = embossed(shade, relief, _embossing(hits, faces, tables))
        self._workers.run(len(out), PIXELS, lambda start, stop: seen(start, stop, out[start:stop]), job)
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
            return texels_of_faces(mesh, maps.kind, maps.size, maps.uv_map, self._workers)

        shown, height = self._sides(sides, mesh, view)
        return _Faces(shown, height, self._density(density, mesh, maps), mesh.face_material)

    def _tables(
        self, scene: Scene, radiance: Radiance, table: Coefficients, view: View, job: Job | None
    ) -> _Tables:
        mesh, maps = radiance.surfaces.mesh, table.maps
        count = len(radiance.valid)
        record = np.zeros((count, RECORD), np.float32)
        record[:, 6:] = mesh.uvs
        sums = np.zeros((count if (maps.kind == GENERAL).any() else 0, table.plain.shape[1]), np.float32)
        for gain, layer in lit(scene, radiance):
            terms = np.ascontiguousarray(layer.of_width(table.width).terms, np.float32)
            terms = terms.reshape(count, table.width * 3)
            of_light = (terms, gain, radiance.valid)
            given = (
                *of_light,
                mesh.material,
                maps.kind,
                table.plain,
                table.slope,
                table.painted,
                record,
                sums,
            )
            self._workers.run(count, VERTICES, partial(_add_light, given), job)
        if radiance.surfaces.catches.any():
            self._backdrop.light(scene, radiance, record)
        layout = (maps.first, maps.size, maps.levels, maps.uv_map)
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


def _embossing(hits: Hits, faces: _Faces, tables: _Tables) -> tuple[Any, ...]:
    """What `add_relief` asks of hits besides normal maps."""
    places = (hits.face, hits.u, hits.v, hits.distance, faces.shown, faces.height, faces.material)
    maps = (tables.texels, tables.first, tables.size, tables.levels, tables.uv_map, tables.pixel_angle)
    return (*places, tables.kind, tables.record, *maps, faces.density)


def _add_light(given: tuple[Any, ...], start: int, stop: int) -> None:
    add_light(start, stop, *given)


def _pixel_angle(view: View) -> float:
    """Radians between samples, about."""
    return float(2 * np.tan(np.radians(view.fov) / 2) / (view.rows * view.antialias))


__all__ = ["CoefficientTable", "Coefficients", "Compositor", "PictureStage"]
