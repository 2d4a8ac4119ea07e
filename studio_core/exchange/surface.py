"""What material files of other programs say: a surface with a base, gloss, sheen and a coat.

`Surface` has the parameters of glTF 2.0's metallic-roughness with its extensions (specular, ior, anisotropy,
sheen, clearcoat), and two that OpenPBR has beyond them: rough matte parts and the tint of a metal's rim.
 Readers of files fill it, `incoming` finds the model of ours that comes nearest, `outgoing` goes
the other way, and `reflectance` says what light it sends where, so that losses can be measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.params import Colour, Value
from studio_core.scene.geometry import Image, Texture
from studio_core.shading.normal_maps import NORMAL as NORMAL

WHITE: Colour = (1.0, 1.0, 1.0)
BLACK: Colour = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Surface:
    """All numbers 0…1 but `ior` (≥ 1) and the angle; colours linear Rec.709.

    `textures` multiply the field that they are named like; a map of normals (`shading.normal_maps`) is named
    `normal`, `normal_strength` multiplies its slopes.

    metallic: 0 dielectric, 1 metal. roughness: α = roughness², of the smaller α where it is anisotropic.
    diffuse_roughness: r of EON (`oren-nayar`). specular, specular_color: weight of a dielectric's reflection,
    colour of its F0. edge_tint: of a metal at 82°, as a share of Schlick's. anisotropy s: the larger
    α = α + (1 − α) s², along `anisotropy_rotation` (degrees, counter-clockwise from u). sheen_color,
    sheen_roughness: fibres over all of it. clearcoat, clearcoat_roughness: weight and roughness of a
    clear coat of index 1.5 over everything but sheen.
    """

    name: str = "Material"
    base_color: Colour = WHITE
    metallic: float = 0.0
    roughness: float = 0.5
    diffuse_roughness: float = 0.0
    ior: float = 1.5
    specular: float = 1.0
    specular_color: Colour = WHITE
    edge_tint: Colour = WHITE
    anisotropy: float = 0.0
    anisotropy_rotation: float = 0.0
    sheen_color: Colour = BLACK
    sheen_roughness: float = 0.0
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    opacity: float = 1.0
    normal_strength: float = 1.0
    textures: Mapping[str, Texture] = field(default_factory=frozen_map)

    @property
    def f0(self) -> float:
        """Reflectance head-on of what is no metal, without weight and colour."""
        return ((self.ior - 1) / (self.ior + 1)) ** 2

    @property
    def alphas(self) -> tuple[float, float]:
        """α along `anisotropy_rotation`, and across it."""
        across = self.roughness**2
        return across + (1 - across) * self.anisotropy**2, across

    def mean(self) -> Surface:
        """Without pictures: each is its mean."""
        made: dict[str, Any] = {}
        for name, texture in self.textures.items():
            if name != NORMAL:
                made[name] = times(getattr(self, name), texture)
        return replace(self, textures=frozen_map(), **made)

    def smooth(self) -> Surface:
        """The matte part without roughness, as bright under an even sky."""
        if self.diffuse_roughness <= 0 or self.metallic >= 1:
            return self.plain("diffuse_roughness")
        r = self.diffuse_roughness
        mean = (1 + (2 / 3 - 28 / (15 * math.pi)) * r) / (1 + (0.5 - 2 / (3 * math.pi)) * r)

        def returned(albedo: Any) -> Any:
            """Of EON: ρ Ē / (1 − ρ (1 − Ē)) (Portsmouth, Kutz & Hill 2024)."""
            return albedo * mean / (1 - albedo * (1 - mean))

        made, textures = self.base_color, dict(self.textures)
        if "base_color" in textures:
            from studio_core.shading.materials import linear_rgb

            old = textures["base_color"]
            pixels = returned(linear_rgb(old.image) * np.asarray(made, np.float32))
            textures["base_color"] = replace(old, image=Image(pixels.astype(np.float32)))
            made = WHITE
        else:
            red, green, blue = (returned(c) for c in made)
            made = (red, green, blue)
        flat = replace(self, base_color=made, textures=frozen_map(textures))
        return flat.plain("diffuse_roughness")

    def plain(self, *names: str) -> Surface:
        """These fields as they are by default, without their pictures."""
        defaults = {f.name: f.default for f in fields(self) if f.name in names}
        kept = {name: texture for name, texture in self.textures.items() if name not in names}
        return replace(self, textures=frozen_map(kept), **defaults)  # type: ignore[arg-type]


T = TypeVar("T", bound=Value)


def times(value: T, texture: Texture) -> T:
    """A number or colour times the mean of its picture, in 0…1."""
    from studio_core.shading.materials import linear_rgb, mean_texel

    made: Any
    if isinstance(value, tuple):
        mean = linear_rgb(texture.image).mean(axis=(0, 1), dtype=np.float64)
        made = tuple(float(np.clip(v * m, 0, 1)) for v, m in zip(value, mean, strict=True))
    else:
        made = float(np.clip(float(value) * mean_texel(texture.image), 0, 1))
    return made  # type: ignore[no-any-return]


def ior_of(f0: float) -> float:
    """The index of refraction that reflects F0 head-on (below 1)."""
    root = math.sqrt(min(max(f0, 0.0), 0.999))
    return (1 + root) / (1 - root)


def stretched(along: float, across: float) -> tuple[float, float]:
    """`roughness` and `anisotropy` of the α along the wide direction and of that across it."""
    across = min(across, along, 1.0)
    wide = min(along, 1.0)
    strength = (wide - across) / (1 - across) if across < 1 else 0.0
    return math.sqrt(across), math.sqrt(max(strength, 0.0))


def alike(a: Texture, b: Texture) -> bool:
    """Whether two pictures lie alike on their surface."""
    return a.affine == b.affine
