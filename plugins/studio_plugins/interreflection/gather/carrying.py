"""What rest has found, carried into the hand.

The first tier is several times as wrong as the last, and everything begins with it again whatever is touched.
But its errors are those of the same few rays as before. So for every receiver it is kept how much the finest
layer R differs from what the first tier made of the same scene, H, as q = R / H, and the next first tier is

    H' · (1 + w (q − 1)),    w = ρ² s / (s + (1 − ρ²) (1 − s)),

ρ being how alike the light along its rays is now and then (`likeness`), s how alike irradiance, min(E'/E,
E/E'). A dimmed lamp, or a thing that is moved at the other end of the room, leaves ρ = 1 and so w = 1.
Another lamp or another sky makes ρ small; where they bring light to what was dark, q belonged to the little
that had been there, and s makes w smaller still. Tiers between the first and the last are carried to in the
same way, each with a q of its own and the first one's w: else a picture that is let go of would become worse
before it becomes better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes
from studio_plugins.interreflection.gather.likeness import Likeness
from studio_plugins.interreflection.gather.ratios import alike, multiply, ratio_of, share_of

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]


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
    """What tiers, by level, made of a scene at receivers (C,), and the light along their rays, packed."""

    scene: Scene
    place: Place
    vertices: I64
    layers: dict[int, Layer]
    along: tuple[U8, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """Ratios q of receivers, by level; place_of (V,) is where a vertex stands among them, or −1.

    Of each (C,) the address of its BRDF, and the first tier's irradiance, colours summed.
    """

    place: Place
    place_of: I32
    models: I64
    irradiance: F32
    ratios: dict[int, Layer]
    along: tuple[U8, ...]

    @property
    def arrays(self) -> list[npt.NDArray[Any]]:
        """All that is kept."""
        ratios = [array for ratio in self.ratios.values() for array in ratio]
        return [self.place_of, self.models, self.irradiance, *ratios, *self.along]


@dataclass(frozen=True, eq=False)
class Shares:
    """How much w of what was found goes over to vertices (C,) of a scene, at `places` there.

    `own` (C,) is of irradiance, `terms` (C,) of terms.
    """

    found: Found
    scene: Scene
    vertices: I64
    places: I32
    own: F32
    terms: F32

    def over(self, layers: Sequence[Layer], level: int) -> None:
        """Multiplies layers of a tier, in place."""
        ratio = self.found.ratios.get(level)
        if ratio is None:
            return
        for layer in layers:
            own = (ratio.irradiance[:, None], layer.irradiance[:, None])
            multiply(self.vertices, self.places, self.own, *own)
            if layer.terms.shape[1] == ratio.terms.shape[1]:
                multiply(self.vertices, self.places, self.terms, ratio.terms, layer.terms)


class Carry:
    """Owned by the compute thread."""

    def __init__(self) -> None:
        self._begun: Begun | None = None
        self._found: Found | None = None
        self._shares: Shares | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        begun, shares = self._begun, self._shares
        kept: list[npt.NDArray[Any]] = []
        if begun is not None:
            sums = [array for layer in begun.layers.values() for array in layer]
            kept += [begun.vertices, *sums, *begun.along]
        if shares is not None:
            kept += [shares.vertices, shares.places, shares.own, shares.terms, *shares.found.arrays]
        if self._found is not None:
            kept += self._found.arrays
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

    def first(
        self, setting: Setting, layers: Sequence[Layer], heard: Sequence[Likeness], moving: bool
    ) -> None:
        """Carries over to a first tier's layers, in place: the upright one, then those that lean each way.

        At rest what is there without it is kept, to be compared with what is finer. `heard` is of the rays
        by the cosine and, where there are any, of those by lobes.
        """
        vertices = np.flatnonzero(setting.seen)
        if not moving:
            begun = {0: layers[0].at(vertices)}
            along = tuple(one.packed for one in heard)
            self._begun = Begun(setting.scene, setting.place, vertices, begun, along)
        self._shares = self._share(setting, layers[0].irradiance, heard)
        if self._shares is not None:
            self._shares.over(layers, 0)
        if moving:
            self._shares = None

    def finer(self, setting: Setting, layers: Sequence[Layer], level: int, last: bool) -> None:
        """The same for a finer tier at rest; what comes of it is what is carried from now on.

        So is the last tier as it is: nothing was kept of one.
        """
        begun, shares = self._begun, self._shares
        if begun is None or begun.scene is not setting.scene or not begun.place.same(setting.place):
            return
        vertices = begun.vertices
        begun.layers[level] = layers[0].at(vertices)
        if shares is not None and shares.scene is setting.scene and not last:
            shares.over(layers, level)
        finest = layers[0].at(vertices)
        ratios = {}
        for number, layer in begun.layers.items():
            if number < level:
                ratios[number] = Layer(*map(ratio_of, finest, layer))
                for sums in ratios[number]:
                    sums[~setting.seen[vertices]] = 1  # seen no longer: nothing finer was made
        place_of = np.full(len(setting.seen), -1, np.int32)
        place_of[vertices] = np.arange(len(vertices), dtype=np.int32)
        irradiance = begun.layers[0].irradiance.sum(axis=1)
        models = setting.models[vertices]
        self._found = Found(begun.place, place_of, models, irradiance, ratios, begun.along)
        if last:
            self._begun = self._shares = None

    def _share(self, setting: Setting, irradiance: F32, heard: Sequence[Likeness]) -> Shares | None:
        """None where nothing was found."""
        found = self._found
        if found is None:
            return None
        vertices = np.flatnonzero(setting.seen & (found.place_of >= 0))
        places = found.place_of[vertices]
        level = alike(irradiance[vertices].sum(axis=1), found.irradiance[places])
        own, by_lobes = heard[0].of[vertices], heard[-1].of[vertices]
        by_lobes = np.where(by_lobes < 0, own, by_lobes)
        by_lobes[setting.models[vertices] != found.models[places]] = 0
        shares = share_of(own, level), share_of(by_lobes, level)
        return Shares(found, setting.scene, vertices, places, *shares)
