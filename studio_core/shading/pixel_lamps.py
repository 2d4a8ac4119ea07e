"""Lamps summed at every hit of the picture: highlights as sharp as the model says.

Between vertices a lamp's light is interpolated; a highlight narrower than the mesh is lost or wanders.
Point, spot and directional lamps need one shadow ray (or a few) a hit, so these can be lit one by one, by
the same light sum as vertices (`brute_force.lamp_layer`), at the hit's own normal (with its map), tangent and
roughness (with its picture and paint).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.shading.artifacts import (
    Casters,
    ChosenPoints,
    Hits,
    Lamp,
    Lighting,
    Radiance,
    Shapes,
    Surfaces,
)
from studio_core.shading.brute_force import all_points, lamp_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept
from studio_core.shading.normal_maps import NORMAL, normal_texture
from studio_core.shading.pipeline import Inputs
from studio_core.shading.surface_points import (
    between_vertices,
    mapped_points,
    some_hits,
    surface_points,
    surface_uvs,
)
from studio_core.shading.varying import ShapeTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

NEEDS = (Surfaces, Casters, Shapes, Lighting, Hits)
"""What `PixelLampsMaker` asks its stage for."""
KINDS = ("point", "spot", "directional")
SUN_RAYS = 16  # a hit, to a directional lamp that is a disc
HITS = 1 << 15  # at a time
KEPT = 64


@dataclass(eq=False)
class PixelLamps:
    """Satisfies `studio_core.shading.artifacts.PixelLight`. `counts` says how many hits were lit."""

    surfaces: Surfaces
    casters: Casters
    lamps: dict[str, Lamp]
    eye: F64
    look: Callable[[ChosenPoints, Hits], tuple[ChosenPoints, Shapes]]
    workers: Any
    counts: dict[str, int] = dataclasses.field(default_factory=lambda: {"hits_lit": 0})
    _kept: dict[tuple[str, int], tuple[Hits, object, F32]] = dataclasses.field(default_factory=dict)

    @property
    def nodes(self) -> frozenset[str]:
        """The lamps."""
        return frozenset(self.lamps)

    def colours(
        self, node: str, hits: Hits, looks: Callable[[Hits], F32], key: object, job: Job | None = None
    ) -> F32:
        """As `PixelLight.colours`; kept while hits and key are the same objects."""
        known = self._kept.get((node, id(hits)))
        if known is None or known[0] is not hits or known[1] is not key:
            if len(self._kept) > KEPT:
                self._kept.clear()
            known = hits, key, self._lit(node, hits, looks, job or Job("Lamps"))
            self._kept[node, id(hits)] = known
        return known[2]

    def _lit(self, node: str, hits: Hits, looks: Callable[[Hits], F32], job: Job) -> F32:
        made = np.zeros((len(hits.face), 3), np.float32)
        met = np.flatnonzero(hits.face >= 0)
        met = met[~self.surfaces.catches[self.surfaces.mesh.face_material[hits.face[met]]]]
        for first in range(0, len(met), HITS):
            block = met[first : first + HITS]
            some = some_hits(hits, block)
            points = surface_points(self.surfaces, some, self.eye)
            facing, there = self.look(points, some)
            layer = lamp_layer(
                facing, there, self.casters.shadow, self.lamps[node], self.eye, all_points(points),
                SUN_RAYS, self.workers, job, points,
            )  # fmt: skip
            own = looks(some)
            width = min(own.shape[1], layer.terms.shape[1])
            made[block] = (layer.terms[:, :width] * own[:, :width]).sum(axis=1)
        self.counts["hits_lit"] += len(met)
        return made


class PixelLampsMaker:
    """Puts `PixelLamps` into radiance; the same ones while nothing that they were made for changes."""

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._table = ShapeTable(services.registry)
        self._made: Kept[PixelLamps] = Kept()

    def __call__(self, frame: Frame, inputs: Inputs, made: Radiance) -> Radiance:
        """The same radiance where no lamp can be lit hit by hit."""
        surfaces, casters, lighting = inputs[Surfaces], inputs[Casters], inputs[Lighting]
        lamps = {
            lamp.node: lamp for lamp in lighting.lamps if lamp.kind in KINDS and lamp.node in made.layers
        }
        if not lamps:
            return made
        looks = [frame.scene.material(name) for name in surfaces.materials]
        reliefs = [part for look in looks for part in (normal_texture(look), look.values.get(NORMAL))]
        key = (surfaces, casters, inputs[Shapes], made.hits, *lamps.values(), *reliefs)
        scene, table, materials = frame.scene, self._table, surfaces.materials

        eye = np.asarray(frame.view.transform.translation, np.float64)

        def look(points: ChosenPoints, hits: Hits) -> tuple[ChosenPoints, Shapes]:
            uvs, between = surface_uvs(surfaces, hits, eye), between_vertices(surfaces, hits, eye)
            shapes = dataclasses.replace(table.at(scene, materials, points.material, uvs, between), tilt=None)
            return mapped_points(scene, surfaces, points, uvs), shapes

        def fresh() -> PixelLamps:
            return PixelLamps(surfaces, casters, lamps, eye, look, self._workers)

        pixel = self._made(fresh, *key)
        return made if made.pixel is pixel else dataclasses.replace(made, pixel=pixel)


__all__ = ["KINDS", "NEEDS", "PixelLamps", "PixelLampsMaker"]
