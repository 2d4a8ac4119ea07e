"""`slf`: what the paper's rendering shows (section 6.4): shadowed lamps, and the sky by elements' lumitexels.

Lamps and suns are traced for every vertex. The environment's light is that of about ten thousand elements,
each pre-convolved at the gloss of its material's terms, and splatted to vertices: no contact shadows are
finer than elements are apart, and sharp mirrors are as coarse as cells of directions (5.6°).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Casters, Hits, LayerRadiance, Lighting, Radiance, Shapes, Surfaces
from studio_core.shading.brute_force import (
    VisibilityBits,
    all_points,
    blank_layer,
    environment_layer,
    lamp_layer,
)
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern
from studio_plugins.slf.appearance import Appearance
from studio_plugins.slf.preconvolved import Preconvolved
from studio_plugins.slf.splatting import Splats, blocks, look_up, views
from studio_plugins.slf.whole import BURIED, CHUNK, Whole

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

FEW = 16
"""Rays of a vertex that tell whether it is inside something closed."""
SUNS = 10  # of `environment_layer`, whose leaves are not used


@dataclass(frozen=True)
class Params(SurfaceParams):
    """Parameters of the elements' picture."""

    elements: int = param(10_000, "Elements", "Points that light is kept at", low=100, high=60_000)
    lamp_samples: int = param(64, "Lamp samples", "Shadow rays to an area lamp or a sun", low=1, high=256)
    everywhere: bool = param(False, "Hidden places too", "Also light what the camera does not see")


class ElementStage:
    """Lamps by shadow rays, the environment by elements."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Hits)
    gives = Radiance
    dirtied_by = Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._appearance = Appearance()
        self._whole: Whole | None = None
        self._light = Preconvolved(services.workers)
        self._count = 0
        self._few = Transport(services.workers, cosine_pattern(FEW))
        self._inside = np.zeros(0, np.bool_)
        self._bits: VisibilityBits | None = None

    @property
    def nbytes(self) -> int:
        """Memory of elements and of what they make of the sky's light."""
        return self._light.nbytes + (0 if self._whole is None else self._whole.nbytes)

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        """All layers at unit gain; raises Cancelled at checkpoints."""
        surfaces, lighting, params = inputs[Surfaces], inputs[Lighting], frame.params
        hits, shapes, casters = inputs[Hits], inputs[Shapes], inputs[Casters]
        mesh = surfaces.mesh
        seen = None if params.everywhere else visible_vertices(surfaces, hits)
        points = all_points(mesh, seen)
        eye = np.asarray(frame.view.transform.translation, np.float64)
        layers: dict[str, LayerRadiance] = {
            lamp.node: lamp_layer(
                mesh, shapes, casters.shadow, lamp, eye, points, params.lamp_samples, self._workers, job
            )
            for lamp in lighting.lamps
        }
        counts = {"elements": 0, "rays": 0}
        if lighting.environment is not None:
            if self._bits is None or not self._bits.belongs_to(mesh, casters.shadow):
                self._bits = VisibilityBits(mesh, casters.shadow, self._workers)
            suns = dataclasses.replace(lighting, tree=None)
            layer = environment_layer(mesh, shapes, suns, self._bits, eye, points, SUNS, self._workers, job)
            if lighting.tree is not None:
                counts |= self.follow(surfaces, casters, lighting, params.elements, job)
                splatted = self.splatted(surfaces, shapes, points, eye - mesh.origin)
                layer = dataclasses.replace(
                    layer,
                    terms=layer.terms + splatted.terms,
                    irradiance=layer.irradiance + splatted.irradiance,
                )
            layers[lighting.environment.id] = layer
        valid = np.zeros(len(mesh), np.bool_)
        valid[points] = True
        return Radiance(surfaces, hits, layers, valid, 1 << SUNS, True, counts)

    def follow(
        self, surfaces: Surfaces, casters: Casters, lighting: Lighting, count: int, job: Job
    ) -> dict[str, int]:
        """Elements and what they see of the sky, up to date; counts."""
        if self._whole is None or self._count != count:
            self._whole, self._count = Whole(self._workers, count), count
        assert lighting.environment is not None
        even = dataclasses.replace(lighting.environment, intensity=1.0, tint=(1.0, 1.0, 1.0), temperature=0.0)
        open_sky = dataclasses.replace(lighting, lamps=(), sun=None)
        everything = np.ones(len(surfaces.mesh), np.bool_)
        counts = self._whole.update(surfaces, casters, open_sky, {even.id: even}, everything, job)
        few = self._few.update(surfaces, casters, everything, job)
        self._inside = (self._few.share_back > BURIED)[self._few.row_of]
        return {"elements": len(self._whole.elements), "rays": counts.rays + few.rays}

    def splatted(self, surfaces: Surfaces, shapes: Shapes, points: I64, eye: F64) -> LayerRadiance:
        """What the environment's light comes to at vertices, of all terms."""
        whole, mesh = self._whole, surfaces.mesh
        assert whole is not None
        rows = shapes.rows(mesh).astype(np.int64)
        splats = Splats.of(mesh, whole.elements, points, rows, self._inside)
        known = self._appearance.rows(shapes)
        own = np.where((rows >= 0)[:, None, None], known[np.maximum(rows, 0)], 0)[whole.elements.vertex]
        to_eye, light = views(mesh, points, eye), self._light
        light.update(whole, own, splats.used)
        values = np.zeros((len(splats.vertex), 1 + own.shape[1], 3), np.float32)
        todo = blocks(splats.used, CHUNK)

        def body(first: int, last: int) -> None:
            for start, stop in todo[first:last]:
                _give(light, whole.frames, own[start:stop], splats, to_eye, start, stop, values)

        self._workers.run(len(todo), 4, body)
        sums = splats.sums(values)
        layer = blank_layer(mesh, shapes)
        layer.irradiance[points] = np.pi * sums[:, 0]
        layer.terms[points] = sums[:, 1:]
        return layer


def _give(
    light: Preconvolved,
    frames: F32,
    own: F64,
    splats: Splats,
    to_eye: F32,
    start: int,
    stop: int,
    values: F32,
) -> None:
    """Values of the pairs of elements start … stop − 1: first matte light, then what each term sends."""
    pairs = slice(splats.start[start], splats.start[stop])
    element = np.repeat(np.arange(stop - start), np.diff(splats.start[start : stop + 1]))
    matte = light.matte[start:stop][element]
    values[pairs, 0] = matte
    out = np.zeros((len(element), 3), np.float32)
    for term in range(own.shape[1]):
        values[pairs, 1 + term] = matte * own[element, term, :1]
        if own[:, term, 1].any():
            sent = light.sent(term, start, stop)
            look_up(sent, frames[start:stop], element, splats.vertex[pairs], to_eye, out)
            values[pairs, 1 + term] += (own[element, term, 1:2] * out).astype(np.float32)


class Slf:
    """See the module; satisfies `studio_core.contract.ShadingBackend`."""

    id = "slf"
    label = "Elements (strokes' own view)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """Fresh stages, the last gives Radiance."""
        return [*common_stages(services), ElementStage(services)]


BACKEND = Slf()
