"""Materials for glTF 2.0: metallic-roughness and the KHR_materials extensions, as near as they come.

What each model becomes stands in `studio_core.exchange.outgoing`; here it is written. Pictures of roughness
and metal become the green and blue of one, the weight of the reflection the alpha of one; those of what is
seldom drawn become their mean. All are double-sided; opacity below 1 is blended. How pictures lie becomes
KHR_texture_transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.exchange.outgoing import surface_of
from studio_core.exchange.surface import BLACK, NORMAL, WHITE, Surface, alike, times
from studio_core.imaging.encode import encode_png
from studio_core.imaging.transfer import linear_to_srgb
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import MaterialId, Scene
from studio_core.shading.materials import first_channel, linear
from studio_core.shading.normal_maps import unit_normals
from studio_plugins.export.gltf_buffer import Buffer

Json = dict[str, Any]
_MEANS = ("clearcoat", "clearcoat_roughness", "sheen_roughness")


@dataclass
class Materials:
    """Writes materials and textures once each."""

    scene: Scene
    registry: Registry
    buffer: Buffer
    materials: list[Json] = field(default_factory=list)
    textures: list[Json] = field(default_factory=list)
    images: list[Json] = field(default_factory=list)
    extensions: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    _known: dict[MaterialId, int] = field(default_factory=dict)
    _pictures: dict[tuple[str, str], int] = field(default_factory=dict)

    def use(self, key: MaterialId) -> int:
        """Index of the material."""
        if key not in self._known:
            self._known[key] = len(self.materials)
            made = surface_of(self.scene.material(key), self.registry)
            surface = made.surface.smooth().plain("edge_tint")
            self.notes += made.told(surface, "glTF")
            self.materials.append(self.written(surface))
        return self._known[key]

    def written(self, surface: Surface) -> Json:
        """The JSON of a material; what it lacks goes to `notes`."""
        if any(shears(texture) for texture in surface.textures.values()):
            self._note(
                surface, "glTF cannot turn a picture whose sides differ in scale; it is written sheared."
            )
        for name in _MEANS:
            if name in surface.textures:
                value = times(getattr(surface, name), surface.textures[name])
                surface = replace(surface.plain(name), **{name: value})
                self._note(surface, f"the picture of its {name.replace('_', ' ')} was written as its mean.")
        base = self._base(surface)
        extensions = {
            name: told
            for name, told in self._layers(surface)
            if told and not (name in _REFLECTION and _bare(surface))
        }
        made: Json = {"name": surface.name, "doubleSided": True, "pbrMetallicRoughness": base}
        if extensions:
            made["extensions"] = extensions
            self.extensions.update(extensions)
        if NORMAL in surface.textures:
            made["normalTexture"] = self._normals(surface.textures[NORMAL], surface.normal_strength)
        if surface.opacity < 1:
            made["alphaMode"] = "BLEND"
            base["baseColorFactor"][3] = surface.opacity
        return made

    def _base(self, surface: Surface) -> Json:
        made: Json = {
            "baseColorFactor": [*_unit(surface.base_color), 1.0],
            "metallicFactor": surface.metallic,
            "roughnessFactor": surface.roughness,
        }
        if "base_color" in surface.textures:
            made["baseColorTexture"] = self._colour(surface.textures["base_color"])
        metal, rough = (surface.textures.get(name) for name in ("metallic", "roughness"))
        if metal is not None and rough is not None and not alike(metal, rough):
            told = "glTF lays metal and roughness alike; the picture of the roughness became its mean."
            self._note(surface, told)
            made["roughnessFactor"], rough = times(surface.roughness, rough), None
        if metal is not None or rough is not None:
            made["metallicRoughnessTexture"] = self._shares(metal, rough)
        return made

    def _layers(self, surface: Surface) -> list[tuple[str, Json]]:
        """Each extension with what it says; nothing where it says nothing."""
        made: list[tuple[str, Json]] = []
        if surface.ior != 1.5:
            made.append(("KHR_materials_ior", {"ior": surface.ior}))
        shine: Json = {}
        if surface.specular < 1:
            shine["specularFactor"] = surface.specular
        if surface.specular_color != WHITE:
            shine["specularColorFactor"] = list(surface.specular_color)
        if "specular" in surface.textures:
            shine["specularTexture"] = self._weight(surface.textures["specular"])
        if "specular_color" in surface.textures:
            shine["specularColorTexture"] = self._colour(surface.textures["specular_color"])
        made.append(("KHR_materials_specular", shine))
        if surface.anisotropy > 0:
            turn = math.radians(surface.anisotropy_rotation)
            told = {"anisotropyStrength": surface.anisotropy, "anisotropyRotation": turn}
            made.append(("KHR_materials_anisotropy", told))
        if surface.clearcoat > 0:
            told = {
                "clearcoatFactor": surface.clearcoat,
                "clearcoatRoughnessFactor": surface.clearcoat_roughness,
            }
            made.append(("KHR_materials_clearcoat", told))
        if surface.sheen_color != BLACK:
            sheen: Json = {
                "sheenColorFactor": list(surface.sheen_color),
                "sheenRoughnessFactor": surface.sheen_roughness,
            }
            if "sheen_color" in surface.textures:
                sheen["sheenColorTexture"] = self._colour(surface.textures["sheen_color"])
            made.append(("KHR_materials_sheen", sheen))
        return made

    def _colour(self, texture: Texture) -> Json:
        return self._texture(texture, "colour", _encoded(texture.image))

    def _normals(self, texture: Texture, strong: float) -> Json:
        """A normal map; a strength below 0, which readers may not expect, becomes one of its texels."""
        normals = unit_normals(texture.image, math.copysign(1.0, strong))
        pixels = np.rint((normals + 1) * 127.5).astype(np.uint8)
        if texture.image.pixels.dtype == np.uint8 and strong >= 0:
            pixels = np.ascontiguousarray(texture.image.pixels[..., :3])
        made = self._texture(texture, f"normals {math.copysign(1.0, strong)}", pixels)
        return made if abs(strong) == 1 else {**made, "scale": abs(strong)}

    def _weight(self, texture: Texture) -> Json:
        """Numbers in the alpha of a white picture."""
        share = np.rint(np.clip(first_channel(texture.image), 0, 1) * 255).astype(np.uint8)
        pixels = np.full((*share.shape, 4), 255, np.uint8)
        pixels[..., 3] = share
        return self._texture(texture, "weight", pixels)

    def _shares(self, metal: Texture | None, rough: Texture | None) -> Json:
        """A picture with roughness in green and metal in blue; what is none is white."""
        given = [texture for texture in (rough, metal) if texture is not None]
        size = tuple(max(t.image.pixels.shape[axis] for t in given) for axis in (0, 1))
        pixels = np.full((*size, 3), 255, np.uint8)
        for channel, texture in ((1, rough), (2, metal)):
            if texture is not None:
                pixels[..., channel] = np.rint(
                    np.clip(_sized(first_channel(texture.image), size), 0, 1) * 255
                )
        use = " ".join("" if t is None else t.image.key for t in (rough, metal))
        return self._texture(given[0], f"shares {use}", pixels)

    def _texture(self, texture: Texture, use: str, pixels: npt.NDArray[np.uint8]) -> Json:
        key = (texture.image.key, use)
        if key not in self._pictures:
            self._pictures[key] = len(self.textures)
            self.images.append({"bufferView": self.buffer.view(encode_png(pixels)), "mimeType": "image/png"})
            self.textures.append({"sampler": 0, "source": len(self.images) - 1})
        made: Json = {"index": self._pictures[key]}
        moved = _transform(texture)
        if moved:
            made["extensions"] = {"KHR_texture_transform": moved}
            self.extensions.add("KHR_texture_transform")
        return made

    def _note(self, surface: Surface, text: str) -> None:
        self.notes.append(f"{surface.name}: {text}")


_REFLECTION = ("KHR_materials_ior",)


def _bare(surface: Surface) -> bool:
    """Whether an index of refraction would say nothing: metal all over, or no reflection."""
    metal = surface.metallic >= 1 and "metallic" not in surface.textures
    return metal or surface.specular <= 0


def _transform(texture: Texture) -> Json:
    """KHR_texture_transform: what takes (u, 1 − v) to (place, 1 − place); empty where that is nothing.

    It scales before it turns; `shears` says what it cannot.
    """
    a, b, t, c, d, s = texture.affine
    if (a, b, t, c, d, s) == (1.0, 0.0, 0.0, 0.0, 1.0, 0.0):
        return {}
    offset = [t + b, 1 - s - d]
    if b == 0 and c == 0:
        return {"scale": [a, d], "offset": offset}
    turned = math.atan2(c, a)
    cosine, sine = math.cos(turned), math.sin(turned)
    scale = [math.hypot(a, c), cosine * d - sine * b]
    return {"scale": scale, "rotation": turned, "offset": offset}


def shears(texture: Texture) -> bool:
    """Whether a picture lies so that glTF, which scales before it turns, cannot say it."""
    a, b, _, c, d, _ = texture.affine
    return abs(a * b + c * d) > 1e-6 * max(math.hypot(a, c) * math.hypot(b, d), 1e-30)


def _sized(texels: npt.NDArray[np.float32], size: tuple[int, ...]) -> npt.NDArray[np.float32]:
    """The nearest texels at another size."""
    rows, columns = (np.arange(n) * had // n for n, had in zip(size, texels.shape, strict=True))
    return np.asarray(texels[rows][:, columns])


def _unit(value: Any) -> list[float]:
    return [min(max(float(v), 0.0), 1.0) for v in value]


def _encoded(image: Image) -> npt.NDArray[np.uint8]:
    """(H, W, 3) sRGB bytes; 8-bit sRGB pictures unchanged."""
    pixels = image.pixels
    if pixels.dtype != np.uint8 or image.encoding != "srgb":
        pixels = linear_to_srgb(linear(image)[..., :3])
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else np.ascontiguousarray(pixels[..., :3])
