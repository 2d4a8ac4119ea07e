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

from studio_core.jit import kernel
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.shading_mesh import ShadingMesh
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


class Place(NamedTuple):
    """Objects and their meshes, which number the vertices, and the method's parameters."""

    parts: tuple[tuple[NodeId, ShadingMesh], ...]
    params: Any

    def same(self, other: Place) -> bool:
        """Whether vertices have the same numbers, and light is gathered with the same parameters."""
        pairs = zip(self.parts, other.parts, strict=False)
        return (
            self.params == other.params
            and len(self.parts) == len(other.parts)
            and all(node == its and mesh is another for (node, mesh), (its, another) in pairs)
        )


class Setting(NamedTuple):
    """What light is gathered in: a scene, its vertices and their BRDFs, whom the picture sees (V,), and the
    method's parameters.
    """

    scene: Scene
    mesh: WorldMesh
    shapes: Shapes
    seen: Bools
    params: Any

    @property
    def place(self) -> Place:
        """Where what is found belongs to."""
        return Place(tuple((placed.node, placed.mesh) for placed in self.mesh.objects), self.params)

    @property
    def place_of(self) -> I32:
        """(V,) where a vertex stands among those seen, or −1."""
        made = np.full(len(self.seen), -1, np.int32)
        made[self.seen] = np.arange(np.count_nonzero(self.seen), dtype=np.int32)
        return made

    @property
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
    """What the first tier made of a scene at receivers (C,), and the light along their rays, packed."""

    scene: Scene
    place: Place
    vertices: I64
    layer: Layer
    along: tuple[U8, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """Ratios q of receivers; place_of (V,) is where a vertex stands among them, or −1.

    Of each (C,) the address of its BRDF, and the first tier's irradiance, colours summed.
    """

    place: Place
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
        begun, found = self._begun, self._found
        kept: list[npt.NDArray[Any]] = []
        if begun is not None:
            kept += [begun.vertices, *begun.layer, *begun.along]
        if found is not None:
            kept += [found.place_of, found.models, found.irradiance, *found.ratio, *found.along]
        return sum({id(array): array.nbytes for array in kept}.values())

    def hears(self, setting: Setting, rays: tuple[int, ...], moving: bool) -> tuple[Likeness, ...]:
        """Who is to be told, by a first tier, of the light along so many rays of each kind; none: nobody.

        What belongs to another place is forgotten.
        """
        if self._found is not None and not self._found.place.same(setting.place):
            self._found = None
        found = self._found
        if found is None and moving:
            return ()
        keep_at = None if moving else setting.place_of
        then_at = None if found is None else found.place_of
        then: list[U8 | None] = [*(() if found is None else found.along), *(None for _ in rays)]
        return tuple(
            Likeness(count, one, then_at, keep_at, len(setting.seen))
            for count, one in zip(rays, then, strict=False)
        )

    def over(self, setting: Setting, layers: list[Layer], heard: tuple[Likeness, ...], moving: bool) -> None:
        """To a first tier's layers, in place: the upright one first, then those that lean each way.

        At rest what is there without it is kept, to be compared with what is finer. `heard` is of the rays
        by the cosine and, where there are any, of those by lobes.
        """
        vertices, found = np.flatnonzero(setting.seen), self._found
        level = layers[0].irradiance[vertices].sum(axis=1)
        if not moving:
            along = tuple(one.packed for one in heard)
            self._begun = Begun(setting.scene, setting.place, vertices, layers[0].at(vertices), along)
        if found is None:
            return
        place = found.place_of[vertices]
        there = place >= 0
        vertices, place, level = vertices[there], place[there], level[there]
        alike = _alike(level, found.irradiance[place])
        own, by_lobes = heard[0].of[vertices], heard[-1].of[vertices]
        by_lobes = np.where(by_lobes < 0, own, by_lobes)
        by_lobes[setting.models[vertices] != found.models[place]] = 0
        own, by_lobes = _share(own, alike), _share(by_lobes, alike)
        as_wide = layers[0].terms.shape[1] == found.ratio.terms.shape[1]
        for layer in layers:
            multiply(vertices, place, own, found.ratio.irradiance[:, None], layer.irradiance[:, None])
            if as_wide:
                multiply(vertices, place, by_lobes, found.ratio.terms, layer.terms)

    def settle(self, setting: Setting, layer: Layer, last: bool) -> None:
        """A finer layer of what was begun: from now on this is carried."""
        begun = self._begun
        if begun is None or begun.scene is not setting.scene or not begun.place.same(setting.place):
            return
        vertices = begun.vertices
        ratio = Layer(*map(_ratio, layer.at(vertices), begun.layer))
        for sums in ratio:
            sums[~setting.seen[vertices]] = 1  # seen no longer: nothing finer was made
        place_of = np.full(len(setting.seen), -1, np.int32)
        place_of[vertices] = np.arange(len(vertices), dtype=np.int32)
        level = begun.layer.irradiance.sum(axis=1)
        models = setting.models[vertices]
        self._found = Found(begun.place, place_of, models, level, ratio, begun.along)
        if last:
            self._begun = None


def _alike(one: F32, other: F32) -> F32:
    """The smaller of each two, neither negative, by the larger; 0 where both are 0."""
    made, larger = np.zeros_like(one), np.maximum(one, other)
    np.divide(np.minimum(one, other), larger, out=made, where=larger > 0)
    return made


def _share(likeness: F32, alike: F32) -> F32:
    """w of ρ and s."""
    square = np.maximum(likeness, 0) ** 2
    made = square * alike
    rest = alike + (1 - square) * (1 - alike)
    np.divide(made, rest, out=made, where=rest > 0)
    return made


@kernel
def multiply(vertices: I64, place: I32, share: F32, ratio: F32, sums: F32) -> None:
    """sums (V, T, 3) of vertices (C,) times 1 + share (ratio[place] − 1), of ratio (B, T, 3)."""
    for i in range(len(vertices)):
        if share[i] > 0:
            for t in range(sums.shape[1]):
                for c in range(3):
                    sums[vertices[i], t, c] *= np.float32(1) + share[i] * (
                        ratio[place[i], t, c] - np.float32(1)
                    )


def _ratio(fine: F32, rough: F32) -> F32:
    """fine / rough, LEAST to MOST; 1 where the first tier found nothing."""
    made = np.ones_like(fine)
    with np.errstate(over="ignore"):
        np.divide(fine, rough, out=made, where=rough != 0)
    return np.clip(made, LEAST, MOST).astype(np.float32)
