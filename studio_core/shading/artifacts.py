"""What stages hand to each other, keyed by type. Treat everything here as read-only.

V shading vertices, F faces, M materials, S directions, N picture samples.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry, Table
from studio_core.scene.nodes import Environment, Light, MaterialId, NodeId
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.measured_error import Error, MeasuredError

if TYPE_CHECKING:
    from studio_core.kernels.light_tree import LightTree
    from studio_core.kernels.raycast import RayCaster
    from studio_core.kernels.suns import Sun
    from studio_core.scene.face_tree import FaceTree
    from studio_core.scene.world_mesh import WorldMesh
    from studio_core.shading.coefficients import Maps
    from studio_core.shading.job import Job
    from studio_core.shading.reliefs import Reliefs
    from studio_core.transport.exchange import Exchange

Source: TypeAlias = tuple[NodeId, Geometry, tuple[MaterialId, ...]]
"""An object, its mesh, the material of each slot."""
TERMS = 6
"""Most terms a BRDF may have. Light sums have as many as the scene's materials need."""

F32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ChosenPoints:
    """Points that light is summed at: what a `WorldMesh` says of its vertices, for points of our own.

    Positions (P, 3) are relative to `origin`; normals and geometric (P, 3) unit; tangents (P, 4);
    inset (P, 3) moves the start of rays; material (P,) counts in `Surfaces.materials`.
    """

    origin: npt.NDArray[np.float64]
    positions: F32
    normals: F32
    tangents: F32
    geometric: F32
    inset: F32
    material: npt.NDArray[np.int32]


@dataclass(frozen=True)
class Surfaces:
    """What is lit: the shading meshes of all shown objects in the world, made from `sources`.

    `mesh.material` indexes `materials`; `opacity` is per material, and so is whether it `catches` shadows;
    `budget` is how many vertices were asked for. Where light needed it, objects of `mesh` are refined: their
    vertices and those of `base`, the same without refinement, begin alike, and `tree` leads from faces of
    `base.mesh` to those of `mesh`.
    """

    sources: tuple[Source, ...]
    materials: tuple[MaterialId, ...]
    mesh: WorldMesh
    opacity: F32
    catches: npt.NDArray[np.bool_]
    budget: int
    base: Surfaces | None = None
    tree: FaceTree | None = None

    @property
    def unrefined(self) -> Surfaces:
        """What was refined; itself where nothing was."""
        return self.base or self

    @property
    def nodes(self) -> tuple[NodeId, ...]:
        """The objects, in the order of `mesh.objects`."""
        return tuple(node for node, _, _ in self.sources)


ShadingPoints: TypeAlias = Union["WorldMesh", ChosenPoints]


@dataclass(frozen=True)
class Casters:
    """Ray casters over the same objects: `shadow` knows what stops light, `primary` what is seen.

    Moved objects move in place, so only the newest `Casters` may be used; it is owned by the compute thread.
    `primary` faces are those of the unrefined shading meshes. `meshes` tells whether the same meshes are
    meant.
    """

    shadow: RayCaster
    primary: RayCaster
    meshes: tuple[object, ...]
    transforms: tuple[Transform, ...]


@dataclass(frozen=True)
class Shapes:
    """BRDF kernels by row: address, number of terms, and where the shape starts in `data`.

    Row m is that of material m as a whole. Where a picture changes the shape over a surface, further rows
    follow, and `row` (V,) names that of each vertex; `owner` (R,) is the material of each row. `tables` are
    those that shapes name, kept alive. `tilt` (R,) is the slope of normals at which light is looked at for a
    normal map, 0 for rows without one; None where no material has one.
    """

    address: npt.NDArray[np.int64]
    terms: npt.NDArray[np.int64]
    offset: npt.NDArray[np.int64]
    data: F32
    problems: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    owner: npt.NDArray[np.int64] | None = None
    row: npt.NDArray[np.int32] | None = None
    tilt: F32 | None = None

    def rows(self, points: ShadingPoints) -> npt.NDArray[np.int32]:
        """(V,) the row of each of the points that this was made for; -1: no material."""
        return points.material if self.row is None else self.row

    def of_points(self, some: npt.NDArray[np.int64]) -> Shapes:
        """For some of the points alone."""
        return self if self.row is None else dataclasses.replace(self, row=self.row[some])

    def of_rows(self, by_material: F32) -> F32:
        """What is known of M materials, and last of none (M + 1, …), for each row, and none, (R + 1, …)."""
        if self.owner is None:
            return by_material
        return np.asarray(by_material[np.append(self.owner, len(by_material) - 1)])

    @property
    def width(self) -> int:
        """Most terms of one material: T of light sums (V, T, 3)."""
        return int(self.terms.max(initial=1))


@dataclass(frozen=True)
class Lamp:
    """A lamp in the world at unit gain. `axis` is where it shines, `across` and `up` span an area lamp."""

    node: NodeId
    kind: str  # point, spot, directional, area
    position: npt.NDArray[np.float64]
    axis: npt.NDArray[np.float64]
    across: npt.NDArray[np.float64]
    up: npt.NDArray[np.float64]
    cos_cone: float = -1.0
    cos_inner: float = -1.0
    angle: float = 0.0


@dataclass(frozen=True)
class Lighting:
    """All lights at unit gain: one layer of radiance each.

    `tree` holds the environment without its suns, over the leaves of a direction set, mostly the finest (at
    least 2^15: take the smaller of the level wanted and `tree.k`); None without an environment. `sun` holds
    what is too bright and too small for leaves, or is None; both together are the environment's layer.
    `integrated` tells of which picture, rotation and fineness both are: equal where these are the same.
    `coarse` says that they are good for the time while a hand turns the light.
    """

    environment: Environment | None
    tree: LightTree | None
    lamps: tuple[Lamp, ...]
    integrated: tuple[object, ...] = ()
    sun: Sun | None = None
    coarse: bool = False

    @property
    def layers(self) -> tuple[NodeId, ...]:
        """Ids of the lights, the environment first."""
        first = (self.environment.id,) if self.environment is not None else ()
        return (*first, *(lamp.node for lamp in self.lamps))


@dataclass(frozen=True)
class Hits:
    """What each picture sample sees first. Row-major over pixels, then over the n×n samples of a pixel.

    `face` is an index into `mesh.faces` or -1 (nothing); barycentrics (u, v) weigh the second and third
    corner. `behind` holds what transparent surfaces in front leave to be seen: further layers, each with
    the sample's index. `edges` are further hits of the pixels in which something ends, and stand in their
    place in the picture. `traced` counts the rays that were needed.
    """

    view: View
    samples: int
    face: npt.NDArray[np.int32]
    u: F32
    v: F32
    distance: F32
    behind: tuple[tuple[npt.NDArray[np.int64], Hits], ...] = ()
    traced: int = 0
    edges: EdgeHits | None = None


@dataclass(frozen=True)
class EdgeHits:
    """Hits of some pixels (E,), rising, one after another as a picture with more samples has them."""

    pixels: npt.NDArray[np.int64]
    hits: Hits

    def of_picture(self, own: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Which samples of the picture some of the hits' own are."""
        count = self.hits.samples**2
        return np.asarray(self.pixels[own // count] * count + own % count)


@dataclass(frozen=True)
class LayerRadiance:
    """One light's contribution at unit gain: terms (V, T, 3), irradiance (V, 3).

    T is the same for all layers, and at least what the scene's materials have. Where materials have normal
    maps, tilts (V, 3, T, 3) tell how terms change with the normal: at one of components (x, y, z) in the
    vertex' frame they are terms + x · tilts[0] + y · tilts[1] + (1 − z) · tilts[2], about.
    """

    terms: F32
    irradiance: F32
    tilts: F32 | None = None

    def of_width(self, width: int) -> LayerRadiance:
        """The same with `width` terms: zeros behind its own, or without the last ones."""
        count, own = self.terms.shape[:2]
        if own == width:
            return self
        terms = np.zeros((count, width, 3), np.float32)
        terms[:, :own] = self.terms[:, :width]
        tilts = None
        if self.tilts is not None:
            tilts = np.zeros((count, self.tilts.shape[1], width, 3), np.float32)
            tilts[:, :, :own] = self.tilts[:, :, :width]
        return LayerRadiance(terms, self.irradiance, tilts)


class PixelLight(Protocol):
    """Light that is summed at every hit of the picture instead of between vertices."""

    @property
    def nodes(self) -> frozenset[NodeId]:
        """Whose."""
        ...

    def colours(
        self, node: NodeId, hits: Hits, looks: Callable[[Hits], F32], key: object, job: Job | None = None
    ) -> F32:
        """(N, 3) of one of the lights at unit gain, Σ_k c_k b_k L V cosθ, of any sign; 0 without a hit.

        `looks` gives the coefficients (M, T, 3) of some of the hits; where `key` is the same, so are they.
        """
        ...


@dataclass(frozen=True)
class Radiance:
    """Radiance per shading vertex, by light layer and BRDF term, towards `view`.

    B(x, ω_o) = Σ_layers gain · Σ_k c_k · terms[k]. `valid` marks the vertices that were computed.
    `directions` says how finely, `final` whether it is as fine as asked for. In a picture `pixel` stands in
    the place of its own lights' layers. `indirect` is light that came by way of other surfaces, from all
    lights together with their gains, and `facts` tell of its method.
    """

    surfaces: Surfaces
    hits: Hits | None
    layers: Mapping[NodeId, LayerRadiance]
    valid: npt.NDArray[np.bool_]
    directions: int
    final: bool
    counts: Mapping[str, int] = field(default_factory=dict)
    pixel: PixelLight | None = None
    indirect: LayerRadiance | None = None
    facts: Mapping[str, float] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """T of the layers' terms (V, T, 3)."""
        own = () if self.indirect is None else (self.indirect,)
        return next((layer.terms.shape[1] for layer in (*self.layers.values(), *own)), 1)

    def combined(self, lights: Mapping[NodeId, Light]) -> F32:
        """(V, T, 3): the layers weighted with the gains of `lights`; layers without a light are off."""
        made = np.zeros((len(self.valid), self.width, 3), np.float32)
        if self.indirect is not None:
            made += self.indirect.terms
        for node, layer in self.layers.items():
            if node in lights:
                made += layer.terms * np.asarray(lights[node].gain(), np.float32)
        return made

    def irradiance(self, lights: Mapping[NodeId, Light]) -> F32:
        """(V, 3): the same for irradiance."""
        made = np.zeros((len(self.valid), 3), np.float32)
        if self.indirect is not None:
            made += self.indirect.irradiance
        for node, layer in self.layers.items():
            if node in lights:
                made += layer.irradiance * np.asarray(lights[node].gain(), np.float32)
        return made


@dataclass(frozen=True)
class DirectRadiance(Radiance):
    """What a backend made of light that comes straight from lamps and environment."""


@dataclass(frozen=True, eq=False)
class Receivers:
    """Which vertices (V,) of the unrefined meshes the picture needs, and `eye` (3,) in the world."""

    seen: npt.NDArray[np.bool_]
    eye: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Indirect:
    """Light that came by way of other surfaces, at vertices of the unrefined meshes of `surfaces`.

    `layer` has the gains of all lights in it; it holds where `valid`. `final` tells whether it is as exact as
    asked for. `counts` tells of the work, `facts` of the method, in the words of the field: numbers alone.
    `sent` is what all vertices send, and what it was made from, where the method knows.
    """

    surfaces: Surfaces
    layer: LayerRadiance
    valid: npt.NDArray[np.bool_]
    final: bool
    counts: Mapping[str, int] = field(default_factory=dict)
    facts: Mapping[str, float] = field(default_factory=dict)
    sent: Exchange | None = None


@dataclass(frozen=True)
class Ground:
    """Where a picture lies on the ground: a disc and a dome over it, both about `centre` (x, y, z), world.

    It was taken `height` above the centre; the disc reaches as far as `radius`, where the dome begins.
    """

    centre: tuple[float, float, float]
    height: float
    radius: float


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What is seen beside objects: an equirectangular picture (H, W, 3), times `gain` (3,).

    `turn` (3, 3) leads from the world to the picture's own frame. Without a `ground` it is far away.
    """

    pixels: F32
    turn: F32
    gain: F32
    ground: Ground | None = None


@dataclass(frozen=True, eq=False)
class VertexColours:
    """What a picture interpolates, for canvases that do so themselves.

    record (V, 8), sums (V or 0, T·3) and maps as in `kernels.compose.shade_hits`; they hold where
    `Radiance.valid`. What catches shadows is black there, and has in record[:, 3:6] what the backdrop without
    gain is multiplied with. `shown` (V,) are the corners of what the picture shows; others may be turned away
    from its eye, and black. `backdrop` is None where none is seen.
    With normal maps `reliefs` and bend (V, 18) are as in `kernels.relief.add_relief`; else both are None.
    """

    record: F32
    sums: F32
    shown: npt.NDArray[np.bool_]
    maps: Maps
    backdrop: Backdrop | None
    bend: F32 | None = None
    reliefs: Reliefs | None = None


@dataclass(frozen=True)
class Picture:
    """What the camera sees: scene-linear (H, W, 3), coverage (H, W), node index (H, W) with -1 for nothing.

    `distance` (H, W) is metres along the ray of a pixel's first sample, inf where it meets nothing.
    `colours` are what the pixels were made from. With a `share` (H, W), that of light which came by way of
    other surfaces (NaN where nothing is seen), `linear` has false colours of it.
    """

    radiance: Radiance
    linear: F32
    coverage: F32
    node: npt.NDArray[np.int32]
    distance: F32
    colours: VertexColours | None = None
    share: F32 | None = None

    def shown_with(self, exposure: float, tonemap: str) -> tuple[float, str]:
        """Exposure and view transform that it is shown with; false colours have their own."""
        return (exposure, tonemap) if self.share is None else (0.0, "srgb")

    @property
    def nodes(self) -> tuple[NodeId, ...]:
        """What `node` indexes."""
        return self.radiance.surfaces.nodes


__all__ = [
    "TERMS",
    "Backdrop",
    "Casters",
    "ChosenPoints",
    "DirectRadiance",
    "EdgeHits",
    "Error",
    "Ground",
    "Hits",
    "Indirect",
    "Lamp",
    "LayerRadiance",
    "Lighting",
    "MeasuredError",
    "Picture",
    "PixelLight",
    "Radiance",
    "Receivers",
    "ShadingPoints",
    "Shapes",
    "Source",
    "Surfaces",
    "VertexColours",
]
