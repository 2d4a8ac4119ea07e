"""Materials for glTF 2.0: metallic-roughness, as near as it comes.

=============  =====================================================================================
model          glTF
=============  =====================================================================================
lambert        dielectric of roughness 1; its reflection switched off by KHR_materials_specular
ggx            baseColor, metallic, roughness as they are; KHR_materials_ior where specular ≠ 0.5
phong          roughness = √α with α² = 2 / (4n + 2); blinn-phong: α² = 2 / (n + 2). Highlight colours
blinn-phong    become F0 of a dielectric (KHR_materials_specular), or a metal where there is no matte part
any other      dielectric of roughness 1 in its mean colour, with a note
=============  =====================================================================================

Pictures of roughness and metal become the green and blue of one. All are double-sided; opacity below 1 is
blended. How pictures lie becomes KHR_texture_transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.albedo import mean_albedo
from studio_core.contract import Registry
from studio_core.imaging.encode import encode_png
from studio_core.imaging.transfer import linear_to_srgb
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, MaterialId, Scene
from studio_core.shading.materials import Resolved, first_channel, linear, resolve
from studio_plugins.export.gltf_buffer import Buffer

NO_MATTE = 0.02  # albedo under which a Phong material counts as metal
Json = dict[str, Any]


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
            self.materials.append(self._material(self.scene.material(key)))
        return self._known[key]

    def _material(self, material: Material) -> Json:
        resolved = resolve(material, self.registry)
        if resolved.problem:
            self.notes.append(resolved.problem)
        if any(shears(texture) for texture in (*resolved.textures.values(), *resolved.shaping.values())):
            told = "glTF cannot turn a picture whose sides differ in scale; it is written sheared."
            self.notes.append(f"{material.name}: {told}")
        made: Json = {"name": material.name, "doubleSided": True, "extensions": {}}
        model = resolved.brdf.id
        if model == "lambert":
            made["pbrMetallicRoughness"] = self._base(resolved, "base_color", 0.0, 1.0)
            made["extensions"]["KHR_materials_specular"] = {"specularFactor": 0.0}
        elif model == "ggx":
            self._ggx(made, material, resolved)
        elif model in ("phong", "blinn-phong"):
            self._phong(made, resolved)
            self.notes.append(f"{material.name}: glTF has no {resolved.brdf.label}; its nearest was written.")
        else:
            self.notes.append(f"{material.name}: glTF has no {resolved.brdf.label}; written as matte.")
            colour = _mean_colour(resolved)
            made["pbrMetallicRoughness"] = {
                "baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 1.0,
            }  # fmt: skip
        if material.opacity < 1:
            made["alphaMode"] = "BLEND"
            made["pbrMetallicRoughness"]["baseColorFactor"][3] = float(material.opacity)
        self.extensions.update(made["extensions"])
        if not made["extensions"]:
            del made["extensions"]
        return made

    def _base(self, resolved: Resolved, source: str, metallic: float, roughness: float) -> Json:
        made: Json = {
            "baseColorFactor": [*_unit(resolved.values[source]), 1.0],
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        }
        if source in resolved.textures:
            made["baseColorTexture"] = self._colour(resolved.textures[source])
        return made

    def _ggx(self, made: Json, material: Material, resolved: Resolved) -> None:
        values: Any = resolved.values
        base = self._base(resolved, "base_color", float(values["metallic"]), float(values["roughness"]))
        made["pbrMetallicRoughness"] = base
        specular = float(values["specular"])
        metal, rough = resolved.textures.get("metallic"), resolved.shaping.get("roughness")
        if metal is not None and rough is not None and not _alike(metal, rough):
            told = "glTF lays metal and roughness alike; the picture of the roughness became its mean."
            self.notes.append(f"{material.name}: {told}")
            typical: Any = resolved.typical()
            base["roughnessFactor"], rough = float(typical["roughness"]), None
        if metal is not None or rough is not None:
            base["metallicRoughnessTexture"] = self._shares(metal, rough)
        if "specular" in resolved.textures:
            specular *= float(linear(resolved.textures["specular"].image)[..., 0].mean())
            self.notes.append(f"{material.name}: glTF takes one reflectance; its texture's mean was written.")
        if specular != 0.5:
            root = math.sqrt(0.08 * min(max(specular, 0.0), 1.0))
            made["extensions"]["KHR_materials_ior"] = {"ior": (1 + root) / (1 - root)}

    def _phong(self, made: Json, resolved: Resolved) -> None:
        values: Any = resolved.values
        exponent = float(values["exponent"]) * (4 if resolved.brdf.id == "phong" else 1)
        roughness = math.sqrt(math.sqrt(2 / (exponent + 2)))
        diffuse, specular = np.array(_unit(values["diffuse"])), np.array(_unit(values["specular"]))
        excess = np.maximum(diffuse + specular, 1.0)
        diffuse, specular = diffuse / excess, specular / excess
        if diffuse.max() < NO_MATTE:
            made["pbrMetallicRoughness"] = self._base(resolved, "specular", 1.0, roughness)
            made["pbrMetallicRoughness"]["baseColorFactor"][:3] = specular.tolist()
            return
        made["pbrMetallicRoughness"] = self._base(resolved, "diffuse", 0.0, roughness)
        matte = np.minimum(diffuse / max(1 - specular.max(), 1e-3), 1.0)
        made["pbrMetallicRoughness"]["baseColorFactor"][:3] = matte.tolist()
        shine: Json = {"specularColorFactor": (specular / 0.04).tolist()}
        if "specular" in resolved.textures:
            shine["specularColorTexture"] = self._colour(resolved.textures["specular"])
        made["extensions"]["KHR_materials_specular"] = shine

    def _colour(self, texture: Texture) -> Json:
        return self._texture(texture, "colour", _encoded(texture.image))

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


def _alike(a: Texture, b: Texture) -> bool:
    return a.affine == b.affine


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


def _mean_colour(resolved: Resolved) -> list[float]:
    return [*_unit(mean_albedo(resolved.brdf, resolved.values)), 1.0]
