"""What rest has found, carried into the hand.

The first tier is several times as wrong as the last, and everything begins with it again whatever is touched.
But its errors are those of the same few rays as before. So for every receiver it is kept how much the finest
layer R differs from what the first tier made of the same scene, H, as q = R / H, and the next first tier is

    H' · (1 + w (q − 1)),    w = ρ² s / (s + (1 − ρ²) (1 − s)),

ρ being how alike the light along its rays is now and then (`likeness`), s how alike irradiance, min(E'/E,
E/E'). A dimmed lamp, or a thing that is moved at the other end of the room, leaves ρ = 1 and so w = 1.
Another lamp or another sky makes ρ small; where they bring light to what was dark, q belonged to the little
that had been there, and s makes w smaller still.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes
from studio_plugins.interreflection.gather.likeness import Likeness

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]

LEAST, MOST = 0.1, 2.0
"""Of q."""


class Setting(NamedTuple):
    """What light is gathered in: a scene, its vertices and their BRDFs, whom the picture sees (V,), and the
    method's parameters.
    """

    scene: Scene
    mesh: WorldMesh
    shapes: Shapes
    seen: Bools
    params: Any

    def like(self, other: Setting) -> bool:
        """Whether vertices have the same numbers, and light is gathered with the same parameters."""
        parts, others = self.mesh.objects, other.mesh.objects
        return (
            self.params == other.params
            and len(parts) == len(others)
            and all(a.node == b.node and a.mesh is b.mesh for a, b in zip(parts, others, strict=True))
        )

    def models(self) -> I64:
        """(V,) addresses of the vertices' BRDFs; 0: none."""
        return np.append(self.shapes.address, 0)[self.shapes.rows(self.mesh)]


class Layer(NamedTuple):
    """Irradiance (V, 3), and terms (V, T, 3); flat ones may be 0."""

    irradiance: F32
    terms: F32

    def at(self, some: npt.NDArray[Any]) -> Layer:
        """Of some vertices."""
        return Layer(self.irradiance[some], self.terms[some])


@dataclass(frozen=True, eq=False)
class Begun:
    """What the first tier made of a setting at its receivers (C,), and the light along their rays."""

    setting: Setting
    vertices: I64
    place_of: I32
    layer: Layer
    along: tuple[U8, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """Ratios q of receivers; place_of (V,) is where a vertex stands among them, or −1.

    Of each (C,) the address of its BRDF, and the first tier's irradiance, colours summed.
    """

    setting: Setting
    place_of: I32
    models: I64
    irradiance: F32
    ratio: Layer
    along: tuple[U8, ...]


class Carry:
    """Owned by the compute thread."""

    def __init__(self) -> None:
        self._begun: Begun | None = None
        self._found: Found | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        kept: list[npt.NDArray[Any]] = []
        if self._begun is not None:
            kept += [self._begun.vertices, self._begun.place_of, *self._begun.layer, *self._begun.along]
        if self._found is not None:
            found = self._found
            kept += [found.models, found.irradiance, found.place_of, *found.ratio, *found.along]
        return sum({id(array): array.nbytes for array in kept}.values())

    def hears(self, setting: Setting, rays: tuple[int, ...], moving: bool) -> tuple[Likeness, ...]:
        """Who is to be told, by a first tier, of the light along so many rays of each kind; none: nobody.

        What belongs to another place is forgotten.
        """
        if self._found is not None and not self._found.setting.like(setting):
            self._found = None
        found, keep_at = self._found, None
        if not moving:
            keep_at = np.full(len(setting.seen), -1, np.int32)
            keep_at[setting.seen] = np.arange(np.count_nonzero(setting.seen), dtype=np.int32)
        if found is None and moving:
            return ()
        then = () if found is None else found.along
        then_at = None if found is None else found.place_of
        packed = [*then, *(None for _ in rays)][: len(rays)]
        return tuple(
            Likeness(count, one, then_at, keep_at, len(setting.seen))
            for count, one in zip(rays, packed, strict=True)
        )

    def begin(self, setting: Setting, layer: Layer, heard: tuple[Likeness, ...]) -> None:
        """At rest: what the first tier made, before anything was carried to it."""
        vertices = np.flatnonzero(setting.seen)
        place_of = np.full(len(setting.seen), -1, np.int32)
        place_of[vertices] = np.arange(len(vertices), dtype=np.int32)
        along = tuple(one.packed for one in heard)
        self._begun = Begun(setting, vertices, place_of, layer.at(vertices), along)

    def settle(self, setting: Setting, layer: Layer, last: bool) -> None:
        """A finer layer of what was begun: from now on this is carried."""
        begun = self._begun
        if begun is None or begun.setting.scene is not setting.scene or not begun.setting.like(setting):
            return
        finest = layer.at(begun.vertices)
        ratio = Layer(*(_ratio(fine, rough) for fine, rough in zip(finest, begun.layer, strict=True)))
        there = setting.seen[begun.vertices]
        ratio.irradiance[~there] = 1  # seen no longer: nothing finer was made
        ratio.terms[~there] = 1
        models = begun.setting.models()[begun.vertices]
        level = begun.layer.irradiance.sum(axis=1)
        self._found = Found(begun.setting, begun.place_of, models, level, ratio, begun.along)
        if last:
            self._begun = None

    def factors(
        self, setting: Setting, layer: Layer, heard: tuple[Likeness, ...]
    ) -> tuple[I64, Layer] | None:
        """Vertices (C,), and what to multiply their irradiance (C, 3) and terms (C, T, 3) with, all positive.

        `heard` is of the rays by the cosine and, where there are any, of those by lobes.
        """
        found = self._found
        if found is None or not heard:
            return None
        vertices = np.flatnonzero(setting.seen & (found.place_of >= 0))
        place = found.place_of[vertices]
        ratio, level = found.ratio.at(place), layer.irradiance[vertices].sum(axis=1)
        level = _alike(level, found.irradiance[place])
        own, by_lobes = (_share(one.of[vertices], level) for one in (heard[0], heard[-1]))
        irradiance = 1 + own[:, None] * (ratio.irradiance - 1)
        terms = np.ones((len(vertices), *layer.terms.shape[1:]), np.float32)
        if terms.shape == ratio.terms.shape:
            by_lobes[setting.models()[vertices] != found.models[place]] = 0
            terms += by_lobes[:, None, None] * (ratio.terms - 1)
        return vertices, Layer(irradiance, terms)


def _alike(one: F32, other: F32) -> F32:
    """The smaller of each two, neither negative, by the larger; 0 where both are 0."""
    made, larger = np.zeros_like(one), np.maximum(one, other)
    np.divide(np.minimum(one, other), larger, out=made, where=larger > 0)
    return made


def _share(likeness: F32, alike: F32) -> F32:
    """w of ρ and s."""
    square = likeness * likeness
    made = square * alike
    rest = alike + (1 - square) * (1 - alike)
    np.divide(made, rest, out=made, where=rest > 0)
    return made


def _ratio(fine: F32, rough: F32) -> F32:
    """fine / rough, LEAST to MOST; 1 where the first tier found nothing."""
    made = np.ones_like(fine)
    np.divide(fine, rough, out=made, where=rough != 0)
    return np.clip(made, LEAST, MOST).astype(np.float32)
