"""What plugins provide: the protocols of every kind, in one place.

A plugin is a cheap `Plugin` value found through the entry-point group `studio.plugins`; the objects it
names by `module:attribute` are imported on first use and must satisfy the protocol of their kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.params import Value
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material, MeshObject, Node, NodeId, Scene

if TYPE_CHECKING:
    from studio_core.capturing.artifacts import CaptureState
    from studio_core.capturing.settings import CaptureSettings
    from studio_core.fitting import FitRequest, Fitted
    from studio_core.imaging.photograph import Photograph
    from studio_core.shading.cache import DiskCache
    from studio_core.shading.job import Job
    from studio_core.shading.pipeline import Stage
    from studio_core.strokes.solution import Lit, Solution

API = 1
KINDS = (
    "backend",
    "indirect",
    "solver",
    "brdf",
    "importer",
    "exporter",
    "capturer",
    "fitter",
    "stroke_tool",
    "tonemap",
    "panel",
)


@dataclass(frozen=True)
class Plugin:
    """What an entry point resolves to: `provides[kind][name] = "module:attribute"`."""

    id: str
    api: int
    provides: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    label: str = ""


class Brdf(Protocol):
    """A reflectance model as a sum of coloured terms: f_r(ω_i, ω_o) = Σ_k c_k · b_k(ω_i, ω_o).

    The scalar kernels b_k depend on the *shape* (roughness, exponent) and are summed over light per vertex;
    the RGB coefficients c_k (base colour, F0) are applied per pixel afterwards. So a change of colour
    costs no light sum, and textures act at full resolution.

    `address` is that of a C function, batched over the directions of one shading point:

        void eval(const float* shape, const float* wo, int64 count, const float* wi, float* out)

    in the shading frame (z = normal, x along the texture coordinates' u, see `studio_core.scene.tangents`):
    wo is (x, y, z); wi is x[count], y[count], z[count]; out is term 0 [count], term 1 [count], … without the
    cosine. Directions with z ≤ 0 give 0. Finite always.

    `textures` are parameters of the coefficients that may have a picture, or names of maps that have no
    parameter: such a name is among `values` only where the material has that picture. A model may also have
    `shape_textures: tuple[str, ...]`, numbers of the shape that may: every vertex then has a shape of its
    own. Coefficients must not depend on these unless they are among `textures` too. A model whose shape takes
    long to make may have `shapes(rows) -> (K, n)`, of many values of a material at a time. Where maps are
    made of directions, `turning: str` names the parameter, in degrees, to which the pictures' rotation is
    added.
    `straightened: tuple[int, ...]` names terms of little weight whose coefficients, where one picture acts,
    may be replaced by the line nearest to them over its texels.
    """

    id: str
    label: str
    Params: type
    terms: int
    textures: tuple[str, ...]

    @property
    def address(self) -> int:
        """Address of the kernel above."""
        ...

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(n,) what the kernel reads; equal shapes need no new light sums."""
        ...

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., terms, 3) from parameters of shape (...) or (..., 3), one entry a texel."""
        ...


class SampledBrdf(Brdf, Protocol):
    """A model that also draws directions, one term at a time; all bundled models do, plugins may.

    `sampler` and `density` are addresses of C functions, batched over the directions of one shading point
    like `Brdf.address` (their signatures: `studio_core.kernels.brdf`):

        void sample(const float* shape, const float* wo, int64 term, int64 count, const float* u, float* wi)
        void density(const float* shape, const float* wo, int64 count, const float* wi, float* out)

    u is u0[count], u1[count] in [0, 1), wi becomes x[count], y[count], z[count]: unit directions about
    proportional to term × cosine, or any vector with z ≤ 0 where there is none. `out` is the density per
    steradian with which each term draws wi: term 0 [count], term 1 [count], …, and 0 for z ≤ 0; it
    integrates to the share of u that gives a direction. Wherever term × cosine is not 0 the density is
    not, and their ratio is bounded. Finite always.
    """

    @property
    def sampler(self) -> int:
        """Address of `sample`."""
        ...

    @property
    def density(self) -> int:
        """Address of `density`."""
        ...


class TabulatedBrdf(Brdf, Protocol):
    """A reflectance model that reads measured tables of its material.

    `shape` alone is that of a plain stand-in, for whoever has no material. Where a table is missing or does
    not fit, the material is shown as matte grey and the reason is said. With `terms_of(tables)`, which raises
    as `shape_of`, the number of terms depends on the tables; coefficients may be fewer or more than these.
    """

    tables: tuple[str, ...]

    def shape_of(self, values: Mapping[str, Value], tables: Mapping[str, Table]) -> npt.NDArray[np.float32]:
        """(n,) as `shape`, naming each table by `studio_core.kernels.tables.reference`.

        Raises InputError, one sentence, when a table does not fit. Asked at every edit: it must be quick.
        """
        ...


class PaintableBrdf(Brdf, Protocol):
    """A model whose parameters have parts to play in what a stroke means; models need not be.

    `roles` names its parameters by "diffuse" (the colour of what is matte), "specular" (a colour or a number:
    how much of the arriving light shines) and "gloss" (a number of the shape), as far as it has such. What
    strokes change of the gloss, every vertex has of its own.
    """

    roles: Mapping[str, str]

    def alpha(self, gloss: float) -> float:
        """The roughness α of Ward's model at which highlights are about as wide, of models with a gloss.

        Monotone; steps that are even in α look even.
        """
        ...

    def gloss(self, alpha: float) -> float:
        """The inverse of `alpha`; maybe beyond what the parameter allows."""
        ...


@dataclass(frozen=True)
class ImportedModel:
    """Nodes and materials ready to be added, and in sentences what was repaired or left out."""

    nodes: tuple[Node, ...]
    materials: tuple[Material, ...]
    notes: tuple[str, ...] = ()

    @property
    def objects(self) -> tuple[MeshObject, ...]:
        """The mesh objects among the nodes."""
        return tuple(node for node in self.nodes if isinstance(node, MeshObject))


class Importer(Protocol):
    """Reads models. `extensions` are lower case with the dot."""

    label: str
    extensions: tuple[str, ...]

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """Metres from file units by `unit`; raises InputError in one sentence naming file and cause."""
        ...


class Exporter(Protocol):
    """Writes a scene. `extensions` may be empty for exporters that write a folder."""

    label: str
    extensions: tuple[str, ...]

    def save(self, scene: Scene, path: Path, registry: Registry) -> tuple[str, ...]:
        """Write, and say in sentences what could not be expressed."""
        ...


class PanelMaker(Protocol):
    """A panel of a third-party plugin: the only place where a plugin may use Qt.

    It is asked for when its panel is first shown. The context is `studio_ui.context.Context`: document,
    session, `editing` (the way to change the document), journal, feed.
    """

    title: str

    def make(self, context: Any) -> Any:
        """A QWidget."""
        ...


class Registry(Protocol):
    """How plugins reach what others provide, without importing them."""

    def get(self, kind: str, name: str) -> Any:
        """The provided object; PluginError when it is unknown or fails to load."""
        ...

    def names(self, kind: str) -> Sequence[str]:
        """Everything registered of a kind, bundled first."""
        ...

    def brdf(self, model: str) -> Brdf:
        """The BRDF of that name, checked once."""
        ...


class ShadingBackend(Protocol):
    """Stages that end in `Radiance`; `Params` is a dataclass made with `param`."""

    id: str
    label: str
    Params: type

    def stages(self, services: Services) -> Sequence[Stage]:
        """Fresh stages, in order; the last gives Radiance."""
        ...


class IndirectMethod(Protocol):
    """A way to compute light that goes on between surfaces, over any backend."""

    id: str
    label: str
    Params: type

    def stages(self, services: Services) -> Sequence[Stage]:
        """Fresh stages, in order; the last gives `Indirect`, with `frame.indirect.params` for parameters.

        They may need Surfaces, Casters, Shapes, Lighting, Receivers and DirectRadiance. Surfaces and Shapes
        are those of the unrefined meshes; DirectRadiance has surfaces of its own, refined or not.
        """
        ...


class Capturer(Protocol):
    """Makes light out of photographs of a room."""

    label: str

    def open(self, services: Services) -> CaptureRun:
        """A run that remembers what its stages made, for one capture."""
        ...


class CaptureRun(Protocol):
    """Stages in their order; those whose photographs and settings are as before are not run again."""

    def run(
        self, photographs: Sequence[Photograph], settings: CaptureSettings, job: Job, until: str = ""
    ) -> CaptureState:
        """The state after the step `until` (a field of CaptureSettings; "" for all).

        Publishes the state after every stage. Raises InputError in one sentence where the photographs give
        no result, and Cancelled; what was made until then is remembered.
        """
        ...


class Fitter(Protocol):
    """Makes materials out of photographs of a sample under known lamps."""

    label: str

    def fit(self, request: FitRequest, job: Job) -> Fitted:
        """Read, fit and measure; for a thread of its own, it takes minutes.

        Raises InputError in one sentence where the photographs give no material, and Cancelled.
        """
        ...


class StrokeSolver(Protocol):
    """Finds the materials that explain painted light: kind `solver`."""

    id: str
    label: str
    Params: type

    def open(self, services: Services) -> StrokeRun:
        """A run that remembers what surfaces see of each other; owned by the compute thread."""
        ...


class StrokeRun(Protocol):
    """One scene's solver, over many edits."""

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        """The edit that explains the strokes (nodes of the scene; hidden ones are left out) together.

        Strokes that say nothing (on the background, in full shadow, on what has no material that can
        change) are left out with a note. Raises Cancelled, and nothing else for strange strokes.
        """
        ...

    def shown(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, job: Job) -> Mapping[NodeId, Any]:
        """By stroke that is no fixate the light (N, 3) at its marks, as materials and paint are now; NaN at
        those that are not on what is shown. What was lacking when they were painted is added (`Marks`).
        """
        ...

    def stylise(self, scene: Scene, amount: float, lit: Lit, job: Job) -> Solution:
        """Paint on all objects under which the light of the scene is sharpened (figure 22) by an amount."""
        ...

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, params: Any, job: Job) -> Any:
        """(V,) float32, 0 … 1: how much each vertex of `lit.surfaces.unrefined` would change with it."""
        ...


@dataclass(frozen=True)
class Services:
    """What the composition root hands to backends: threads, registry, cache folder."""

    workers: Any
    registry: Registry
    cache: DiskCache | None = None


__all__ = [
    "API",
    "KINDS",
    "Brdf",
    "CaptureRun",
    "Capturer",
    "Exporter",
    "Fitter",
    "ImportedModel",
    "Importer",
    "IndirectMethod",
    "Job",
    "PaintableBrdf",
    "PanelMaker",
    "Plugin",
    "Registry",
    "SampledBrdf",
    "Services",
    "ShadingBackend",
    "StrokeRun",
    "StrokeSolver",
    "TabulatedBrdf",
]
