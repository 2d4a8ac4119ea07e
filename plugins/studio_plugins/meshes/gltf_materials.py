"""Materials of glTF 2.0 as ours: read as a `Surface`, for which the core finds the nearest model.

The green channel of a metallic-roughness picture becomes a picture of the roughness, the blue one of the
metal; a channel that is the same all over becomes its mean. Glass is seen through by its transmission.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.errors import InputError
from studio_core.exchange.incoming import material_of
from studio_core.exchange.pictures import Pictures, channel_of, mean_of, opaque
from studio_core.exchange.surface import NORMAL, Surface, times
from studio_core.params import Colour
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, new_id
from studio_plugins.meshes.common import PLAIN_GREY, Notes, colour
from studio_plugins.meshes.gltf_file import GltfFile, Json, as_index

_READ = (
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
)


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

    def every(self) -> tuple[Material, ...]:
        """All materials of the file."""
        return tuple(self.get(index)[0] for index in range(len(self.file.list_of("materials"))))

    def _default(self) -> Material:
        """Matte grey: the format's own default is a white metal, which nobody means by leaving it out."""
        return Material(id=new_id("material"), name="Plain", values={"base_color": (PLAIN_GREY,) * 3})

    def _make(self, source: Json, index: int) -> tuple[Material, int]:
        name = source.get("name")
        name = name if isinstance(name, str) and name else f"Material {index + 1}"
        extensions = _object(source, "extensions")
        slots = _Slots(self, name)
        surface, image = self._base(source, extensions, slots)
        surface = self._layers(surface, extensions, slots)
        self._unused(source, extensions, name)
        alpha = self._opacity(source, extensions, surface.opacity, image, name)
        strong = slots.normals(source.get("normalTexture"))
        surface = replace(
            surface, name=name, opacity=alpha, normal_strength=strong, textures=frozen_map(slots.textures)
        )
        return material_of(surface, self.notes.say), slots.uv_set or 0

    def _base(self, source: Json, extensions: Json, slots: _Slots) -> tuple[Surface, Image | None]:
        """Colour (its alpha as opacity), metal and roughness, and the picture of the colour."""
        glossy = _object(extensions, "KHR_materials_pbrSpecularGlossiness")
        pbr, key, metallic = _object(source, "pbrMetallicRoughness"), "baseColorTexture", 0.0
        if glossy and not pbr:
            self.notes.say(f"The specular-glossiness material {slots.name!r} became metallic-roughness.")
            factor = self.file.floats(glossy, "diffuseFactor", (1.0,) * 4)
            roughness = 1.0 - self.file.floats(glossy, "glossinessFactor", (1.0,))[0]
            pbr, key = glossy, "diffuseTexture"
        else:
            factor = self.file.floats(pbr, "baseColorFactor", (1.0,) * 4)
            metallic = self._share(pbr, "metallicFactor", 1.0)
            roughness = self._share(pbr, "roughnessFactor", 1.0)
        image = slots.colour(pbr.get(key), "base_color")
        second = pbr.get("metallicRoughnessTexture")
        metallic *= slots.number(second, "metallic", 2)
        roughness *= slots.number(second, "roughness", 1)
        made = Surface(
            base_color=colour(factor[:3]),
            metallic=_unit(metallic),
            roughness=_unit(roughness),
            opacity=factor[3],
        )
        return made, image

    def _layers(self, surface: Surface, extensions: Json, slots: _Slots) -> Surface:
        """What the extensions add: index and reflectance, grain, sheen, coat."""
        made: dict[str, Any] = {}
        ior = self.file.floats(_object(extensions, "KHR_materials_ior"), "ior", (1.5,))[0]
        made["ior"] = (
            ior if ior >= 1 else 1e3 if ior == 0 else 1.5
        )  # 0: reflects everything, by the extension
        told = _object(extensions, "KHR_materials_specular")
        if told:
            factor = self._share(told, "specularFactor", 1.0)
            made["specular"] = factor * slots.number(told.get("specularTexture"), "specular", 3)
            tint = self.file.floats(told, "specularColorFactor", (1.0,) * 3)
            strongest = max(*tint, 1.0)
            if strongest > 1:  # more than the index says: then the index is higher
                f0 = min(((made["ior"] - 1) / (made["ior"] + 1)) ** 2 * strongest, 1.0)
                made["ior"] = (1 + f0**0.5) / max(1 - f0**0.5, 1e-3)
            made["specular_color"] = colour([t / strongest for t in tint])
            slots.colour(told.get("specularColorTexture"), "specular_color")
            made["specular_color"] = slots.factored("specular_color", made["specular_color"])
        told = _object(extensions, "KHR_materials_anisotropy")
        if told:
            made["anisotropy"] = self._share(told, "anisotropyStrength", 0.0)
            turn = self.file.floats(told, "anisotropyRotation", (0.0,))[0]
            made["anisotropy_rotation"] = math.degrees(turn)
            if "anisotropyTexture" in told:
                self.notes.say(f"The picture of the grain of {slots.name!r} is not used.")
        told = _object(extensions, "KHR_materials_sheen")
        if told:
            made["sheen_color"] = colour(self.file.floats(told, "sheenColorFactor", (0.0,) * 3))
            slots.colour(told.get("sheenColorTexture"), "sheen_color")
            made["sheen_color"] = slots.factored("sheen_color", made["sheen_color"])
            rough = self._share(told, "sheenRoughnessFactor", 0.0)
            made["sheen_roughness"] = rough * slots.number(
                told.get("sheenRoughnessTexture"), "sheen_roughness", 3
            )
        told = _object(extensions, "KHR_materials_clearcoat")
        if told:
            coat = self._share(told, "clearcoatFactor", 0.0)
            made["clearcoat"] = coat * slots.number(told.get("clearcoatTexture"), "clearcoat", 0)
            rough = self._share(told, "clearcoatRoughnessFactor", 0.0)
            made["clearcoat_roughness"] = rough * slots.number(
                told.get("clearcoatRoughnessTexture"), "clearcoat_roughness", 1
            )
            if "clearcoatNormalTexture" in told:
                self.notes.say(f"The clear coat's normal map of {slots.name!r} is not used.")
        return replace(surface, **made)

    def _unused(self, source: Json, extensions: Json, name: str) -> None:
        for unused, word in (
            ("occlusionTexture", "occlusion"),
            ("emissiveTexture", "emission"),
        ):
            if unused in source:
                self.notes.say(f"The {word} map of {name!r} is not used.")
        if max(self.file.floats(source, "emissiveFactor", (0.0,) * 3)) > 0:
            self.notes.say(f"The material {name!r} shines by itself; add a lamp for its light.")
        if "KHR_materials_unlit" in extensions:
            self.notes.say(
                f"The material {name!r} shows its colour without light in the file; here it is lit."
            )
        for extension in extensions:
            if extension not in _READ:
                self.notes.say(f"{extension[:60]} of {name!r} is not used.")

    def _share(self, source: Json, key: str, default: float) -> float:
        return _unit(self.file.floats(source, key, (default,))[0])

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
        if "transmissionTexture" in glass:
            self.notes.say(f"The picture of the transmission of {name!r} is not used.")
        return _unit(opacity)

    def placing(self, reference: Json, image: Image) -> tuple[Texture, int]:
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
        laid = replace(laid, offset=(offset_u - down, 1.0 - offset_v - up))
        return laid, self.file.whole(transform, "texCoord", uv_set)

    def image(self, reference: object, *, plain: bool = False) -> Image | None:
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


@dataclass
class _Slots:
    """The pictures of one material, all with the texture coordinates of the first."""

    reader: GltfMaterials
    name: str
    textures: dict[str, Texture] = field(default_factory=dict)
    means: dict[str, Texture] = field(default_factory=dict)
    uv_set: int | None = None

    def colour(self, reference: object, target: str) -> Image | None:
        """Take a picture of colours; it as it was, alpha included."""
        image = self.reader.image(reference)
        if image is not None and isinstance(reference, dict):
            placed, own_set = self.reader.placing(reference, opaque(image))
            (self.textures if self._fits(own_set, target) else self.means)[target] = placed
        return image

    def factored(self, target: str, value: Colour) -> Colour:
        """A colour times the mean of its picture, where that one could not be laid."""
        return times(value, self.means[target]) if target in self.means else value

    def number(self, reference: object, target: str, channel: int) -> float:
        """Take one channel as numbers; the factor that stands for what is no picture (1: it is one)."""
        image = self.reader.image(reference, plain=True)
        if image is None or not isinstance(reference, dict):
            return 1.0
        if channel == 3 and image.pixels.shape[2] < 4:
            return 1.0
        placed, own_set = self.reader.placing(reference, image)
        found = channel_of(image, channel)
        if found is None or not self._fits(own_set, target):
            return mean_of(image, channel)
        self.textures[target] = replace(placed, image=found)
        return 1.0

    def normals(self, reference: object) -> float:
        """Take a normal map; its strength."""
        image = self.reader.image(reference, plain=True)
        if image is None or not isinstance(reference, dict) or image.pixels.shape[2] < 3:
            return 1.0
        placed, own_set = self.reader.placing(reference, opaque(image))
        if self.uv_set not in (None, own_set):
            self.reader.notes.say(f"The normal map of {self.name!r} has other coordinates: it is not used.")
            return 1.0
        self.uv_set, self.textures[NORMAL] = own_set, placed
        return self.reader.file.floats(reference, "scale", (1.0,))[0]

    def _fits(self, own_set: int, target: str) -> bool:
        if self.uv_set is None:
            self.uv_set = own_set
        if own_set == self.uv_set:
            return True
        word = target.replace("_", " ")
        self.reader.notes.say(f"The mean of the picture of the {word} is used for all of {self.name!r}.")
        return False


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _object(source: Json, key: str) -> Json:
    """An object in an object; empty when it is absent or something else."""
    found: Any = source.get(key)
    return found if isinstance(found, dict) else {}
