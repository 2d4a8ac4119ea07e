"""Materials of glTF 2.0 as ours: metallic-roughness is GGX; glass is seen through by its transmission.

The green channel of a metallic-roughness picture becomes a picture of the roughness, the blue one of the
metal; a channel that is the same all over becomes its mean.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from studio_core.errors import InputError
from studio_core.params import Value
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, new_id
from studio_plugins.meshes.common import PLAIN_GREY, Notes, colour
from studio_plugins.meshes.gltf_file import GltfFile, Json, as_index
from studio_plugins.meshes.pictures import Pictures, channel_of, mean_of, opaque

MOST_TEXELS = 1 << 22  # of pictures of colour and metal together: a table of coefficients takes 48 bytes each


class GltfMaterials:
    """Makes each material once; `uv_set` tells which texture coordinates its base colour uses."""

    def __init__(self, file: GltfFile, pictures: Pictures, notes: Notes) -> None:
        self.file, self.pictures, self.notes = file, pictures, notes
        self.made: dict[int | None, Material] = {}
        self.uv_sets: dict[int | None, int] = {}

    def get(self, index: object) -> tuple[Material, int]:
        """The material of that index (None: a plain one) and its set of texture coordinates."""
        if index is None:
            if None not in self.made:
                self.made[None] = self._default()
            return self.made[None], 0
        source = self.file.item("materials", index)
        index = int(str(as_index(index)))
        if index not in self.made:
            self.made[index], self.uv_sets[index] = self._make(source, index)
        return self.made[index], self.uv_sets[index]

    def _default(self) -> Material:
        """Matte grey: the format's own default is a white metal, which nobody means by leaving it out."""
        return Material(id=new_id("material"), name="Plain", values={"base_color": (PLAIN_GREY,) * 3})

    def _make(self, source: Json, index: int) -> tuple[Material, int]:
        name = source.get("name")
        name = name if isinstance(name, str) and name else f"Material {index + 1}"
        extensions = _object(source, "extensions")
        glossy = _object(extensions, "KHR_materials_pbrSpecularGlossiness")
        pbr = _object(source, "pbrMetallicRoughness")
        if glossy and not pbr:
            self.notes.say(f"The specular-glossiness material {name!r} became metallic-roughness.")
            factor = self.file.floats(glossy, "diffuseFactor", (1.0,) * 4)
            metallic, key = 0.0, "diffuseTexture"
            roughness = 1.0 - self.file.floats(glossy, "glossinessFactor", (1.0,))[0]
            pbr = glossy
        else:
            factor = self.file.floats(pbr, "baseColorFactor", (1.0,) * 4)
            metallic = self.file.floats(pbr, "metallicFactor", (1.0,))[0]
            roughness = self.file.floats(pbr, "roughnessFactor", (1.0,))[0]
            key = "baseColorTexture"
        reference = pbr.get(key)
        image = self._image(reference)
        textures: dict[str, Texture] = {}
        uv_set: int | None = None
        if image is not None and isinstance(reference, dict):
            placed, uv_set = self._placing(reference, opaque(image))
            textures["base_color"] = placed
        second = pbr.get("metallicRoughnessTexture")
        both = self._image(second, plain=True)
        if both is not None and isinstance(second, dict):
            placed, own_set = self._placing(second, both)
            means = self._vary(placed, own_set, uv_set, textures, name)
            metallic, roughness = metallic * means[0], roughness * means[1]
            uv_set = own_set if uv_set is None else uv_set
        for unused, word in (
            ("normalTexture", "normal"),
            ("occlusionTexture", "occlusion"),
            ("emissiveTexture", "emission"),
        ):
            if unused in source:
                self.notes.say(f"The {word} map of {name!r} is not used.")
        if max(self.file.floats(source, "emissiveFactor", (0.0,) * 3)) > 0:
            self.notes.say(f"The material {name!r} shines by itself; add a lamp for its light.")
        values: dict[str, Value] = {
            "base_color": colour(factor[:3]),
            "metallic": min(max(metallic, 0.0), 1.0),
            "roughness": min(max(roughness, 0.0), 1.0),
            "specular": self._specular(extensions),
        }
        material = Material(
            id=new_id("material"),
            name=name,
            model="ggx",
            values=values,
            textures=textures,
            opacity=self._opacity(source, extensions, factor[3], image, name),
        )
        return material, uv_set or 0

    def _vary(
        self,
        placed: Texture,
        own_set: int,
        uv_set: int | None,
        textures: dict[str, Texture],
        name: str,
    ) -> tuple[float, float]:
        """Adds pictures of metal and roughness; the factors that stand for what is none (1: it is one)."""
        both = placed.image
        if uv_set is not None and own_set != uv_set:
            self.notes.say(f"The mean of the metallic-roughness picture is used for all of {name!r}.")
            return mean_of(both, 2), mean_of(both, 1)
        metal, rough = channel_of(both, 2), channel_of(both, 1)
        base = textures.get("base_color")
        if metal is not None and base is not None:
            alike = base.affine == placed.affine
            large = max(base.image.pixels[..., 0].size, metal.pixels.size) > MOST_TEXELS
            if large or not alike:
                why = "is too large" if large else "lies otherwise than its colour"
                self.notes.say(f"The picture of the metal of {name!r} {why}: its mean is used.")
                metal = None
        if metal is not None:
            textures["metallic"] = dataclasses.replace(placed, image=metal)
        if rough is not None:
            textures["roughness"] = dataclasses.replace(placed, image=rough)
        return 1.0 if metal is not None else mean_of(both, 2), 1.0 if rough is not None else mean_of(both, 1)

    def _specular(self, extensions: Json) -> float:
        """Ours is F0 / 0.08; from the index of refraction (1.5 gives 0.5) and the specular factor."""
        ior = self.file.floats(_object(extensions, "KHR_materials_ior"), "ior", (1.5,))[0]
        factor = self.file.floats(_object(extensions, "KHR_materials_specular"), "specularFactor", (1.0,))[0]
        f0 = ((ior - 1) / (ior + 1)) ** 2 if ior >= 1 else 0.04
        return min(max(f0 / 0.08 * factor, 0.0), 1.0)

    def _opacity(self, source: Json, extensions: Json, alpha: float, image: Image | None, name: str) -> float:
        mode = source.get("alphaMode", "OPAQUE")
        opacity = 1.0
        if mode in ("BLEND", "MASK"):
            opacity = alpha
            if image is not None and image.pixels.shape[2] == 4:
                self.notes.say(f"The picture of {name!r} has holes; their mean is its opacity.")
                if mode == "MASK":
                    cutoff = self.file.floats(source, "alphaCutoff", (0.5,))[0]
                    scale = 255.0 if image.pixels.dtype == np.uint8 else 1.0
                    opacity = float((image.pixels[:, :, 3] * (alpha / scale) >= cutoff).mean())
                else:
                    opacity *= mean_of(image, 3)
            elif mode == "MASK":
                opacity = 1.0 if alpha >= self.file.floats(source, "alphaCutoff", (0.5,))[0] else 0.0
        glass = _object(extensions, "KHR_materials_transmission")
        opacity *= 1.0 - self.file.floats(glass, "transmissionFactor", (0.0,))[0]
        return min(max(opacity, 0.0), 1.0)

    def _placing(self, reference: Json, image: Image) -> tuple[Texture, int]:
        """The picture laid as the reference says, and the set of coordinates.

        Our v runs up, the format's down. It scales, then turns uv counter-clockwise as one sees it (the
        picture clockwise): u' = cu + sv, v' = cv − su, as all programs do (KhronosGroup/glTF#1563).
        """
        transform = _object(_object(reference, "extensions"), "KHR_texture_transform")
        scale_u, scale_v = self.file.floats(transform, "scale", (1.0, 1.0))
        offset_u, offset_v = self.file.floats(transform, "offset", (0.0, 0.0))
        turned = math.degrees(self.file.floats(transform, "rotation", (0.0,))[0])
        uv_set = self.file.whole(reference, "texCoord", 0)
        turnable = turned % 360 != 0 and scale_u != 0
        own = (scale_u, scale_u) if turnable else (scale_u, scale_v)
        laid = Texture(image, own, (0.0, 0.0), -turned, scale_v / scale_u if turnable else 1.0)
        _, down, _, _, up, _ = laid.affine  # where v = 1, which the format counts from
        laid = dataclasses.replace(laid, offset=(offset_u - down, 1.0 - offset_v - up))
        return laid, self.file.whole(transform, "texCoord", uv_set)

    def _image(self, reference: object, *, plain: bool = False) -> Image | None:
        """The picture of a texture reference, None (with a note) when it cannot be had.

        `plain`: its numbers are no colours.
        """
        if not isinstance(reference, dict):
            return None
        texture = self.file.item("textures", reference.get("index"))
        source = texture.get("source")
        webp = _object(_object(texture, "extensions"), "EXT_texture_webp").get("source")
        place = webp if webp is not None else source
        if place is None:
            self.notes.say("A picture in a format that is not known here was left out.")
            return None
        image = self.file.item("images", place)
        name = image.get("name") or image.get("uri") or f"image {place}"
        name = name[:80] if isinstance(name, str) and not name.startswith("data:") else f"image {place}"
        try:
            if "bufferView" in image:
                data = bytes(self.file.view(image["bufferView"])[0])
            else:
                data = self.file.resource(image.get("uri"))
        except InputError as error:
            self.notes.say(f"The picture {name!r} was left out: {error}.")
            return None
        told = f"the picture {name!r} of {self.file.path.name}"
        return self.pictures.data(("image", place), data, told, plain=plain)


def _object(source: Json, key: str) -> Json:
    """An object in an object; empty when it is absent or something else."""
    found: Any = source.get(key)
    return found if isinstance(found, dict) else {}
