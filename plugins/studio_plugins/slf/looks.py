"""How surface looks apart from its light: what likeness and upsampling compare.

A look is the cube root of the coefficients of a vertex' material, pictures averaged over what it stands for,
and its roughness. Cube roots are about as uniform as lightness is (CIE L*: 0 black, 1 white; first terms are
matte and have 1 / π of it), and roughness α is so for gloss (Pellacini, Ferwerda & Greenberg 2000). What
strokes changed before is left out: it is the original look that tells which surface belongs together (section
6.5).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.materials import Resolved, resolve, scalar
from studio_core.shading.texels import picture_areas
from studio_core.shading.varying import Grey
from studio_core.transport.reflectance import VertexCoefficients

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Looks:
    """Of V vertices: values (V, 3 T + 1), and model (V,) which reflectance model; −1 without a material."""

    values: F32
    model: I32


class LookTable:
    """Makes `Looks`, keeping what pictures and materials that stay come to."""

    def __init__(self, services: Services) -> None:
        self._registry = services.registry
        self._coefficients = VertexCoefficients(services)
        self._pictures: dict[str, Grey] = {}
        self._made: tuple[F32, WorldMesh, tuple[Material, ...], Looks] | None = None

    def __call__(self, scene: Scene, surfaces: Surfaces) -> Looks:
        """Of the vertices of `surfaces.mesh`; the same object while nothing changes."""
        mesh = surfaces.mesh
        coefficients = self._coefficients(unpainted(scene), surfaces)
        used = tuple(scene.material(name) for name in surfaces.materials)
        if self._made is not None:
            before, shape, known, looks = self._made
            if before is coefficients and shape.material is mesh.material and known == used:
                return looks
        looks = self._looks(coefficients, used, mesh)
        self._made = coefficients, mesh, used, looks
        return looks

    def models(self, scene: Scene, surfaces: Surfaces) -> Looks:
        """Where looks decide nothing: of no channel."""
        mesh = surfaces.mesh
        used = tuple(scene.material(name) for name in surfaces.materials)
        return Looks(np.zeros((len(mesh), 0), np.float32), self._numbered(used)[mesh.material])

    def _numbered(self, materials: tuple[Material, ...]) -> I32:
        """(M + 1,) the number of each one's model; last −1."""
        numbers: dict[str, int] = {}
        known = [resolve(material, self._registry).brdf.id for material in materials]
        return np.array([*(numbers.setdefault(name, len(numbers)) for name in known), -1], np.int32)

    def _looks(self, coefficients: F32, materials: tuple[Material, ...], mesh: WorldMesh) -> Looks:
        values = np.zeros((len(mesh), 3 * coefficients.shape[1] + 1), np.float32)
        shares = np.cbrt(np.maximum(coefficients, 0))
        shares[:, 0] *= np.float32(np.cbrt(np.pi))
        values[:, :-1] = shares.reshape(len(mesh), -1)
        for number, material in enumerate(materials):
            own = np.flatnonzero(mesh.material == number)
            values[own, -1] = self._roughness(resolve(material, self._registry), mesh, own)
        return Looks(values, self._numbered(materials)[mesh.material])

    def _roughness(self, resolved: Resolved, mesh: WorldMesh, own: npt.NDArray[np.int64]) -> F32 | float:
        """α of a material at its vertices; 0 where its model does not say which number that is."""
        name = getattr(resolved.brdf, "roles", {}).get("gloss")
        if name is None:
            return 0.0
        value = np.float64(scalar(resolved.values[name]))
        if name not in resolved.shaping:
            return float(resolved.brdf.alpha(float(value)))  # type: ignore[attr-defined]
        texels = self._grey(resolved.shaping[name].image).at(mesh.uvs[own], picture_areas(mesh)[own])
        levels, which = np.unique(np.rint(texels * 255).astype(np.int64), return_inverse=True)
        alpha = [resolved.brdf.alpha(float(value * level / 255)) for level in levels]  # type: ignore[attr-defined]
        return np.asarray(alpha, np.float32)[which]

    def _grey(self, image: Image) -> Grey:
        if image.key not in self._pictures:
            self._pictures[image.key] = Grey.of(image)
        return self._pictures[image.key]


def unpainted(scene: Scene) -> Scene:
    """The scene before any stroke."""
    coated = [node for node in scene.of(MeshObject) if node.paint is not None]
    return scene.with_nodes(*(dataclasses.replace(node, paint=None) for node in coated)) if coated else scene


__all__ = ["LookTable", "Looks", "unpainted"]
