"""How a slot's picture looks at places of a surface: what paint with looks follows.

A look is the cube root of the picture's texel, about as uniform as lightness, before the material's own
colour: a slider moves none. It is the mean over the part of the picture that a place stands for.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.shading.materials import linear_rgb, resolve
from studio_core.shading.pyramids import pyramid
from studio_core.shading.texels import picture_areas, trilinear

F32 = npt.NDArray[np.float32]

FINEST = 1024
HELD = 8
"""Pictures that are kept."""


def shown_picture(material: Material, registry: Registry) -> Texture | None:
    """The first picture of what a material's colours are made of, by name."""
    textures = resolve(material, registry).textures
    return textures[min(textures)] if textures else None


@dataclass(frozen=True, eq=False)
class Levels:
    """A picture's levels (h, w, 3), linear, rows from v = 0 up, of at most FINEST texels a side."""

    levels: tuple[F32, ...]

    @staticmethod
    def of(image: Image) -> Levels:
        """Of a picture."""
        texels = linear_rgb(image)[::-1]
        step = -(-max(texels.shape[:2]) // FINEST)
        if step > 1:
            height, width = (side // step * step for side in texels.shape[:2])
            cut = texels[:height, :width].reshape(height // step, step, width // step, step, 3)
            texels = cut.mean(axis=(1, 3), dtype=np.float32)
        return Levels(pyramid(texels).levels)

    def at(self, uvs: F32, area: F32) -> F32:
        """(P, 3) looks about uvs (P, 2) in the picture's own coordinates, over `area` (P,) of it."""
        return np.asarray(np.cbrt(np.maximum(trilinear(self.levels, uvs, area), 0)), np.float32)


class PictureLooks:
    """Looks of an object's vertices, or of any places of it, keeping pictures."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._held: OrderedDict[str, Levels] = OrderedDict()

    def pictures(self, scene: Scene, node: MeshObject) -> tuple[Texture | None, ...]:
        """What the object's slots show; looks depend on these alone."""
        return tuple(shown_picture(scene.material(name), self._registry) for name in node.materials)

    def of_mesh(self, pictures: tuple[Texture | None, ...], mesh: ShadingMesh, *, sharp: bool = False) -> F32:
        """(V, 3) at the vertices of an object's mesh; 0 where its slot shows no picture.

        Of the vertices themselves if `sharp`, else of what they stand for.
        """
        uvs = np.zeros((len(mesh), 2), np.float32) if mesh.uvs is None else mesh.uvs
        area = np.zeros(len(mesh), np.float32) if sharp else picture_areas(mesh)
        return self.at(pictures, uvs, mesh.slot.astype(np.int64), area)

    def at(
        self, pictures: tuple[Texture | None, ...], uvs: F32, slots: npt.NDArray[np.int64], area: F32
    ) -> F32:
        """(P, 3) at places with uvs (P, 2) and slots (P,) that stand for `area` (P,) of the uv plane."""
        made = np.zeros((len(slots), 3), np.float32)
        number = np.minimum(slots, len(pictures) - 1)
        for slot, texture in enumerate(pictures):
            own = np.flatnonzero(number == slot)
            if texture is None or not len(own):
                continue
            levels = self._levels(texture.image)
            made[own] = levels.at(texture.placed(uvs[own]), area[own] * np.float32(texture.area))
        return made

    def _levels(self, image: Image) -> Levels:
        if image.key not in self._held:
            self._held[image.key] = Levels.of(image)
            while len(self._held) > HELD:
                self._held.popitem(last=False)
        self._held.move_to_end(image.key)
        return self._held[image.key]


def looks_vary(looks: F32) -> bool:
    """Whether paint would have anything to follow."""
    return bool(len(looks)) and not math.isclose(float(np.ptp(looks, axis=0).max()), 0.0, abs_tol=1e-3)


__all__ = ["Levels", "PictureLooks", "looks_vary", "shown_picture"]
